#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "tests/train/prepared_world.h"
#include "worldmodel/nn/weights.h"
#include "worldmodel/train/forecast_training.h"
#include "worldmodel/train/trainable_weights.h"
#include "worldmodel/train/world_training.h"

namespace evac::train {
namespace {

using testing::AllOf;
using testing::HasSubstr;
using testing::ThrowsMessage;

const double kNone = std::nan("");

template <typename Options>
struct Case {
  const char* name;
  double Options::*option;
  double value;
  const char* wanted;
};

/// @param make  a training of such options
template <typename Options, typename Make>
void ExpectEachRefused(const Options& good, const std::vector<Case<Options>>& cases, Make make) {
  EXPECT_NO_THROW(make(good));
  for (const Case<Options>& one : cases) {
    Options options = good;
    options.*one.option = one.value;
    EXPECT_THAT([&] { make(options); },
                ThrowsMessage<TensorError>(AllOf(HasSubstr(std::string(one.name) + " is "), HasSubstr(one.wanted))))
        << one.name << " " << one.value;
  }
}

/// A world model of random weights and the shards it learns from.
struct World {
  explicit World(std::int64_t steps = 1000) : shards(at.folder / "shards", Split::kTrain), random(3), weights(random) {
    at.config.schedule.steps = steps;
    shards.OpenLatents(at.config.vae.z_channels, at.config.vae.Stride());
    model.emplace(weights, at.config);
    good = Quick(1).world;
    good.windows.chunk = at.config.chunk;
    good.windows.memory = at.config.memory;
  }
  WorldTraining Make(const WorldTrainingOptions& options) const { return {*model, shards, options}; }

  Prepared at{1};
  ShardSet shards;
  nn::RandomWeights random;
  TrainableWeights weights;
  std::optional<nn::EvacModel> model;
  WorldTrainingOptions good;
};

TEST(TrainWorld, OptionsOutOfRangeAreRefusedByName) {
  using O = WorldTrainingOptions;
  const World world;
  ExpectEachRefused<O>(world.good,
                       {{"object_radius", &O::object_radius, 0, "above 0"},
                        {"object_radius", &O::object_radius, kNone, "above 0"},
                        {"step_weight_cap", &O::step_weight_cap, 0, "above 0"},
                        {"reach_weight", &O::reach_weight, -1, "0 or more"},
                        {"object_weight", &O::object_weight, -8, "0 or more"},
                        {"object_weight", &O::object_weight, HUGE_VAL, "0 or more"},
                        {"change_weight", &O::change_weight, -1e-9, "0 or more"},
                        {"squared_below", &O::squared_below, kNone, "0 or more"},
                        {"memory_noise", &O::memory_noise, -0.3, "0 or more"},
                        {"memory_noise_share", &O::memory_noise_share, 1.01, "0 to 1"},
                        {"terminal_share", &O::terminal_share, kNone, "0 to 1"},
                        {"self_memory_share", &O::self_memory_share, 50, "0 to 1"},
                        {"self_memory_from", &O::self_memory_from, 50, "0 to 1"},
                        {"drop", &O::drop, -0.1, "0 to 1"}},
                       [&](const O& options) { world.Make(options); });
  using W = WindowOptions;
  ExpectEachRefused<W>(world.good.windows,
                       {{"rollout_share", &W::rollout_share, 50, "0 to 1"},
                        {"contact_share", &W::contact_share, -0.3, "0 to 1"},
                        {"closing_share", &W::closing_share, kNone, "0 to 1"},
                        {"opening_share", &W::opening_share, 2, "0 to 1"}},
                       [&](const W& windows) {
                         O options = world.good;
                         options.windows = windows;
                         world.Make(options);
                       });
}

TEST(TrainCodec, OptionsOutOfRangeAreRefusedByName) {
  using O = CodecTrainingOptions;
  const TempFolder folder;
  WriteSyntheticShards(folder.path(), {});
  const ShardSet shards(folder.path(), Split::kTrain);
  ExpectEachRefused<O>({},
                       {{"map_share", &O::map_share, 20, "0 to 1"},
                        {"contact_share", &O::contact_share, kNone, "0 to 1"},
                        {"squared_weight", &O::squared_weight, -1, "0 or more"},
                        {"kl_weight", &O::kl_weight, -1e-6, "0 or more"},
                        {"latent_noise", &O::latent_noise, -0.05, "0 or more"},
                        {"foreground_weight", &O::foreground_weight, kNone, "0 or more"},
                        {"foreground_radius", &O::foreground_radius, -0.1, "0 or more"}},
                       [&](const O& options) { CodecTraining(shards, SmallConfig(1).vae, options); });
}

TEST(TrainForecast, OptionsOutOfRangeAreRefusedByName) {
  using O = ForecastTrainingOptions;
  const TempFolder folder;
  WriteSyntheticShards(folder.path(), {});
  const ShardSet shards(folder.path(), Split::kTrain);
  ExpectEachRefused<O>({},
                       {{"variant_share", &O::variant_share, 50, "0 to 1"},
                        {"late_start", &O::late_start, -0.3, "0 to 1"},
                        {"failure_weight", &O::failure_weight, kNone, "at least 1"},
                        {"drop", &O::drop, 1, "below 1"},
                        {"picture_gain", &O::picture_gain, -0.1, "0 or more"},
                        {"picture_noise", &O::picture_noise, kNone, "0 or more"},
                        {"success_weight", &O::success_weight, -1, "0 or more"},
                        {"finder_weight", &O::finder_weight, HUGE_VAL, "0 or more"}},
                       [&](const O& options) { ForecastTraining(shards, SmallConfig(1), options); });
}

TEST(TrainWorld, PublishedMemoryNoiseIsOfAsManyStepsAsTheScheduleHas) {
  const World world(50);
  const WorldTraining training = world.Make(world.good);
  const at::NoGradGuard no_gradients;
  for (std::int64_t step = 0; step < 20; ++step)
    EXPECT_TRUE(std::isfinite(training.Loss({5, step, 0, 0}).item<double>())) << step;
}

TEST(TrainWorld, AScheduleOfOneStepThatEndsInPureNoiseIsRefused) {
  EXPECT_THAT([] { World(1); },  // its model
              ThrowsMessage<TensorError>(HasSubstr("schedule.steps is 1, wanted 2 or more")));
}

}  // namespace
}  // namespace evac::train
