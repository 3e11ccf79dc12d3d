#include "worldmodel/nn/hand_views.h"

#include <ATen/ops/equal.h>
#include <ATen/ops/linalg_vector_norm.h>
#include <gtest/gtest.h>

#include <cmath>

#include "tests/nn/support.h"
#include "worldmodel/nn/evac_model.h"
#include "worldmodel/nn/weights.h"

namespace evac::nn {
namespace {

constexpr std::int64_t kHeight = 6, kWidth = 8, kFrames = 3, kPlaneOfXAndY = 2 * 49, kMiddle = 24, kNextAlongX = 7;
constexpr double kStep_m = 0.012;

/// Cameras 1 m above the table that look straight down and see, in every frame, where they look: red is x, green is y.
struct Scene {
  explicit Scene(std::int64_t views) {
    const Tensor x = ((at::arange(kWidth, at::kFloat) - 3.5) * 0.1).reshape({1, kWidth}).expand({kHeight, kWidth}),
                 y = ((at::arange(kHeight, at::kFloat) - 2.5) * -0.1).reshape({kHeight, 1}).expand({kHeight, kWidth});
    const Tensor ray = at::stack({x, y, at::full({kHeight, kWidth}, -1.0, at::kFloat)});
    const auto in_all = [&](const Tensor& of_one) {
      return of_one.reshape({1, 3, 1, kHeight, kWidth}).expand({views, 3, kFrames, kHeight, kWidth}).contiguous();
    };
    direction = in_all(ray / at::linalg_vector_norm(ray, 2, at::IntArrayRef{0}, true));
    origin = in_all(at::tensor({0.0F, 0.0F, 1.0F}).reshape({3, 1, 1}).expand({3, kHeight, kWidth}));
    image = at::stack({x, y, at::ones_like(x)}).unsqueeze(0).expand({views, 3, kHeight, kWidth}).contiguous();
  }
  Tensor direction, origin, image;
};

/// Both hands at rest at the middle, the right one in frame 1 at (x, y, z), turned about z.
Tensor ArmsAt(double x_m, double y_m, double z_m, double turn = 0) {
  Tensor rows = at::zeros({1, kFrames, 16});
  rows.select(2, 6).fill_(1);
  rows.select(2, 14).fill_(1);
  const double numbers[] = {x_m, y_m, z_m, 0, 0, std::sin(turn / 2), std::cos(turn / 2)};
  for (std::int64_t i = 0; i < 7; ++i) rows[0][1][8 + i] = numbers[i];
  return rows;
}

/// Red, green, blue and seen of one point about the right hand in frame 1, in the last view.
std::vector<float> PointOf(const Tensor& arms, std::int64_t point, std::int64_t views = 1, double tool_length_m = 0) {
  const Scene scene(views);
  const Tensor about = HandViews(scene.image, scene.direction, scene.origin, arms, tool_length_m);
  EXPECT_EQ(about.sizes(), (std::vector<std::int64_t>{1, kFrames, 2, views * kHandPoints * kHandPointNumbers}));
  const Tensor numbers = about[0][1][1].reshape({views, kHandPoints, kHandPointNumbers})[views - 1][point].contiguous();
  return {numbers.data_ptr<float>(), numbers.data_ptr<float>() + kHandPointNumbers};
}

TEST(HandViews, AreReadWhereTheHandIs) {
  for (const std::int64_t views : {1, 2}) {
    const std::vector<float> middle = PointOf(ArmsAt(0.12, -0.07, 0), kPlaneOfXAndY + kMiddle, views);
    EXPECT_NEAR(middle[0], 0.12, 1e-5);
    EXPECT_NEAR(middle[1], -0.07, 1e-5);
    EXPECT_EQ(middle[2], 1);
    EXPECT_EQ(middle[3], 1);
  }
}

TEST(HandViews, TurnWithTheHand) {
  const std::int64_t ahead = kPlaneOfXAndY + kMiddle + kNextAlongX;
  EXPECT_NEAR(PointOf(ArmsAt(0.12, -0.07, 0), ahead)[0], 0.12 + kStep_m, 1e-5);
  const std::vector<float> turned = PointOf(ArmsAt(0.12, -0.07, 0, std::acos(0.0)), ahead);
  EXPECT_NEAR(turned[0], 0.12, 1e-5);
  EXPECT_NEAR(turned[1], -0.07 + kStep_m, 1e-5);
}

TEST(HandViews, AreNothingWhereThePictureDoesNotReach) {
  const std::vector<float> nothing = {0, 0, 0, 0};
  EXPECT_EQ(PointOf(ArmsAt(3, 0, 0), kPlaneOfXAndY + kMiddle), nothing);
  EXPECT_EQ(PointOf(ArmsAt(0, 0, 2), kPlaneOfXAndY + kMiddle), nothing) << "behind the camera";
}

/// What is shown of the right hand's closing in frame 2, if it was last closed at `then` and is at `now`.
struct ShownTurn {
  ShownTurn(const Tensor& then, const Tensor& now) {
    const Scene scene(1);
    Tensor turns = at::zeros({1, kFrames, kHandsOfARow, kKinds, kNumbers});
    Tensor closing = turns[0][2][1][0];
    closing[0] = 1;
    closing[1] = 4;
    closing.narrow(0, 2, 8).copy_(then[0][1].narrow(0, 8, 8));
    closing.narrow(0, 10, 8).copy_(then[0][1].narrow(0, 8, 8));
    closing[10] -= 0.02;  // it came along x
    Tensor arms = ArmsAt(0, 0, 0);
    arms[0][2].copy_(now[0][1]);
    all = TurnViews(scene.image, scene.direction, scene.origin, arms, turns.flatten(2), 0);
    const Tensor mine = all[0][2][1][0].contiguous();
    numbers.assign(mine.data_ptr<float>(), mine.data_ptr<float>() + mine.numel());
  }
  float Picture(std::int64_t point, std::int64_t colour) const {
    return numbers[static_cast<std::size_t>(point * kHandPointNumbers + colour)];
  }
  float Feature(std::int64_t index) const {
    return numbers[static_cast<std::size_t>(kHandPoints * kHandPointNumbers + index)];
  }
  static constexpr std::int64_t kHandsOfARow = kHands, kKinds = kTurnKinds, kNumbers = kTurnNumbers;
  Tensor all;
  std::vector<float> numbers;
};

/// A robot whose poses are its flange's: they were read there, a hand's length from what the fingers hold.
TEST(HandViews, AreReadWhereTheFingersMeetNotWhereThePoseIs) {
  constexpr double kTool_m = 0.23;
  Tensor arms = ArmsAt(0.12 - kTool_m, -0.07, 0);
  const double s = std::sqrt(0.5);  // turned about y, so that its z axis is the base's x
  const double turn[] = {0, s, 0, s};
  for (std::int64_t i = 0; i < 4; ++i) arms[0][1][11 + i] = turn[i];
  const std::vector<float> middle = PointOf(arms, kPlaneOfXAndY + kMiddle, 1, kTool_m);
  EXPECT_NEAR(middle[0], 0.12, 1e-5);
  EXPECT_NEAR(middle[1], -0.07, 1e-5);
  EXPECT_EQ(middle[3], 1);
}

TEST(TurnViews, AreReadWhereTheHandTurned) {
  const ShownTurn shown(ArmsAt(0.12, -0.07, 0), ArmsAt(-0.1, 0.1, 0.3));
  EXPECT_NEAR(shown.Picture(kPlaneOfXAndY + kMiddle, 0), 0.12, 1e-5);
  EXPECT_NEAR(shown.Picture(kPlaneOfXAndY + kMiddle, 1), -0.07, 1e-5);
  Tensor others = shown.all.clone();
  others[0][2][1][0].zero_();
  EXPECT_TRUE(at::equal(others, at::zeros_like(others))) << "of what did not turn nothing is shown";
}

TEST(TurnViews, SayHowTheHandMovedSince) {
  const double quarter = std::acos(0.0);
  const ShownTurn shown(ArmsAt(0.1, 0, 0, quarter), ArmsAt(0.1, 0.05, 0.2, quarter));
  const float wanted[] = {1, 0.25F, std::exp(-1.0F),  // there was one, four frames ago
                          0.5F, 0, 2,                // its x axis pointed along y
                          0, 0.5F, 2,                // base frame
                          1, 0, 0, 1, 0, 0,          // not turned since
                          0.6F, 0, 0};               // 2 cm a frame
  for (std::size_t i = 0; i < std::size(wanted); ++i)
    EXPECT_NEAR(shown.Feature(static_cast<std::int64_t>(i)), wanted[i], 1e-5) << i;
}

/// What a UNet that is told of arms, and of `hand_views` views about them, prepares of them.
Tensor PreparedFrames(std::int64_t hand_views, RandomWeights::LastLayers last_layers) {
  ModelConfig config = TinyConfig();
  config.unet.frame_actions = true;
  config.unet.hand_views = hand_views;
  RandomWeights random(5, last_layers);
  const UNet unet(Scope(random, "model.diffusion_model"), config.unet);
  UNet::Context context;
  context.tokens = at::zeros({1, config.unet.image_tokens + config.unet.action_tokens, config.unet.context_dim});
  context.fps = at::ones({1}, at::kLong);
  context.domain = at::zeros({1}, at::kLong);
  context.frames = at::ones({1, kFrames, 52});
  context.hands = at::ones({1, kFrames, 2, kHandPoints * kHandPointNumbers});
  return unet.Prepare(context).frames;
}

TEST(HandViews, ChangeNothingBeforeTheyAreTrainedAndSomethingAfter) {
  using enum RandomWeights::LastLayers;
  EXPECT_TRUE(at::equal(PreparedFrames(0, kZero), PreparedFrames(1, kZero)));
  EXPECT_FALSE(at::equal(PreparedFrames(0, kDrawn), PreparedFrames(1, kDrawn)));
}

TEST(HandViews, OfOtherThanAllViewsAreRefused) {
  ModelConfig config = TinyConfig();
  config.unet.hand_views = config.views + 1;
  EXPECT_THROW(config.Check(), TensorError);
}

}  // namespace
}  // namespace evac::nn
