#include "worldmodel/train/reach.h"

#include <gtest/gtest.h>

#include "tests/nn/support.h"
#include "worldmodel/nn/carried_frame.h"

namespace evac::train {
namespace {

constexpr std::int64_t kMemory = 4, kChunk = 3, kHeight = 8, kWidth = 12, kFrames = kMemory + kChunk;
constexpr double kCameraHeight_m = 1;

/// A camera that looks straight down from 1 m, `xs_m[frame]` along x; a latent pixel is 5 cm of the table.
Rays LooksDown(const std::vector<float>& xs_m) {
  const auto frames = static_cast<std::int64_t>(xs_m.size());
  Tensor c2w = at::zeros({frames, 4, 4}), k = at::zeros({frames, 3, 3});
  for (std::int64_t frame = 0; frame < frames; ++frame) {
    c2w[frame][0][0] = 1;
    c2w[frame][1][1] = -1;
    c2w[frame][2][2] = -1;
    c2w[frame][3][3] = 1;
    c2w[frame][0][3] = xs_m[static_cast<std::size_t>(frame)];
    c2w[frame][2][3] = kCameraHeight_m;
    k[frame][0][0] = k[frame][1][1] = 20;
    k[frame][0][2] = 6;
    k[frame][1][2] = 4;
    k[frame][2][2] = 1;
  }
  return RaysOf(c2w, k, {kHeight, kWidth}, {kHeight, kWidth});
}

/// One scene of two views: a camera that stands, and one that goes along x in the chunk. An object lies on the table at
/// (0, 0), the right gripper starts at (.2, .1) and goes .05 m along x with every frame.
struct OneScene {
  OneScene() {
    config.schedule.carry_plane_m = 0;
    config.pose_map.tool_length_m = 0;
    batch.scenes = 1;
    batch.views = 2;
    batch.memory = kMemory;
    const Rays still = LooksDown(std::vector<float>(kFrames, 0)), moving = LooksDown({0, 0, 0, 0, .05F, .1F, .15F});
    const auto views = [](const Tensor& a, const Tensor& b) { return at::stack({a, b}).transpose(1, 2); };
    batch.direction = views(still.direction, moving.direction).contiguous();
    batch.origin = views(still.origin, moving.origin).contiguous();
    batch.latents = at::zeros({2, 4, kFrames, kHeight, kWidth});
    batch.arms = at::zeros({1, kFrames, 16});
    batch.arms.select(2, 6).fill_(1);
    batch.arms.select(2, 14).fill_(1);
    for (std::int64_t frame = 0; frame < kFrames; ++frame) {
      batch.arms[0][frame][8] = 0.2 + 0.05 * static_cast<double>(std::max<std::int64_t>(0, frame - kMemory + 1));
      batch.arms[0][frame][9] = 0.1;
    }
    batch.object = at::empty({2, 2, kFrames});
    batch.object.select(1, 0).fill_(6);
    batch.object.select(1, 1).fill_(4);
  }

  double At(const Tensor& reach, std::int64_t view, std::int64_t k, std::int64_t y, std::int64_t x) const {
    return reach[view][0][k][y][x].item<double>();
  }

