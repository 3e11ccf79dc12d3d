#pragma once

#include <vector>

#include "worldmodel/nn/model_config.h"
#include "worldmodel/nn/tensor.h"

/// How much noise there is at each diffusion step, as the reference has it (docs/evac_quirks.md).
namespace evac::nn {

/// Betas with square roots evenly spaced, stretched to end in pure noise (Lin et al. 2024, Alg. 1), kept in double.
class NoiseSchedule {
 public:
  explicit NoiseSchedule(const ScheduleConfig& config);

  std::int64_t steps() const { return static_cast<std::int64_t>(alphas_cumprod_.size()); }
  /// alpha-bar of step t, as the checkpoint's float buffers say it.
  double AlphaBar(std::int64_t t) const { return alphas_cumprod_[Index(t)]; }
  /// The factor on clean latents at step t: 1 falling to base_scale; 1 everywhere without dynamic rescaling.
  double Scale(std::int64_t t) const { return scales_[Index(t)]; }
  bool from_last_frame() const { return from_last_frame_; }
  std::optional<double> carry_plane_m() const { return carry_plane_m_; }
  std::int64_t carry_frames() const { return carry_frames_; }
  double carry_unless_changed() const { return carry_unless_changed_; }
  bool carry_first() const { return carry_first_; }
  double unchanged_below() const { return unchanged_below_; }

  /// A buffer that a checkpoint carries: the key and its float values.
  struct Buffer {
    const char* key;
    std::vector<float> values;
  };
  /// In the checkpoint's order: betas, alphas_cumprod, …, scale_arr.
  std::vector<Buffer> Buffers() const;
  /// All ones: the weight of each step in the loss. Not in the checkpoint.
  std::vector<float> LossWeights() const { return std::vector<float>(alphas_cumprod_.size(), 1.0F); }

 private:
  std::size_t Index(std::int64_t t) const;
  std::vector<Buffer> PosteriorBuffers() const;

  std::vector<double> betas_, exact_alphas_cumprod_;
  std::vector<double> alphas_cumprod_, scales_;  ///< rounded to float
  std::vector<float> scale_buffer_;
  bool from_last_frame_;
  std::optional<double> carry_plane_m_;
  std::int64_t carry_frames_;
  double carry_unless_changed_;
  bool carry_first_;
  double unchanged_below_;
};

/// v-prediction (Salimans and Ho 2022): three ways to say the same of x_t = √ā x0 + √(1 - ā) ε.
Tensor VelocityFrom(const Tensor& x0, const Tensor& noise, double alpha_bar);
Tensor CleanFrom(const Tensor& x_t, const Tensor& v, double alpha_bar);
Tensor NoiseFrom(const Tensor& x_t, const Tensor& v, double alpha_bar);
Tensor AddNoise(const Tensor& x0, const Tensor& noise, double alpha_bar);

}  // namespace evac::nn
