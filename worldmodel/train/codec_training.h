#pragma once

#include "worldmodel/nn/vae.h"
#include "worldmodel/train/dice.h"
#include "worldmodel/train/shards.h"
#include "worldmodel/train/trainable_weights.h"

/// Training of the latent codec, an AutoencoderKL (Rombach et al. 2022), on the shards' pictures and pose maps: EVAC
/// encodes both with it.
namespace evac::train {

struct CodecTrainingOptions {
  std::int64_t batch = 32;        ///< pictures
  double map_share = 0.2;         ///< of the batch that is pose maps
  double squared_weight = 1;      ///< of the squared error beside the absolute one
  double kl_weight = 1e-6;        ///< per latent number, beside errors per colour
  /// Above 0: not the posterior is sampled, but noise of this size is added to its mean; the posterior is made a point
  /// when the training ends.
  double latent_noise = 0;
  double foreground_weight = 1;   ///< of pixels near the object, and of what is drawn in a pose map; others: 1
  double foreground_radius = 0.12;  ///< around the object's middle, in parts of the picture's height
  double contact_share = 0;       ///< of the frames that are picked among those in contact
};

/// What CodecTraining asks of its options. @throws TensorError for those that make no training
void CheckOptions(const CodecTrainingOptions& options);

/// Which pictures a step sees, as tensors.
struct CodecBatch {
  Tensor pictures;  ///< [N, 3, H, W] in [-1, 1]
  Tensor weight;    ///< [N, 1, H, W], mean about 1 or more
  Tensor noise;     ///< [N, z, h, w]
};

class CodecTraining {
 public:
  /// @throws TensorError for options that make no training
  /// @param device  where the codec's weights are
  CodecTraining(const ShardSet& shards, const nn::VaeConfig& config, const CodecTrainingOptions& options,
                at::Device device = at::kCPU);
  CodecBatch Batch(const StepPlace& place) const;
  Tensor Loss(const nn::Vae& vae, const CodecBatch& batch) const;

 private:
  struct Row {
    std::size_t shard;
    std::int64_t row;
  };
  Row PickRow(Dice& dice) const;

  const ShardSet& shards_;
  nn::VaeConfig config_;
  CodecTrainingOptions options_;
  at::Device device_;
  std::vector<Row> contacts_;
};

/// How well pictures survive the codec. PSNR in dB of colours 0 … 1.
struct CodecQuality {
  double psnr = 0;         ///< of the pictures
  double psnr_object = 0;  ///< within a square about the object; 0: no picture knows where it is
  double psnr_maps = 0;
};
/// @param pictures  how many of the set, evenly spaced
/// @param device    where the codec's weights are
CodecQuality MeasureCodec(const nn::Vae& vae, const ShardSet& shards, std::int64_t pictures,
                          at::Device device = at::kCPU);

/// Makes the latents of pictures have mean 0 and deviation 1 / scale_factor per channel, by what the layers next to the
/// latents do; what is decoded stays the same. With `point`: the posterior becomes its mean.
/// @param weights  the codec's, all of them, on one device; changed
void NormaliseLatents(const nn::Vae& vae, const ShardSet& shards, const std::vector<NamedTensor>& weights, bool point);

}  // namespace evac::train
