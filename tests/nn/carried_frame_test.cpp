#include "worldmodel/nn/carried_frame.h"

#include <ATen/ops/allclose.h>
#include <ATen/ops/equal.h>
#include <ATen/ops/linalg_vector_norm.h>
#include <ATen/ops/rand.h>
#include <gtest/gtest.h>

#include <cmath>

#include "tests/nn/support.h"
#include "worldmodel/nn/diffusion_loss.h"
#include "worldmodel/nn/latent_pictures.h"
#include "worldmodel/nn/weights.h"

namespace evac::nn {
namespace {

constexpr std::int64_t kHeight = 6, kWidth = 8;

/// A camera that looks straight down, its picture's right turned by `turn` from the base's x.
struct Camera {
  double x_m = 0, y_m = 0, height_m = 1, turn = 0;
};

/// Unit rays [3, h, w]: one position is .1 m on a plane 1 m below; the middle of the picture looks straight down.
Tensor DirectionOf(const Camera& camera) {
  const Tensor right =
      ((at::arange(kWidth, at::kFloat) - (kWidth - 1) / 2.0) * 0.1).reshape({1, kWidth}).expand({kHeight, kWidth});
  const Tensor up =
      ((at::arange(kHeight, at::kFloat) - (kHeight - 1) / 2.0) * -0.1).reshape({kHeight, 1}).expand({kHeight, kWidth});
  const double c = std::cos(camera.turn), s = std::sin(camera.turn);
  const Tensor ray = at::stack({right * c - up * s, right * s + up * c, at::full({kHeight, kWidth}, -1.0, at::kFloat)});
  return ray / at::linalg_vector_norm(ray, 2, at::IntArrayRef{0}, true);
}

Tensor OriginOf(const Camera& camera) {
  return at::tensor({camera.x_m, camera.y_m, camera.height_m}, at::kFloat)
      .reshape({3, 1, 1})
      .expand({3, kHeight, kWidth});
}

/// [1, 3, T, h, w] each.
struct Rays {
  explicit Rays(const std::vector<Camera>& cameras) {
    std::vector<Tensor> directions, origins;
    for (const Camera& camera : cameras) {
      directions.push_back(DirectionOf(camera));
      origins.push_back(OriginOf(camera));
    }
    direction = at::stack(directions, 1).unsqueeze(0);
    origin = at::stack(origins, 1).unsqueeze(0);
  }
  Tensor direction, origin;
};

/// The frame of the first camera as the others see it.
CarriedFrame Carry(const Tensor& frame, const std::vector<Camera>& cameras, double plane_m = 0) {
  const Rays rays(cameras);
  return CarryAlongPlane(frame.unsqueeze(0), rays.direction, rays.origin, 0, 1, plane_m);
}

Tensor Picture() { return at::rand({2, kHeight, kWidth}); }

/// By libtorch's operators (where gradients are kept) and in one pass of our own.
class CarriedAlongPlane : public testing::TestWithParam<bool> {
  const at::AutoGradMode keeps_gradients_{GetParam()};
};

INSTANTIATE_TEST_SUITE_P(Each, CarriedAlongPlane, testing::Bool());

TEST_P(CarriedAlongPlane, OfACameraThatStandsStillIsTheFrame) {
  const Tensor frame = Picture();
  const CarriedFrame later = Carry(frame, {{}, {}, {}});
  ASSERT_EQ(later.frames.sizes(), (std::vector<std::int64_t>{1, 2, 2, kHeight, kWidth}));
  for (int k = 0; k < 2; ++k) EXPECT_TRUE(at::allclose(later.frames[0].select(1, k), frame, 1e-4, 1e-5));
  EXPECT_EQ(later.seen.min().item<double>(), 1);
}

TEST_P(CarriedAlongPlane, MovesAgainstTheCameraAndRepeatsTheEdgeWhereNothingWasSeen) {
  const Tensor frame = Picture();
  const CarriedFrame later = Carry(frame, {{}, {.x_m = 0.2}, {.y_m = 0.1}});  // two to the right; one up
  const Tensor right = later.frames[0].select(1, 0), up = later.frames[0].select(1, 1);
  EXPECT_TRUE(at::allclose(right.narrow(2, 0, kWidth - 2), frame.narrow(2, 2, kWidth - 2), 1e-4, 1e-4));
  EXPECT_TRUE(
      at::allclose(right.narrow(2, kWidth - 2, 2), frame.narrow(2, kWidth - 1, 1).expand({2, kHeight, 2}), 1e-4, 1e-4));
  EXPECT_TRUE(at::allclose(up.narrow(1, 1, kHeight - 1), frame.narrow(1, 0, kHeight - 1), 1e-4, 1e-4));
  const Tensor seen = later.seen[0][0];
  EXPECT_EQ(seen[0].sum().item<double>(), kHeight * (kWidth - 2));
  EXPECT_EQ(seen[0].narrow(1, kWidth - 2, 2).sum().item<double>(), 0);
  EXPECT_EQ(seen[1][0].sum().item<double>(), 0);
}

TEST_P(CarriedAlongPlane, TurnsAndShrinksWithTheCamera) {
  const Tensor frame = Picture();
  const Tensor turned = Carry(frame, {{}, {.turn = M_PI}}).frames[0].select(1, 0);
  EXPECT_TRUE(at::allclose(turned, frame.flip({1, 2}), 1e-4, 1e-4));
  // From twice as high the frame is half as large, in the middle: what was at position 1 of 0 … 7 is at 2.25.
  const Tensor plain = at::arange(kWidth, at::kFloat).reshape({1, 1, kWidth}).expand({2, kHeight, kWidth}).contiguous();
  const CarriedFrame far = Carry(plain, {{}, {.height_m = 2}});
  EXPECT_NEAR(far.frames[0][0][0][2][2].item<double>(), 3.5 - 2 * 1.5, 1e-4);
  EXPECT_EQ(far.seen[0][0][0][2][0].item<double>(), 0);
  EXPECT_EQ(far.seen[0][0][0][2][3].item<double>(), 1);
}

TEST_P(CarriedAlongPlane, ThePlaneSaysHowFarThingsMove) {
  const Tensor frame = Picture();
  const Tensor near = Carry(frame, {{}, {.x_m = 0.1}}, 0.5).frames[0].select(1, 0);  // half as far: twice the motion
  EXPECT_TRUE(at::allclose(near.narrow(2, 0, kWidth - 2), frame.narrow(2, 2, kWidth - 2), 1e-4, 1e-4));
}

TEST_P(CarriedAlongPlane, WhereNoRayMeetsThePlaneItTurnsWithTheCameraAlone) {
  const Tensor frame = Picture();
  const Tensor above = Carry(frame, {{}, {.x_m = 3}}, 7.0).frames[0].select(1, 0);  // the plane is behind the cameras
  EXPECT_TRUE(at::allclose(above, frame, 1e-4, 1e-5));
}

TEST_P(CarriedAlongPlane, ARayAlongThePlaneIsFarAway) {
  const Tensor across = ((at::arange(kWidth, at::kFloat) - 3.5) * 0.1).reshape({1, kWidth}).expand({5, kWidth});
  const Tensor up = ((at::arange(5, at::kFloat) - 2) * 0.1).reshape({5, 1}).expand({5, kWidth});
  const Tensor ray = at::stack({at::ones({5, kWidth}), -across, up});  // along x; the middle row keeps its height
  const Tensor unit = ray / at::linalg_vector_norm(ray, 2, at::IntArrayRef{0}, true);
  const Tensor here = OriginOf({}).narrow(1, 0, 5), there = OriginOf({.x_m = 0.5}).narrow(1, 0, 5);
  const Tensor frame = at::rand({2, 5, kWidth});
  const CarriedFrame later = CarryAlongPlane(frame.unsqueeze(0), at::stack({unit, unit}, 1).unsqueeze(0),
                                             at::stack({here, there}, 1).unsqueeze(0), 0, 1, 2.0);
  EXPECT_TRUE(at::allclose(later.frames[0].select(1, 0).select(1, 2), frame.select(1, 2), 1e-4, 1e-4));
}

TEST_P(CarriedAlongPlane, APictureFinerThanItsRaysMovesByItsOwnPixels) {
  const Tensor picture = at::rand({3, 4 * kHeight, 4 * kWidth});
  const CarriedFrame later =
      Carry(picture, {{}, {.x_m = 0.025}, {.x_m = 0.1, .y_m = -0.05}});  // one pixel; four and two
  ASSERT_EQ(later.frames.sizes(), (std::vector<std::int64_t>{1, 3, 2, 4 * kHeight, 4 * kWidth}));
  ASSERT_EQ(later.seen.sizes(), (std::vector<std::int64_t>{1, 1, 2, kHeight, kWidth}));
  const Tensor one = later.frames[0].select(1, 0), more = later.frames[0].select(1, 1);
  EXPECT_TRUE(at::allclose(one.narrow(2, 0, 4 * kWidth - 1), picture.narrow(2, 1, 4 * kWidth - 1), 1e-4, 1e-4));
  EXPECT_TRUE(at::allclose(more.narrow(2, 0, 4 * kWidth - 4).narrow(1, 0, 4 * kHeight - 2),
                           picture.narrow(2, 4, 4 * kWidth - 4).narrow(1, 2, 4 * kHeight - 2), 1e-4, 1e-4));
}

TEST(CarriedFrame, OfOnePassIsThatOfLibtorchsOperators) {
  const Tensor pictures = at::rand({2, 3, 4 * kHeight, 4 * kWidth});
  const Rays one({{}, {.x_m = 0.13, .y_m = -0.31, .height_m = 0.8, .turn = 0.4}, {.height_m = 1.7, .turn = -2}}),
      other({{.turn = 1}, {.x_m = -0.2, .height_m = 0.4}, {.y_m = 3, .height_m = -1}});
  const Tensor direction = at::cat({one.direction, other.direction}), origin = at::cat({one.origin, other.origin});
  for (const double plane_m : {-0.2, 0.0, 0.5}) {
    const auto carry = [&](bool keeps_gradients) {
      const at::AutoGradMode mode(keeps_gradients);
      return CarryAlongPlane(pictures, direction, origin, 0, 1, plane_m);
    };
    const CarriedFrame by_operators = carry(true), in_one_pass = carry(false);
    EXPECT_TRUE(at::allclose(in_one_pass.frames, by_operators.frames, 1e-4, 1e-4)) << plane_m;
    EXPECT_TRUE(at::equal(in_one_pass.seen, by_operators.seen)) << plane_m;
    EXPECT_TRUE(at::equal(in_one_pass.shown, by_operators.shown)) << plane_m;
    EXPECT_GT(in_one_pass.seen.sum().item<double>(), 0) << plane_m;
    EXPECT_LT(in_one_pass.shown.to(at::kFloat).mean().item<double>(), 0.9) << plane_m;
  }
}

TEST(CarriedFrame, LatentsGoByWayOfTheirPictureAndWhatStandsStillStays) {
  ModelConfig config = TinyConfig();
  config.vae.scale_factor = 0.5;
  HashWeights weights;
  const EvacModel model(weights, config);
  const Rays still({{}, {}}), moved({{}, {.x_m = 0.04, .turn = 0.1}});
  const Tensor latents = at::rand({2, config.vae.z_channels, kHeight, kWidth}) - 0.5;
  const CarriedFrame later =
      CarryLatentsAlongPlane(model, latents.unsqueeze(2), at::cat({still.direction, moved.direction}),
                             at::cat({still.origin, moved.origin}), 0, 1, 0);
  EXPECT_TRUE(later.frames[0].select(1, 0).equal(latents[0]));
  EXPECT_EQ(later.seen[0].min().item<double>(), 1);
  const Tensor picture = DecodeLatents(model, latents.narrow(0, 1, 1)).clamp(-1, 1);
  const CarriedFrame pictures = CarryAlongPlane(picture, moved.direction, moved.origin, 0, 1, 0);
  const Tensor wanted = EncodeImages(model, pictures.frames.select(2, 0), Tensor());
  EXPECT_TRUE(at::allclose(later.frames.narrow(0, 1, 1).select(2, 0), wanted, 1e-4, 1e-5));
  EXPECT_FALSE(at::allclose(later.frames[1].select(1, 0), latents[1], 1e-2, 1e-2));
  EXPECT_TRUE(later.seen[1].equal(pictures.seen[0]));
}

/// Two frames to carry from and one to carry to, of a codec whose latents are as fine as its pictures.
struct TwoFrames {
  TwoFrames() {
    config.vae.scale_factor = 0.5;
    latents = at::rand({1, config.vae.z_channels, 2, kHeight, kWidth}) - 0.5;
  }
  CarriedFrame Carry(const Rays& rays, std::int64_t frames) const {
    return CarryLatentsAlongPlane(model, latents.narrow(2, 2 - frames, frames), rays.direction, rays.origin, 2 - frames,
                                  2, 0);
  }

