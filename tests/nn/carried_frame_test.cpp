#include "worldmodel/nn/carried_frame.h"

#include <ATen/ops/allclose.h>
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

TEST(CarriedFrame, OfACameraThatStandsStillIsTheFrame) {
  const Tensor frame = Picture();
  const CarriedFrame later = Carry(frame, {{}, {}, {}});
  ASSERT_EQ(later.frames.sizes(), (std::vector<std::int64_t>{1, 2, 2, kHeight, kWidth}));
  for (int k = 0; k < 2; ++k) EXPECT_TRUE(at::allclose(later.frames[0].select(1, k), frame, 1e-4, 1e-5));
  EXPECT_EQ(later.seen.min().item<double>(), 1);
}

TEST(CarriedFrame, MovesAgainstTheCameraAndRepeatsTheEdgeWhereNothingWasSeen) {
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

TEST(CarriedFrame, TurnsAndShrinksWithTheCamera) {
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

TEST(CarriedFrame, ThePlaneSaysHowFarThingsMove) {
  const Tensor frame = Picture();
  const Tensor near = Carry(frame, {{}, {.x_m = 0.1}}, 0.5).frames[0].select(1, 0);  // half as far: twice the motion
  EXPECT_TRUE(at::allclose(near.narrow(2, 0, kWidth - 2), frame.narrow(2, 2, kWidth - 2), 1e-4, 1e-4));
}

TEST(CarriedFrame, WhereNoRayMeetsThePlaneItTurnsWithTheCameraAlone) {
  const Tensor frame = Picture();
  const Tensor above = Carry(frame, {{}, {.x_m = 3}}, 7.0).frames[0].select(1, 0);  // the plane is behind the cameras
  EXPECT_TRUE(at::allclose(above, frame, 1e-4, 1e-5));
}

TEST(CarriedFrame, ARayAlongThePlaneIsFarAway) {
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

TEST(CarriedFrame, APictureFinerThanItsRaysMovesByItsOwnPixels) {
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

TEST(CarriedFrame, LatentsGoByWayOfTheirPictureAndWhatStandsStillStays) {
  ModelConfig config = TinyConfig();
  config.vae.scale_factor = 0.5;
  HashWeights weights;
  const EvacModel model(weights, config);
  const Rays still({{}, {}}), moved({{}, {.x_m = 0.04, .turn = 0.1}});
  const Tensor latents = at::rand({2, config.vae.z_channels, kHeight, kWidth}) - 0.5;
  const CarriedFrame later = CarryLatentsAlongPlane(model, latents, at::cat({still.direction, moved.direction}),
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

}  // namespace
}  // namespace evac::nn
