#include "worldmodel/nn/sampler.h"

#include <utility>

namespace evac::nn {
namespace {

/// Standard deviation of each row of the first axis, [N, 1, 1, 1, 1].
Tensor Spread(const Tensor& x) {
  const Tensor deviation = x.flatten(1).std(1, /*unbiased=*/true);
  std::vector<std::int64_t> shape(static_cast<std::size_t>(x.dim()), 1);
  shape[0] = x.size(0);
  return deviation.reshape(shape);
}

}  // namespace

Denoise Guided(Denoise conditional, Denoise unconditional, double scale, double rescale) {
  if (scale == 1) return conditional;
  return [=](const Tensor& x_t, std::int64_t t) {
    const Tensor with = conditional(x_t, t);
    const Tensor without = unconditional(x_t, t);
    const Tensor guided = without + (with - without) * scale;
    if (rescale <= 0) return guided;
    return guided * (Spread(with) / Spread(guided)) * rescale + guided * (1 - rescale);
  };
}

Tensor WithMemory(const Tensor& x, const SampleStart& start, const NoiseSchedule& schedule, std::int64_t t) {
  if (start.memory == 0) return x;
  const Tensor memory = start.x.narrow(2, 0, start.memory) * (start.scale_memory ? schedule.Scale(t) : 1.0);
  return at::cat({memory, x.narrow(2, start.memory, x.size(2) - start.memory)}, 2);
}

Tensor WithCleanMemory(const Tensor& x, const SampleStart& start) {
  if (start.memory == 0) return x;
  return at::cat({start.x.narrow(2, 0, start.memory), x.narrow(2, start.memory, x.size(2) - start.memory)}, 2);
}

}  // namespace evac::nn