  nn::ModelConfig config = nn::TinyConfig();
  WorldBatch batch;
};

TEST(SeenAt, PointsAreWhereTheirRaysGo) {
  const Rays camera = LooksDown({0, 0.1F});
  const auto one = [](const Tensor& of) { return of.transpose(0, 1).unsqueeze(0).contiguous(); };
  const Tensor direction = one(camera.direction), origin = one(camera.origin);
  const Tensor place = at::tensor({7.25, 2.5}).unsqueeze(0);
  const Tensor point = nn::PointOnPlane(place, direction, origin, 0, 0.2);
  EXPECT_NEAR(point[0][2].item<double>(), 0.2, 1e-6);
  const Tensor seen = nn::SeenAt(point.unsqueeze(1), direction, origin);
  EXPECT_NEAR(seen[0][0][0][0].item<double>(), 7.25, 1e-4);
  EXPECT_NEAR(seen[0][0][0][1].item<double>(), 2.5, 1e-4);
  EXPECT_NEAR(seen[0][1][0][0].item<double>(), 7.25 - 0.1 * 20 / 0.8, 1e-4) << "the camera went 10 cm, 80 cm above";
  EXPECT_LE(nn::SeenAt(at::tensor({0.0, 0.0, 1.5}).reshape({1, 1, 3}), direction, origin)[0][0][0][2].item<double>(), 0)
      << "behind the camera";
  EXPECT_TRUE(nn::PointOnPlane(place, direction, origin, 0, 2).isnan().all().item<bool>()) << "never met";
}

TEST(Reach, IsWhereTheObjectWasAndWhereTheGrippersGo) {
  const OneScene scene;
  const Tensor reach = WithinReach(scene.batch, scene.config, 0.5);
  ASSERT_EQ(reach.sizes(), at::IntArrayRef({2, 1, kChunk, kHeight, kWidth}));
  EXPECT_LE(reach.max().item<double>(), 1 + 1e-6);
  for (std::int64_t k = 0; k < kChunk; ++k) {
    // The object at (6, 4) in pixels: a corner of four, each half a pixel away along both axes.
    EXPECT_NEAR(scene.At(reach, 0, k, 4, 6), std::exp(-0.5 * 0.5 / 0.25), 1e-4);
    EXPECT_NEAR(scene.At(reach, 0, k, 4, 10), scene.At(reach, 0, k, 0, 0), 1e-3) << "far from all";
    // The gripper at x .2 to .35 m, y .1 m: pixels 10 to 13, 2. Early frames know where it will go, too.
    EXPECT_NEAR(scene.At(reach, 0, k, 2, 10), std::exp(-0.5 * 0.5 / 0.25), 1e-3);
    EXPECT_NEAR(scene.At(reach, 0, k, 2, 11), std::exp(-0.5 * 0.5 / 0.25), 1e-3);
    // The camera that moves by a pixel a frame sees the object go the other way.
    EXPECT_NEAR(scene.At(reach, 1, k, 4, 6 - (k + 1)), std::exp(-0.5 * 0.5 / 0.25), 1e-3);
  }
}

TEST(Reach, KnowsNothingOfWhatHappened) {
  OneScene scene;
  const Tensor before = WithinReach(scene.batch, scene.config, 1);
  scene.batch.latents.narrow(2, kMemory, kChunk).fill_(3);
  scene.batch.object.narrow(2, kMemory, kChunk).fill_(1);
  EXPECT_TRUE(at::equal(WithinReach(scene.batch, scene.config, 1), before));
  scene.batch.object.narrow(2, kMemory - 1, 1).fill_(1);
  EXPECT_FALSE(at::equal(WithinReach(scene.batch, scene.config, 1), before)) << "where it was is known";
}

TEST(Reach, KeepsAnObjectInItsPlaceWhereNoPlaneIsKnown) {
  OneScene scene;
  scene.config.schedule.carry_plane_m.reset();
  const Tensor reach = WithinReach(scene.batch, scene.config, 0.5);
  for (const std::int64_t view : {0, 1}) EXPECT_NEAR(scene.At(reach, view, 2, 4, 6), std::exp(-0.5 * 0.5 / 0.25), 1e-4);
}

TEST(Reach, IsNowhereWhereNothingIsKnown) {
  OneScene scene;
  scene.batch.object.fill_(std::nan(""));
  scene.batch.arms.narrow(2, 8, 3).zero_();
  EXPECT_EQ(WithinReach(scene.batch, scene.config, 1).max().item<double>(), 0);
}

TEST(Reach, IsOfTheFingersNotOfTheFlange) {
  OneScene scene;
  scene.batch.object.fill_(std::nan(""));
  scene.batch.arms.select(2, 11).fill_(std::sqrt(0.5));  // a quarter turn about x: the tool points along -y
  scene.batch.arms.select(2, 14).fill_(std::sqrt(0.5));
  scene.config.pose_map.tool_length_m = 0.1;
  const Tensor reach = WithinReach(scene.batch, scene.config, 0.5);
  EXPECT_NEAR(scene.At(reach, 0, 0, 4, 10), std::exp(-0.5 * 0.5 / 0.25), 1e-3);
  EXPECT_LT(scene.At(reach, 0, 0, 2, 10), 0.01);
}

}  // namespace
}  // namespace evac::train
