#pragma once

#include "worldmodel/nn/evac_model.h"
#include "worldmodel/train/trainable_weights.h"
#include "worldmodel/train/world_batch.h"

/// Training of the world model (EVAC, Sec. 3), and what was added to it. The defaults are the paper's.
namespace evac::train {

/// What noise the memory is given, so that the network bears with its own mistakes later.
enum class MemoryNoise {
  kPublished,  ///< rising towards the newest frame, by a random angle: the reference's
  kUniform,    ///< one deviation per view of a sample, each drawn by itself: uniform up to `memory_noise`, for
               ///< `memory_noise_share` of them
};

/// How much an error counts at a diffusion step. As said of the squared error of v.
enum class StepWeight {
  kVelocity,  ///< 1: the paper
  kMinSnr,    ///< min(SNR, cap) / (SNR + 1) (Hang et al. 2023); 0 at pure noise, where nothing is learned then
  kClean,     ///< noise² min(1 / noise², cap): the error of x0, with a bound
};

struct WorldTrainingOptions {
  std::int64_t batch = 8;  ///< windows
  WindowOptions windows;   ///< chunk and memory are the model's
  double drop = 0.1;       ///< p of the condition dropouts, drawn as the reference does

  MemoryNoise memory_noise_kind = MemoryNoise::kPublished;
  double memory_noise = 0.3, memory_noise_share = 0.7;  ///< of kUniform

  /// Of the samples at pure noise. The others: uniform over the steps (the paper), or uniform in the logarithm of
  /// noise / signal between two bounds. A sampler must not ask in a gap below pure noise where nothing was trained.
  double terminal_share = 0;
  bool log_uniform = false;
  double ratio_from = 0.3, ratio_to = 166;

  StepWeight step_weight = StepWeight::kVelocity;
  double step_weight_cap = 3;
  double squared_below = 0;  ///< of an error of v at a place: nn::ErrorsOfPlaces; 0: the paper's squares
  double reach_weight = 0;   ///< more of latents where the object may be: WithinReach (reach.h)
  double object_weight = 0;  ///< more of latents at the object: a bell of `object_radius` latent pixels
  double object_radius = 1;
  double change_weight = 0;  ///< more of latents that differ from a chunk in which nothing changes, per unit
  std::vector<double>
      view_weights;  ///< how much each view counts beside the others, in the shards' order; empty: alike

  double self_memory_share = 0;   ///< of the samples whose memory the network imagined itself, in one step
  double self_memory_from = 0.5;  ///< after this part of the training
  std::int64_t self_memory_chunks =
      1;  ///< so many chunks back; the chunk before the last one imagined is remembered as it was

  bool train_action_resampler = false;  ///< the paper's page freezes it, its text trains it
  bool train_image_encoder = false;     ///< there is no pretrained one of a small size
  bool show_end_that_came = true;  ///< with `object_forecast`: the map of the end that came, so that the network draws what it
                                   ///< is told; false: of the likeliest, as it is asked later
};

/// What WorldTraining asks of its options. @throws TensorError for those that make no training of such a model, or that
/// are out of range (option_limits.h)
void CheckOptions(const WorldTrainingOptions& options, const nn::ModelConfig& config);

/// Whether training moves a parameter; what nothing reads stays.
bool IsTrained(const std::string& key, const WorldTrainingOptions& options);
/// The keys that training moves, of a model.
std::vector<NamedTensor> TrainedParameters(const TrainableWeights& weights, const nn::ModelConfig& config,
                                           const WorldTrainingOptions& options);

class WorldTraining {
 public:
  /// @param model   made from weights that are trained; it must outlive this, and so must the shards
  /// @param device  where its weights are. What is random is drawn on the CPU, so it is the same everywhere
  /// @throws TensorError for options that make no training, or that are out of range (option_limits.h)
  WorldTraining(const nn::EvacModel& model, const ShardSet& shards, const WorldTrainingOptions& options,
                at::Device device = at::kCPU);

  /// The loss at a place.
  Tensor Loss(const StepPlace& place) const;
  /// The same loss on these windows, noise and steps always the same, without dropouts and noise on the memory.
  double Measure(const std::vector<Window>& windows) const;
  /// The chunks of windows, imagined in one step from pure noise. @returns [BV, z, K, h, w]
  Tensor ImagineOnce(const WorldBatch& batch, Dice& dice) const;

  const WindowSampler& sampler() const { return sampler_; }

 private:
  struct Drops;
  Tensor LossOf(const WorldBatch& batch, const Drops& drops, const Tensor& t, Dice& dice, bool noisy_memory) const;
  Drops DrawDrops(const WorldBatch& batch, Dice& dice) const;
  std::int64_t DrawStep(Dice& dice) const;
  /// Numbers per row, to be multiplied with [rows, …].
  Tensor PerRow(const std::vector<float>& values, std::int64_t dims) const;
  Tensor Noise(Dice& dice, at::IntArrayRef shape) const { return dice.Normal(shape).to(device_); }
  WorldBatch BatchOf(const std::vector<Window>& windows) const { return MakeWorldBatch(shards_, windows).To(device_); }
  Tensor Weight(const WorldBatch& batch, const Tensor& still, const Tensor& t) const;
  nn::UNet::Context ContextOf(const Tensor& tokens, const WorldBatch& batch) const;
  /// Where the thing is likely to be, if the network is shown that; what says so is not trained here.
  Tensor ObjectMapsOf(const WorldBatch& batch) const;
  Tensor TokensOf(const WorldBatch& batch) const;
  /// Puts what the network imagines of the chunk before each window into the window's memory; into the picture that
  /// the image encoder sees as well, where memory is one frame.
  /// @param share  of the windows; their own memory is put in first, `chunks` - 1 deep
  void RememberOwn(const std::vector<Window>& windows, double share, std::int64_t chunks, WorldBatch& batch,
                   Dice& dice) const;

  const nn::EvacModel& model_;
  const ShardSet& shards_;
  WorldTrainingOptions options_;
  WindowSampler sampler_;
  at::Device device_;
};

}  // namespace evac::train
