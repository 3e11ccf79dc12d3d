#pragma once

#include <filesystem>
#include <functional>

#include "worldmodel/nn/evac_model.h"
#include "worldmodel/nn/mapped_tensors.h"

/// Checkpoints: from a file to a network and back, strictly. What is in a file and what the configuration asks for must
/// be the same, key by key and shape by shape; a network that silently keeps random numbers imagines silently wrong.
namespace evac::nn {

struct LoadOptions {
  at::ScalarType dtype = at::kFloat;  ///< of every parameter; the same as in the file: mapped, not copied
  at::Device device = at::kCPU;
  /// Of products, and of the values between the denoiser's layers. Nothing: products in the weights' type, and floats
  /// between the layers.
  std::optional<at::ScalarType> products = std::nullopt;
  bool with_unread = false;  ///< also give what nothing reads, for copying a file: dead keys, leftovers of CLIP
  /// False: the file is copied, and may be of another chunk, memory, picture size or `carry_frames` than the page, which
  /// say how a network is run.
  bool is_run = true;
};

struct LoadReport {
  std::vector<std::string> ignored_keys;  ///< in the file, and nothing reads them
  std::string schedule;                   ///< why the file's schedule is not used; empty: it is the configuration's own
};

/// How the noise schedule that lies in a file is to the configuration's, which is the one that is used.
/// @param tensors  of a file whose keys fit (CompareKeys)
/// @returns why the file's is put aside, in a sentence; empty: it is the configuration's own
/// @throws TensorError naming the first number that differs: both end in pure noise and are not the same, or latents are
///   scaled otherwise (`scale_arr`; of the codec's scale_factor CompareSizes knows).
std::string CompareSchedule(const MappedTensors& tensors, const ModelConfig& config);

/// Sizes that no tensor's shape shows, as the card of weights keeps them ("sizes"): how many frames are imagined at once,
/// remembered and carried, how large pictures are, how many heads attention has, what latents are scaled by, what the
/// network's answer is counted from, the table's plane, robot and rate. `carry_unless_changed` and `unchanged_below` are
/// none of them: they are chosen when a network is run.
/// @returns "chunk 16\n…"
std::string SizesNobodySees(const ModelConfig& config);
/// @param only  beginnings of the sizes to compare; none: all
/// @throws TensorError naming the file, the first size that differs, what was found and what is wanted. A file that says
///   none (of an earlier version, or published) is not compared
void CompareSizes(const TensorFile& file, const ModelConfig& config, const std::vector<std::string>& only = {});

/// The parameters of one file, as a network asks for them. Tensors keep the file mapped as long as they live.
class FileWeights final : public ParameterSource {
 public:
  /// @param path  .safetensors, or .pt/.ckpt of torch.save
  /// @throws TensorError naming the file: unreadable; missing, extra and misshapen keys (ten of each, and how many);
  ///   a schedule that ends in pure noise like the configuration's, and is another; latents scaled otherwise; a size that
  ///   its card says and the configuration has otherwise (CompareSizes; LoadOptions::is_run).
  FileWeights(const std::filesystem::path& path, const ModelConfig& config, const LoadOptions& options = {});

  /// Undefined for a key that nothing reads, unless asked for with `with_unread`.
  /// @throws TensorError for another shape, and as InType
  Tensor Take(const std::string& key, at::IntArrayRef shape) override;
  std::optional<at::ScalarType> ProductType() const override { return options_.products; }
  bool Has(const std::string& key) const { return tensors_.file().Has(key); }
  const TensorFile& file() const { return tensors_.file(); }
  const LoadReport& report() const { return report_; }

 private:
  MappedTensors tensors_;
  LoadOptions options_;
  LoadReport report_;
};

/// The network of a file. Its schedule is the configuration's, always. Everything that nothing reads is left out.
/// @throws TensorError as FileWeights.
EvacModel LoadModel(const std::filesystem::path& weights, const ModelConfig& config, const LoadOptions& options = {},
                    LoadReport* report = nullptr);

/// Numbers for a network that was never trained: functions of (seed, key, index) alone, the same on every machine.
/// Weights are uniform within ±1 / √fan-in as libtorch's layers begin, gains 1, offsets 0, tables and learned tokens
/// uniform with variance 1 / width.
class RandomWeights final : public ParameterSource {
 public:
  /// The layers that training starts from zero, so that every block begins as the identity: the last of each residual
  /// block, temporal convolution and transformer, of the frame rate's embedding, of the denoiser.
  enum class LastLayers { kDrawn, kZero };

  /// @param last  kDrawn: like all others, so that every layer matters in a test; kZero: for training
  explicit RandomWeights(std::uint64_t seed, LastLayers last = LastLayers::kDrawn) : seed_(seed), last_(last) {}
  Tensor Take(const std::string& key, at::IntArrayRef shape) override;

 private:
  std::uint64_t seed_;
  LastLayers last_;
};

/// The same numbers in another type.
/// @param name  for the message: "FILE: KEY"
/// @throws TensorError with the number, if one becomes infinite: f16 ends at 65504
Tensor InType(const std::string& name, const Tensor& tensor, at::ScalarType type);

struct SaveOptions {
  at::ScalarType dtype = at::kFloat;  ///< of every parameter; the schedule stays float
  TensorMetadata metadata = {{"format", "pt"}};
  std::vector<std::string> without = {};                        ///< keys to leave out, which nothing reads
  std::function<void(std::size_t, std::size_t)> progress = {};  ///< bytes done, bytes in all; after each tensor
};

/// Writes a checkpoint in the published order, one tensor in memory at a time: the file is there whole or not at all.
/// The same parameters give the same bytes.
/// @param source  is asked for every key of CheckpointKeys in order, but for the schedule, which is the configuration's
/// @throws TensorError as InType and as TensorFileWriter; there is no file then
void SaveWeights(const std::filesystem::path& path, ParameterSource& source, const ModelConfig& config,
                 const SaveOptions& options = {});

}  // namespace evac::nn
