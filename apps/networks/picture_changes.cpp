#include "apps/networks/picture_changes.h"

#include <vector>

#include "worldmodel/nn/pictures.h"
#include "worldmodel/train/option_limits.h"

namespace evac {
namespace {

/// A mean over 3x3 pixels; at the edges over those that are there, the edge's repeated. [N, H, W, 3]
at::Tensor Blurred(const at::Tensor& pictures) {
  const auto smooth = [](const at::Tensor& x, std::int64_t side) {
    const std::int64_t n = x.size(side);
    const at::Tensor before = at::cat({x.narrow(side, 0, 1), x.narrow(side, 0, n - 1)}, side);
    const at::Tensor after = at::cat({x.narrow(side, 1, n - 1), x.narrow(side, n - 1, 1)}, side);
    return (before + x + after) / 3;
  };
  return smooth(smooth(pictures, 1), 2);
}

}  // namespace

void CheckChanges(const char* training, const PictureChanges& changes) {
  train::RequireShares(training, {{"light", changes.light}, {"blur_share", changes.blur_share}});
  train::RequireWeights(training, {{"offset", changes.offset}});
  if (changes.blur_times < 1)
    train::RefuseOption(training, {"blur_times", static_cast<double>(changes.blur_times)}, "at least 1");
}

at::Tensor Changed(const at::Tensor& pictures, const PictureChanges& changes, train::Dice& dice) {
  std::vector<at::Tensor> samples;
  for (std::int64_t b = 0; b < pictures.size(0); ++b) {
    float gain[3], offset[3];
    for (int colour = 0; colour < 3; ++colour) {
      gain[colour] = static_cast<float>(dice.Uniform(1 - changes.light, 1 + changes.light));
      offset[colour] = static_cast<float>(dice.Uniform(-changes.offset, changes.offset));
    }
    at::Tensor sample =
        pictures[b].flatten(0, -4) * at::tensor(at::ArrayRef<float>(gain)) + at::tensor(at::ArrayRef<float>(offset));
    if (dice.Chance(changes.blur_share)) {
      const std::int64_t times = changes.blur_times > 1 ? 1 + dice.Below(changes.blur_times) : 1;
      for (std::int64_t i = 0; i < times; ++i) sample = Blurred(sample);
    }
    samples.push_back(sample.reshape(pictures[b].sizes()));
  }
  return at::stack(samples);
}

}  // namespace evac
