#include "worldmodel/nn/frame_actions.h"

#include <gtest/gtest.h>

#include "tests/nn/support.h"
#include "worldmodel/nn/evac_model.h"

namespace evac::nn {
namespace {

/// One arm at (x, 0, 0) with some closure; the other is not there.
Tensor Rows(const std::vector<double>& x_m, double gripper) {
  Tensor rows = at::zeros({1, static_cast<std::int64_t>(x_m.size()), 16});
  rows.select(2, 6).fill_(1);
  rows.select(2, 14).fill_(1);
  rows.select(2, 15).fill_(gripper);
  for (std::size_t i = 0; i < x_m.size(); ++i) rows[0][static_cast<std::int64_t>(i)][8] = x_m[i];
  return rows;
}

TEST(FrameActions, SayWhereTheArmIsAndHowFarItCameSinceTheNewestMemory) {
  const Tensor numbers = FrameActions(Rows({0.1, 0.2, 0.25}, 60), 2)[0];
  ASSERT_EQ(numbers.sizes(), (std::vector<std::int64_t>{3, kFrameActionNumbers}));
  const std::int64_t right = kFrameActionNumbers / 2;
  EXPECT_FLOAT_EQ(numbers[2][right].item<float>(), 1.0F);       // .25 m
  EXPECT_FLOAT_EQ(numbers[2][right + 9].item<float>(), 0.0F);   // half closed
  EXPECT_NEAR(numbers[2][right + 10].item<float>(), 0.5, 1e-6);  // .05 m further
  EXPECT_NEAR(numbers[1][right + 10].item<float>(), 0.0, 1e-6);
}

TEST(FrameActions, SayOfEachHandByItselfWhatNoMemoryIsNeededFor) {
  const Tensor rows = Rows({0.1, 0.2, 0.25}, 60), poses = HandPoses(FrameActions(rows, 1));
  ASSERT_EQ(poses.sizes(), (std::vector<std::int64_t>{1, 3, 2, kHandPoseNumbers}));
  EXPECT_TRUE(at::equal(poses, HandPoses(FrameActions(rows, 3)))) << "whatever the memory ends with";
  EXPECT_FLOAT_EQ(poses[0][2][1][0].item<float>(), 1.0F) << "right, .25 m";
  EXPECT_FLOAT_EQ(poses[0][2][1][9].item<float>(), 0.0F) << "half closed";
  EXPECT_FLOAT_EQ(poses[0][2][0][9].item<float>(), -1.0F) << "left, open";
}

TEST(FrameActions, AreTheSameForBothSignsOfAQuaternion) {
  Tensor rows = Rows({0.1, 0.2}, 10), other = rows.clone();
  other.narrow(2, 11, 4).neg_();
  EXPECT_TRUE(at::equal(FrameActions(rows, 1), FrameActions(other, 1)));
}

TEST(FrameActions, TellOnlyANetworkThatWantsThem) {
  ModelConfig config = TinyConfig();
  const std::size_t plain = CheckpointKeys(config).size();
  config.unet.frame_actions = true;
  EXPECT_EQ(CheckpointKeys(config).size(), plain + 4);
}

}  // namespace
}  // namespace evac::nn