  HashWeights weights;
  ModelConfig config = TinyConfig();
  EvacModel model{weights, config};
  Tensor latents;
};

TEST(CarriedFrame, AnOlderFrameShowsWhatTheNewestDoesNot) {
  const TwoFrames given;
  const Rays rays({{.x_m = 0.4}, {}, {.x_m = 0.2}});  // the last is between both: two places to the side of each
  const CarriedFrame one = given.Carry(rays, 1), two = given.Carry(rays, 2);
  const Tensor seen_by_newest = one.seen[0][0][0], seen = two.seen[0][0][0];
  EXPECT_EQ(seen_by_newest.narrow(1, 0, kWidth - 2).min().item<double>(), 1);
  EXPECT_EQ(seen_by_newest.narrow(1, kWidth - 2, 2).max().item<double>(), 0);
  EXPECT_TRUE(seen.narrow(1, 0, kWidth - 2).equal(seen_by_newest.narrow(1, 0, kWidth - 2)));
  EXPECT_TRUE((seen.narrow(1, kWidth - 2, 2) == kOlder).all().item<bool>());
  // What is encoded is one picture made of both.
  const auto picture = [&](std::int64_t frame) {
    return DecodeLatents(given.model, given.latents.select(2, frame)).clamp(-1, 1);
  };
  const CarriedFrame from_newest = CarryAlongPlane(picture(1), rays.direction, rays.origin, 1, 2, 0),
                     from_older = CarryAlongPlane(picture(0), rays.direction, rays.origin, 0, 2, 0);
  const Tensor both = at::where(from_newest.shown, from_newest.frames, from_older.frames);
  EXPECT_TRUE(
      at::allclose(two.frames.select(2, 0), EncodeImages(given.model, both.select(2, 0), Tensor()), 1e-4, 1e-5));
  EXPECT_FALSE(at::allclose(two.frames, one.frames, 1e-2, 1e-2));
}

TEST(CarriedFrame, AnOlderFrameAddsNothingToWhatTheNewestShows) {
  const TwoFrames given;
  for (const Rays& rays : {Rays({{.x_m = 0.4}, {}, {}}), Rays({{}, {}, {.x_m = 0.2}})}) {
    const CarriedFrame one = given.Carry(rays, 1), two = given.Carry(rays, 2);
    EXPECT_TRUE(two.frames.equal(one.frames));
    EXPECT_TRUE(two.seen.equal(one.seen));
  }
}

/// A scene of a head's and a wrist's view: two frames to carry from and one to carry to. The wrist's older frame shows, of
/// its last, the columns kWidth - 2 and kWidth - 1, which its newest does not; the head is where the wrist is last.
struct HeadAndWrist {
  explicit HeadAndWrist(double unless_changed) {
    config.views = 2;
    config.vae.scale_factor = 0.5;
    config.schedule.from_last_frame = true;
    config.schedule.carry_plane_m = 0;
    config.schedule.carry_frames = 2;
    config.schedule.carry_unless_changed = unless_changed;
    config.unet.in_channels += config.vae.z_channels + 1;
    config.Check();
    latents = (Noise({1, config.vae.z_channels, 1, kHeight, kWidth}, 7) * 0.3).expand({2, -1, 2, -1, -1});
  }

