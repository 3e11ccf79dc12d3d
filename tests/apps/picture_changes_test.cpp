#include "apps/networks/picture_changes.h"

#include <gtest/gtest.h>

#include "worldmodel/nn/tensor.h"

namespace evac {
namespace {

/// How many pixels around a white one in the middle are no longer black, on average over many samples.
double Spread(const PictureChanges& changes) {
  constexpr std::int64_t kSamples = 200, kSide = 15;
  const at::Tensor pictures = at::zeros({kSamples, 1, kSide, kSide, 3});
  pictures.select(2, kSide / 2).select(2, kSide / 2).fill_(1);
  train::Dice dice({7, 0, 0, 0}, 1);
  const at::Tensor changed = Changed(pictures, changes, dice);
  return (changed > 1e-6).select(4, 0).sum().item<double>() / kSamples;
}

TEST(PictureChanges, ABlurIsTakenOnceToSoManyTimesEachAsOften) {
  PictureChanges changes{.light = 0, .offset = 0, .blur_share = 0, .blur_times = 3};
  EXPECT_DOUBLE_EQ(Spread(changes), 1);
  changes.blur_share = 1;
  EXPECT_NEAR(Spread(changes), (9 + 25 + 49) / 3.0, 3);
  changes.blur_times = 1;
  EXPECT_DOUBLE_EQ(Spread(changes), 9);
}

}  // namespace
}  // namespace evac
