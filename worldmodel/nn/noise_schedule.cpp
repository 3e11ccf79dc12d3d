#include "worldmodel/nn/noise_schedule.h"

#include <cmath>
#include <functional>

namespace evac::nn {
namespace {

std::vector<double> SquareRootSpaced(double start, double end, std::int64_t steps) {
  std::vector<double> betas;
  const double from = std::sqrt(start), to = std::sqrt(end);
  for (std::int64_t i = 0; i < steps; ++i) {
    const double root =
        steps == 1 ? from : from + (to - from) * static_cast<double>(i) / static_cast<double>(steps - 1);
    betas.push_back(root * root);
  }
  return betas;
}

std::vector<double> CumulativeProduct(const std::vector<double>& betas) {
  std::vector<double> product;
  double so_far = 1;
  for (const double beta : betas) product.push_back(so_far *= 1 - beta);
  return product;
}

/// Shifted and stretched so that the last step is nothing but noise.
std::vector<double> WithZeroTerminal(const std::vector<double>& betas) {
  const std::vector<double> alpha_bar = CumulativeProduct(betas);
  const double first = std::sqrt(alpha_bar.front()), last = std::sqrt(alpha_bar.back());
  std::vector<double> stretched;
  double before = 1;
  for (const double value : alpha_bar) {
    const double root = (std::sqrt(value) - last) * first / (first - last);
    stretched.push_back(1 - root * root / before);
    before = root * root;
  }
  return stretched;
}

std::vector<float> Floats(std::size_t count, const std::function<double(std::size_t)>& value) {
  std::vector<float> values(count);
  for (std::size_t i = 0; i < count; ++i) values[i] = static_cast<float>(value(i));
  return values;
}

std::vector<double> Rounded(const std::vector<double>& values) {
  std::vector<double> rounded;
  for (const double value : values) rounded.push_back(static_cast<float>(value));
  return rounded;
}

/// From 1 to `base` over `turning` steps, then `base` for `steps` more.
std::vector<float> ScaleBuffer(const ScheduleConfig& config) {
  const auto turning = static_cast<std::size_t>(config.turning_step);
  return Floats(turning + static_cast<std::size_t>(config.steps), [&](std::size_t i) {
    if (i + 1 >= turning) return config.base_scale;
    return 1 + (config.base_scale - 1) * static_cast<double>(i) / static_cast<double>(turning - 1);
  });
}

}  // namespace

NoiseSchedule::NoiseSchedule(const ScheduleConfig& config)
    : betas_(SquareRootSpaced(config.linear_start, config.linear_end, config.steps)),
      from_last_frame_(config.from_last_frame),
      carry_plane_m_(config.carry_plane_m),
      carry_frames_(config.carry_frames),
      carry_unless_changed_(config.carry_unless_changed),
      carry_first_(config.carry_first),
      unchanged_below_(config.unchanged_below) {
  if (config.zero_terminal_snr) betas_ = WithZeroTerminal(betas_);
  exact_alphas_cumprod_ = CumulativeProduct(betas_);
  alphas_cumprod_ = Rounded(exact_alphas_cumprod_);
  if (config.dynamic_rescale) scale_buffer_ = ScaleBuffer(config);
  for (std::size_t i = 0; i < betas_.size(); ++i) scales_.push_back(config.dynamic_rescale ? scale_buffer_[i] : 1.0);
}

std::size_t NoiseSchedule::Index(std::int64_t t) const {
  if (t < 0 || t >= steps())
    throw TensorError("diffusion step " + std::to_string(t) + ", wanted 0 to " + std::to_string(steps() - 1));
  return static_cast<std::size_t>(t);
}

std::vector<NoiseSchedule::Buffer> NoiseSchedule::Buffers() const {
  const std::vector<double>& bar = exact_alphas_cumprod_;
  const std::size_t n = bar.size();
  std::vector<Buffer> buffers = {
      {"betas", Floats(n, [&](std::size_t i) { return betas_[i]; })},
      {"alphas_cumprod", Floats(n, [&](std::size_t i) { return bar[i]; })},
      {"alphas_cumprod_prev", Floats(n, [&](std::size_t i) { return i == 0 ? 1 : bar[i - 1]; })},
      {"sqrt_alphas_cumprod", Floats(n, [&](std::size_t i) { return std::sqrt(bar[i]); })},
      {"sqrt_one_minus_alphas_cumprod", Floats(n, [&](std::size_t i) { return std::sqrt(1 - bar[i]); })},
      {"log_one_minus_alphas_cumprod", Floats(n, [&](std::size_t i) { return std::log(1 - bar[i]); })},
      {"sqrt_recip_alphas_cumprod", std::vector<float>(n, 0.0F)},  // not used when v is predicted: 1 / 0 at the end
      {"sqrt_recipm1_alphas_cumprod", std::vector<float>(n, 0.0F)}};
  for (Buffer& buffer : PosteriorBuffers()) buffers.push_back(std::move(buffer));
  if (!scale_buffer_.empty()) buffers.push_back({"scale_arr", scale_buffer_});
  return buffers;
}

std::vector<NoiseSchedule::Buffer> NoiseSchedule::PosteriorBuffers() const {
  const std::vector<double>& bar = exact_alphas_cumprod_;
  const std::size_t n = bar.size();
  const auto before = [&](std::size_t i) { return i == 0 ? 1 : bar[i - 1]; };
  const auto variance = [&](std::size_t i) { return betas_[i] * (1 - before(i)) / (1 - bar[i]); };
  return {{"posterior_variance", Floats(n, variance)},
          {"posterior_log_variance_clipped",
           Floats(n, [&](std::size_t i) { return std::log(std::max(variance(i), 1e-20)); })},
          {"posterior_mean_coef1",
           Floats(n, [&](std::size_t i) { return betas_[i] * std::sqrt(before(i)) / (1 - bar[i]); })},
          {"posterior_mean_coef2",
           Floats(n, [&](std::size_t i) { return (1 - before(i)) * std::sqrt(1 - betas_[i]) / (1 - bar[i]); })}};
}

Tensor VelocityFrom(const Tensor& x0, const Tensor& noise, double alpha_bar) {
  return noise * std::sqrt(alpha_bar) - x0 * std::sqrt(1 - alpha_bar);
}
Tensor CleanFrom(const Tensor& x_t, const Tensor& v, double alpha_bar) {
  return x_t * std::sqrt(alpha_bar) - v * std::sqrt(1 - alpha_bar);
}
Tensor NoiseFrom(const Tensor& x_t, const Tensor& v, double alpha_bar) {
  return v * std::sqrt(alpha_bar) + x_t * std::sqrt(1 - alpha_bar);
}
Tensor AddNoise(const Tensor& x0, const Tensor& noise, double alpha_bar) {
  return x0 * std::sqrt(alpha_bar) + noise * std::sqrt(1 - alpha_bar);
}

}  // namespace evac::nn