  /// The head sees this place change by this much from the older frame to the newest.
  void Change(std::int64_t y, std::int64_t x, double by) {
    latents = latents.clone();
    latents.select(0, 0).select(1, 1).select(1, y).select(1, x).add_(by);
  }

  /// What the wrist's last place sees.
  CarriedFrame Carry(const Tensor& noiseless = {}) const {
    const EvacModel model(weights, config);
    const Rays of_head({older_head, head, head}), of_wrist({{.x_m = 0.4}, {}, {.x_m = 0.2}});
    const CarriedFrame both =
        CarryLatentsAlongPlane(model, latents, at::cat({of_head.direction, of_wrist.direction}),
                               at::cat({of_head.origin, of_wrist.origin}), 0, 2, 0, noiseless);
    return {both.frames.narrow(0, 1, 1), both.seen.narrow(0, 1, 1), {}};
  }

  mutable HashWeights weights;
  ModelConfig config = TinyConfig();
  Camera head{.x_m = 0.2}, older_head = head;
  Tensor latents;
};

TEST(CarriedFrame, WhatAnotherViewSawTakenIsNotShownWhereItWas) {
  HeadAndWrist given(0.4);
  const CarriedFrame before = given.Carry();
  const Tensor seen_before = before.seen[0][0][0];
  ASSERT_TRUE((seen_before.narrow(1, kWidth - 2, 2) == kOlder).all().item<bool>());
  given.Change(1, kWidth - 1, 1);
  const CarriedFrame after = given.Carry();
  Tensor wanted = seen_before.clone();
  wanted.narrow(0, 0, 3).narrow(1, kWidth - 2, 2).zero_();  // there and next to it
  EXPECT_TRUE(after.seen[0][0][0].equal(wanted)) << after.seen[0][0][0];
  EXPECT_FALSE(at::allclose(after.frames, before.frames, 1e-2, 1e-2));
}

TEST(CarriedFrame, WhatStaysIsShownByOlderFrames) {
  const HeadAndWrist unchanged(0.4);
  const CarriedFrame wanted = unchanged.Carry();
  HeadAndWrist little(0.4), not_asked(0), in_view_of_newest(0.4), head_moved(0.4), noise(0.4);
  little.Change(1, kWidth - 1, 0.39);
  not_asked.Change(1, kWidth - 1, 1);
  in_view_of_newest.Change(1, 2, 1);
  head_moved.Change(1, kWidth - 1, 1);
  head_moved.older_head.y_m = 0.1;
  noise.Change(1, kWidth - 1, 1);
  for (const HeadAndWrist* given : {&little, &not_asked, &in_view_of_newest, &head_moved})
    EXPECT_TRUE(given->Carry().seen.equal(wanted.seen));
  EXPECT_TRUE(noise.Carry(unchanged.latents).seen.equal(wanted.seen));
  EXPECT_TRUE(little.Carry().frames.equal(wanted.frames));
}

TEST(CarriedFrame, EachSceneIsAskedOfItsOwnOtherView) {
  HeadAndWrist changed(0.4);
  const HeadAndWrist unchanged(0.4);
  changed.Change(1, kWidth - 1, 1);
  const Rays of_head({changed.head, changed.head, changed.head}), of_wrist({{.x_m = 0.4}, {}, {.x_m = 0.2}});
  const Tensor direction = at::cat({of_head.direction, of_wrist.direction}),
               origin = at::cat({of_head.origin, of_wrist.origin});
  const EvacModel model(changed.weights, changed.config);
  const CarriedFrame scenes =
      CarryLatentsAlongPlane(model, at::cat({unchanged.latents, changed.latents, unchanged.latents}),
                             direction.repeat({3, 1, 1, 1, 1}), origin.repeat({3, 1, 1, 1, 1}), 0, 2, 0);
  EXPECT_TRUE(scenes.seen[1].equal(unchanged.Carry().seen[0]));
  EXPECT_TRUE(scenes.seen[3].equal(changed.Carry().seen[0]));
  EXPECT_TRUE(scenes.seen[5].equal(unchanged.Carry().seen[0]));
  EXPECT_THROW(CarryLatentsAlongPlane(model, unchanged.latents.narrow(0, 1, 1), of_wrist.direction, of_wrist.origin, 0,
                                      2, 0),
               TensorError)
      << "a wrist without its head";
}

TEST(CarriedFrame, AskingAnotherViewWantsAnotherViewAndOlderFrames) {
  const auto refused = [](auto change) {
    ModelConfig config = HeadAndWrist(0.4).config;
    change(config);
    EXPECT_THROW(config.Check(), TensorError);
  };
  refused([](ModelConfig& config) { config.views = 1; });
  refused([](ModelConfig& config) { config.schedule.carry_frames = 1; });
  refused([](ModelConfig& config) { config.schedule.carry_unless_changed = -0.1; });
  refused([](ModelConfig& config) { config.schedule.carry_unless_changed = std::nan(""); });
}

TEST(CarriedFrame, NoMoreAreCarriedThanAreRemembered) {
  ModelConfig config = TinyConfig();
  config.schedule.carry_frames = 2;
  EXPECT_THROW(config.Check(), TensorError) << "along no plane";
  config.schedule.from_last_frame = true;
  config.schedule.carry_plane_m = 0;
  config.unet.in_channels += config.vae.z_channels + 1;
  EXPECT_NO_THROW(config.Check());
  config.schedule.carry_frames = config.memory + 1;
  EXPECT_THROW(config.Check(), TensorError);
}

TEST(CarriedFrame, TheFirstPictureStandsBesideTheNewest) {
  const at::NoGradGuard no_gradients;  // as Remember has: with gradients other loops do the same
  ModelConfig config = TinyConfig();
  config.schedule.from_last_frame = true;
  config.schedule.carry_plane_m = 0;
  config.schedule.carry_first = true;
  EXPECT_THROW(config.Check(), TensorError) << "too few channels";
  config.unet.in_channels += 2 * (config.vae.z_channels + 1);
  config.memory = 2;
  config.Check();
  HashWeights weights;
  const EvacModel model(weights, config);
  const Rays rays({{.x_m = 0.4}, {}, {.x_m = 0.2}});
  const Tensor memory = at::rand({1, config.vae.z_channels, 2, kHeight, kWidth}) - 0.5,
               mask = at::ones({1, 1, 3, kHeight, kWidth}),
               x = at::rand({1, config.vae.z_channels, 3, kHeight, kWidth});
  Concat concat{{}, mask, at::zeros_like(x), rays.direction, rays.origin};
  Remember(model, memory, concat);
  const CarriedFrame first =
      CarryLatentsAlongPlane(model, memory.narrow(2, 0, 1), rays.direction, rays.origin, 0, 2, 0);
  const Tensor input = DenoiserInput(x, concat);
  ASSERT_EQ(input.size(1), config.unet.in_channels);
  const std::int64_t z = config.vae.z_channels;
  const Tensor shown = input.narrow(1, input.size(1) - z - 1, z), seen = input.narrow(1, input.size(1) - 1, 1);
  EXPECT_TRUE(shown.narrow(2, 0, 2).equal(memory));
  EXPECT_TRUE(shown.narrow(2, 2, 1).equal(first.frames));
  EXPECT_TRUE(seen.narrow(2, 2, 1).equal(first.seen));
  EXPECT_EQ(first.seen[0][0][0].narrow(1, 0, 2).max().item<double>(), 0) << "it looked elsewhere";
  EXPECT_FALSE(concat.carried.narrow(2, 2, 1).equal(concat.first.narrow(2, 2, 1)));
}

}  // namespace
}  // namespace evac::nn
