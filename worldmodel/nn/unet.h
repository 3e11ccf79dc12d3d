#pragma once

#include <functional>
#include <optional>
#include <variant>
#include <vector>

#include "worldmodel/nn/model_config.h"
#include "worldmodel/nn/transformers.h"

/// The denoiser of EVAC (Sec. 3; layers as the reference, docs/evac_quirks.md): a latent video UNet whose frames are the
/// memory followed by the chunk to imagine.
namespace evac::nn {

/// What does not change while a chunk is denoised, worked out once.
struct PreparedContext {
  std::vector<std::vector<KeyValue>> keys_values;  ///< [spatial transformer][layer]
  Tensor embedding;                                ///< [B, E]: frame rate and robot
  Tensor frames;                                   ///< [B, T, E]: arms of each frame and what is about them, or undefined
};

/// Called with "input_blocks.1.0", …, and what that module answered, in the layout of the reference's module.
using Observer = std::function<void(const std::string& name, const Tensor& output)>;

class UNet {
 public:
  UNet(const Scope& at, const UNetConfig& config);

  struct Context {
    Tensor tokens;  ///< [BV, image tokens + action tokens, context_dim]; actions are read from the first view
    Tensor fps;     ///< [B] integers
    Tensor domain;  ///< [B] integers: rows of the table of robots
    std::int64_t views = 1;
    Tensor frames = {};  ///< [B, T, kFrameActionNumbers]; read if the network has `frame_actions`
    Tensor hands = {};   ///< [B, T, 2, any]: HandViews; read if the network has `hand_views`
  };
  PreparedContext Prepare(const Context& context) const;

  struct Input {
    Tensor x;  ///< [BV, in_channels, T, h, w]
    Tensor t;  ///< [BV] integers: diffusion steps of the frames to imagine; memory frames are at 0
    std::int64_t views = 1;
    std::int64_t memory = 0;  ///< N: frames that are clean
  };
  /// @returns [BV, out_channels, T, h, w]: v of every frame; what it says of memory frames means nothing.
  Tensor operator()(const Input& input, const PreparedContext& context, const Observer* observer = nullptr) const;

 private:
  struct Resample {
    Resample(const Scope& at, std::int64_t channels, bool up);
    Tensor operator()(const Tensor& x) const;
    bool up;
    Conv2d conv;
  };
  struct Transformer {
    SpatialTransformer spatial;
    std::size_t index;  ///< into PreparedContext::keys_values
  };
  using Layer = std::variant<Conv2d, ResBlock, Transformer, TemporalTransformer, Resample>;
  using Block = std::vector<Layer>;
  struct Pass;

  void MakeInput(const Scope& at);
  void MakeMiddle(const Scope& at);
  void MakeOutput(const Scope& at);
  void AddTransformers(Block& block, const Scope& at, std::int64_t channels);
  bool HasAttention() const;
  Tensor InProductType(const Tensor& x) const;
  Tensor Embedding(const Input& input, const PreparedContext& context) const;
  Tensor Run(const Block& block, const std::string& name, const Tensor& x, const Pass& pass) const;

  UNetConfig config_;
  ProductType product_;   ///< where it is not that of the weights, values between the layers are kept so too
  Tensor domain_embedding_;  ///< [domains, E]
  EmbeddingMlp time_embed_, fps_embedding_;
  std::optional<EmbeddingMlp> frame_embedding_, hand_embedding_;
  std::vector<Block> input_blocks_;
  std::optional<TemporalTransformer> init_attention_;
  Block middle_;
  std::vector<Block> output_blocks_;
  std::optional<GroupNorm> out_norm_;
  std::optional<Conv2d> out_conv_;
  std::vector<Listens> listens_;  ///< of each spatial transformer, in order

  // While it is made: widths of the skips, width and downsampling so far.
  std::vector<std::int64_t> skips_;
  std::int64_t width_ = 0, downsampling_ = 1;
};

}  // namespace evac::nn
