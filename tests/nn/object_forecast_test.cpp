#include "worldmodel/nn/object_forecast.h"

#include <ATen/ops/allclose.h>
#include <ATen/ops/equal.h>
#include <ATen/ops/linalg_vector_norm.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/nn/support.h"
#include "worldmodel/nn/carried_frame.h"
#include "worldmodel/nn/evac_model.h"
#include "worldmodel/nn/hand_turns.h"
#include "worldmodel/nn/imagine.h"
#include "worldmodel/nn/weights.h"

namespace evac::nn {
namespace {

using testing::HasSubstr;
using testing::ThrowsMessage;

ModelConfig ForecastConfig(std::int64_t views) {
  ModelConfig config = TinyConfig();
  config.vae.channel_mult = {1, 1, 1};
  config.vae.patch_px = 1;
  config.views = views;
  config.object_forecast = true;
  config.unet.in_channels += 1;
  return config;
}

/// Cameras 1 m above the table, .3 m apart, that look straight down.
struct Cameras {
  Cameras(const ModelConfig& config, std::int64_t scenes, std::int64_t frames) {
    const std::int64_t h = config.LatentHeight(), w = config.LatentWidth(), rows = scenes * config.views;
    const Tensor x = ((at::arange(w, at::kFloat) - 0.5 * static_cast<double>(w - 1)) * 0.1).reshape({1, w}).expand({h, w}),
                 y = ((at::arange(h, at::kFloat) - 0.5 * static_cast<double>(h - 1)) * -0.1).reshape({h, 1}).expand({h, w});
    const Tensor ray = at::stack({x, y, at::full({h, w}, -1.0, at::kFloat)});
    const Tensor unit = ray / at::linalg_vector_norm(ray, 2, at::IntArrayRef{0}, true);
    direction = unit.reshape({1, 3, 1, h, w}).expand({rows, 3, frames, h, w}).contiguous();
    origin = at::zeros({rows, 3, frames, h, w});
    origin.select(1, 2).fill_(1);
    for (std::int64_t row = 0; row < rows; ++row)
      origin[row][0].fill_(0.3 * static_cast<double>(row % config.views));
  }
  Tensor direction, origin;
};

TEST(PointSeenAt, IsWhereTheRaysOfTwoCamerasMeet) {
  const ModelConfig config = ForecastConfig(2);
  const Cameras cameras(config, 1, 1);
  const Tensor point = at::tensor({0.11F, -0.04F, 0.2F});
  const Tensor seen = SeenAt(point.reshape({1, 1, 3}).expand({2, 1, 3}), cameras.direction, cameras.origin);
  const Tensor places = seen.select(2, 0).select(1, 0).narrow(1, 0, 2).contiguous();
  const Tensor found = PointSeenAt(places, at::ones({2}), cameras.direction, cameras.origin, 2, 0.19);
  EXPECT_TRUE(at::allclose(found[0], point.to(at::kDouble), 0, 2e-3)) << "the plane counts little";
  Tensor wrong = places.clone();
  wrong[1][0] += 1;  // a latent pixel, 10 cm
  const Tensor trusted = PointSeenAt(wrong, at::tensor({1.0F, 0.0F}), cameras.direction, cameras.origin, 2, 0.2);
  EXPECT_TRUE(at::allclose(trusted[0], point.to(at::kDouble), 0, 0.03)) << "who is not sure counts little";
}

TEST(PointSeenAt, OfOneCameraLiesInThePlane) {
  const ModelConfig config = ForecastConfig(1);
  const Cameras cameras(config, 1, 1);
  const Tensor middle = at::tensor({0.5F * static_cast<float>(config.LatentWidth() - 1) + 2,
                                    0.5F * static_cast<float>(config.LatentHeight() - 1)}).reshape({1, 2});
  const Tensor found = PointSeenAt(middle, at::ones({1}), cameras.direction, cameras.origin, 1, 0.1);
  EXPECT_TRUE(at::allclose(found[0], at::tensor({0.18, 0.0, 0.1}, at::kDouble), 0, 1e-4)) << found;
}

/// Scenes of pictures of noise and hands somewhere, the right one of which has closed.
struct Scenes {
  Scenes(const ModelConfig& config, std::int64_t count, std::int64_t frames) : cameras(config, count, frames) {
    at::manual_seed(3);
    const std::int64_t rows = count * config.views;
    given.image = at::rand({rows, 3, config.image_height_px, config.image_width_px}) * 2 - 1;
    given.direction = cameras.direction;
    given.origin = cameras.origin;
    given.arms = at::randn({count, frames, 16}) * 0.1;
    given.arms.select(2, 6).fill_(1);
    given.arms.select(2, 14).fill_(1);
    given.turns = at::zeros({count, frames, static_cast<std::int64_t>(kTurnRow)});
    const auto closing_of_right = static_cast<std::int64_t>(kTurnKinds * kTurnNumbers);
    given.turns.select(2, closing_of_right).fill_(1);
    given.turns.narrow(2, closing_of_right + 2, 8).copy_(given.arms.narrow(2, 8, 8));
  }
  ObjectForecast::Scenes Only(std::int64_t scene, std::int64_t views) const {
    return {given.image.narrow(0, scene * views, views), given.direction.narrow(0, scene * views, views),
            given.origin.narrow(0, scene * views, views), given.arms.narrow(0, scene, 1),
            given.turns.narrow(0, scene, 1)};
  }
  Cameras cameras;
  ObjectForecast::Scenes given;
};

TEST(ObjectForecast, SaysOfEverySceneByItselfHowLikelyThePlacesAre) {
  for (const std::int64_t views : {1, 2}) {
    const ModelConfig config = ForecastConfig(views);
    HashWeights weights;
    const ObjectForecast forecast(Scope(weights, kForecastPrefix), config);
    const Scenes scenes(config, 2, 3);
    const Tensor maps = forecast.Maps(scenes.given);
    EXPECT_EQ(maps.sizes(), (std::vector<std::int64_t>{2 * views, 1, 3, config.LatentHeight(), config.LatentWidth()}));
    EXPECT_GE(maps.min().item<double>(), 0);
    EXPECT_LE(maps.sum(at::IntArrayRef{1, 3, 4}).max().item<double>(), 1 + 1e-5);
    for (const std::int64_t scene : {0, 1})
      EXPECT_TRUE(at::allclose(forecast.Maps(scenes.Only(scene, views)), maps.narrow(0, scene * views, views), 1e-4, 1e-6));
  }
}

TEST(ObjectForecast, ShowsAllViewsTheLikeliestEndAlone) {
  const ModelConfig config = ForecastConfig(2);
  HashWeights weights;
  const ObjectForecast forecast(Scope(weights, kForecastPrefix), config);
  const Scenes scenes(config, 3, 4);
  const ObjectForecast::Answer answer = forecast(scenes.given);
  const Tensor maps = forecast.Maps(scenes.given).flatten(3);  // [BV, 1, T, h w]
  for (std::int64_t row = 0; row < maps.size(0); ++row) {
    for (std::int64_t t = 0; t < maps.size(2); ++t) {
      const auto end = LikeliestEnd(answer, config.views)[row / config.views][t].item<std::int64_t>();
      const Tensor wanted = answer.places[row][t][end].softmax(0).narrow(0, 0, maps.size(3));
      EXPECT_TRUE(at::allclose(maps[row][0][t], wanted)) << row << " " << t;
    }
  }
}

TEST(ObjectForecast, TakesTheEndWhosePlacesAreTheLikeliest) {
  constexpr std::int64_t kEnds = ObjectForecast::kEnds, kCells = 5;
  ObjectForecast::Answer answer;
  answer.ends = at::tensor({0.4F, 0.3F, 0.3F}).log().reshape({1, 1, kEnds});
  answer.places = at::zeros({2, 1, kEnds, kCells});
  const auto lies = [&](std::int64_t view, std::int64_t end, std::int64_t cell) { answer.places[view][0][end][cell].fill_(12); };
  for (const std::int64_t view : {0, 1}) {
    lies(view, 0, 0);
    lies(view, 1, 1);
    lies(view, 2, 1);
  }
  EXPECT_EQ(LikeliestEnd(answer, 2).item<std::int64_t>(), 1) << "two of .3 lay it in the same place";
  lies(1, 2, 4);
  answer.places[1][0][2][1].fill_(0);
  EXPECT_EQ(LikeliestEnd(answer, 2).item<std::int64_t>(), 0) << "in one view alone";
}

TEST(ObjectForecast, LooksAtNothingThatCameLongAfterAHandLetGo) {
  const ModelConfig config = ForecastConfig(1);
  HashWeights weights;
  const ObjectForecast forecast(Scope(weights, kForecastPrefix), config);
  Scenes scenes(config, 1, 1);
  const auto maps = [&](std::int64_t opens_at, std::int64_t strays_from, std::int64_t frame, float later_m) {
    std::vector<float> rows;
    for (std::int64_t t = 0; t <= frame; ++t) {
      const float x_m = t < strays_from ? 0.002F * static_cast<float>(t) : later_m;
      const float gripper = t >= 5 && t < opens_at ? 120 : 0;
      for (const float number : {0.0F, 0.0F, 0.0F, 0.0F, 0.0F, 0.0F, 1.0F, 0.0F, x_m, 0.1F, 0.2F, 0.0F, 0.0F, 0.0F, 1.0F, gripper})
        rows.push_back(number);
    }
    const std::vector<std::size_t> asked = {static_cast<std::size_t>(frame)};
    ObjectForecast::Scenes given = scenes.given;
    given.arms = at::tensor(std::vector<float>(rows.end() - 16, rows.end())).reshape({1, 1, 16});
    given.turns = at::tensor(HandTurns(rows, asked)).reshape({1, 1, static_cast<std::int64_t>(kTurnRow)});
    return forecast.Maps(given);
  };
  const Tensor settled = maps(20, 45, 44, 0);
  EXPECT_TRUE(at::allclose(maps(20, 45, 45, 0.3F), settled));
  EXPECT_TRUE(at::allclose(maps(20, 45, 140, -0.2F), settled));
  EXPECT_FALSE(at::allclose(maps(20, 45, 40, 0), settled, 1e-3, 1e-5)) << "until then it does";
  EXPECT_FALSE(at::allclose(maps(200, 45, 60, 0.3F), maps(200, 45, 60, -0.2F), 1e-3, 1e-5)) << "a hand that holds it carries it";
}

TEST(ObjectForecast, IsDoneAsLikelyAsItsEndsAreTogether) {
  const ModelConfig config = ForecastConfig(1);
  HashWeights weights;
  const ObjectForecast forecast(Scope(weights, kForecastPrefix), config);
  ObjectForecast::Answer answer = forecast(Scenes(config, 1, 2).given);
  answer.success.fill_(-40);
  EXPECT_NEAR(answer.Done().max().item<double>(), 0, 1e-6);
  answer.success.select(2, 1).fill_(40);
  EXPECT_TRUE(at::allclose(answer.Done(), answer.ends.softmax(2).select(2, 1)));
}

TEST(ObjectForecast, HangsOnThePictureTheHandAndWhereItClosed) {
  const ModelConfig config = ForecastConfig(2);
  HashWeights weights;
  const ObjectForecast forecast(Scope(weights, kForecastPrefix), config);
  const Scenes scenes(config, 1, 2);
  const Tensor maps = forecast.Maps(scenes.given);
  for (Tensor ObjectForecast::Scenes::*what :
       {&ObjectForecast::Scenes::image, &ObjectForecast::Scenes::arms, &ObjectForecast::Scenes::turns}) {
    ObjectForecast::Scenes other = scenes.given;
    other.*what = (other.*what) * 0.5;
    EXPECT_FALSE(at::allclose(forecast.Maps(other), maps, 1e-3, 1e-5));
  }
}

TEST(ObjectForecast, IsShownToTheDenoiserAndIsNothingWithoutThePicture) {
  const ModelConfig config = ForecastConfig(1);
  HashWeights weights;
  const EvacModel model(weights, config);
  const Scenes scenes(config, 1, config.Frames());
  const std::int64_t z = config.vae.z_channels, h = config.LatentHeight(), w = config.LatentWidth();
  const ChunkRequest request{at::zeros({1, z, config.memory, h, w}), scenes.given.image,
                             at::zeros({1, z, config.chunk, h, w}),  scenes.given.direction,
                             scenes.given.origin,                    at::zeros({1, config.chunk, 14}),
                             scenes.given.arms,                      scenes.given.turns};
  const Conditioning told = Condition(model, request);
  EXPECT_TRUE(at::equal(told.concat.object, model.object_forecast()->Maps(scenes.given)));
  const Tensor input = DenoiserInput(at::zeros({1, z, config.Frames(), h, w}), told.concat);
  EXPECT_TRUE(at::equal(input.narrow(1, config.unet.in_channels - 1, 1), told.concat.object)) << "the last channel";
  EXPECT_EQ(Unconditioned(model, request, told).concat.object.abs().max().item<double>(), 0);
}

TEST(ObjectForecast, WantsAChannelOfTheDenoiserAndACodecOfItsCells) {
  ModelConfig config = ForecastConfig(1);
  EXPECT_NO_THROW(config.Check());
  config.unet.in_channels -= 1;
  EXPECT_THAT([&] { config.Check(); }, ThrowsMessage<TensorError>(HasSubstr("one of the object's forecast")));
  config.unet.in_channels += 1;
  config.vae.channel_mult = {1, 1};
  config.image_height_px = config.image_width_px = 16;
  EXPECT_THAT([&] { config.Check(); }, ThrowsMessage<TensorError>(HasSubstr("a multiple of 4")));
}

}  // namespace
}  // namespace evac::nn
