#include "worldmodel/train/train_world.h"

#include <cstdio>
#include <deque>
#include <memory>
#include <utility>

#include "worldmodel/nn/weight_keys.h"
#include "worldmodel/nn/weights.h"
#include "worldmodel/train/option_limits.h"
#include "worldmodel/train/weight_files.h"

namespace evac::train {
namespace {

constexpr std::int64_t kStripWindows = 6;

/// The sources of a start, kept together.
struct Sources {
  Sources(const WorldStart& start, const nn::ModelConfig& config, std::uint64_t seed)
      : random(seed, nn::RandomWeights::LastLayers::kZero), codec(start.codec), routed(Routes(start, config)) {}

  std::vector<RoutedWeights::Route> Routes(const WorldStart& start, const nn::ModelConfig& config) {
    std::vector<RoutedWeights::Route> routes = {{kCodecPrefix, &codec}};
    if (!start.forecast.empty()) {
      forecast = std::make_unique<CheckpointWeights>(start.forecast);
      routes.push_back({nn::kForecastPrefix, forecast.get()});
    }
    if (start.init.empty()) {
      routes.push_back({"", &random});
      return routes;
    }
    if (start.init_widen)
      init = std::make_unique<WidenedWeights>(start.init, config.object_forecast);
    else
      init = std::make_unique<CheckpointWeights>(start.init);
    for (const std::string& prefix : start.init_except) routes.push_back({prefix, &random});
    routes.push_back({"", init.get()});
    return routes;
  }

  nn::RandomWeights random;
  CheckpointWeights codec;
  std::unique_ptr<nn::ParameterSource> forecast, init;
  RoutedWeights routed;
};

}  // namespace

void CheckPoseMaps(const ShardSet& shards, const nn::ModelConfig& config) {
  const std::string &drawn = shards.metadata().at("pose_map"), wanted = config.pose_map.Words(config.image_height_px);
  if (drawn != wanted)
    throw TensorError("the shards' pose maps were drawn with '" + drawn + "', the page's pose_map wants '" + wanted +
                      "': pack again with this page, or say on it how they were drawn (pose_map.scaled)");
}

namespace {

/// Leaves out what nothing reads: a lean checkpoint lacks it too.
class OnlyRead final : public nn::ParameterSource {
 public:
  OnlyRead(nn::ParameterSource& source, const nn::ModelConfig& config)
      : source_(source), dead_(nn::DeadKeys(nn::CheckpointKeys(config))) {}
  Tensor Take(const std::string& key, at::IntArrayRef shape) override {
    return dead_.contains(key) || nn::IsClipLeftover(key) ? Tensor() : source_.Take(key, shape);
  }

 private:
  nn::ParameterSource& source_;
  std::set<std::string> dead_;
};

/// One copy of the model that is trained, and its loss.
struct WorldWorker {
  WorldWorker(nn::ParameterSource& source, const ShardSet& shards, const nn::ModelConfig& config,
              const WorldOptions& options, at::Device device)
      : weights(source, options.job.bf16 ? at::kBFloat16 : at::kFloat, device),
        model(weights, config),
        training(model, shards, options.world, device) {}

  TrainableWeights weights;
  nn::EvacModel model;
  WorldTraining training;
};

void Save(const std::filesystem::path& path, const TrainableWeights& weights, const nn::ModelConfig& config,
          const TensorMetadata& metadata) {
  GivenWeights given(weights.all());
  nn::SaveOptions options;
  options.metadata.insert(metadata.begin(), metadata.end());
  const std::vector<nn::ParameterShape> keys = nn::CheckpointKeys(config);
  const std::set<std::string> dead = nn::DeadKeys(keys);
  options.without.assign(dead.begin(), dead.end());
  for (const auto& [key, shape] : keys) {
    if (nn::IsClipLeftover(key)) options.without.push_back(key);
  }
  nn::SaveWeights(path, given, config, options);
}

void CheckShards(const ShardSet& shards, const nn::ModelConfig& config, const WorldStart& start) {
  CheckPictures(shards, config);
  CheckPoseMaps(shards, config);
  if (!start.codec_sha256.empty() && shards.codec() != start.codec_sha256)
    throw TensorError(start.codec.string() + " did not make the shards' latents (they are of codec " + shards.codec() +
                      "): wanted `evac encode` with this codec");
  for (const std::string& products : shards.products()) {
    if (products.find("imagined by") != std::string::npos)
      throw TensorError("the shards' latents are '" + products +
                        "': a world model learns from what was seen, wanted a folder of `evac encode` without --imagined");
  }
}

void CheckHoldout(const ShardSet& holdout, const ShardSet& shards) {
  if (holdout.codec() != shards.codec())
    throw TensorError("the hold-out's latents are of codec " + holdout.codec() + ", those to learn from of codec " +
                      shards.codec() + ": wanted `evac encode` of all with one codec");
}

void CheckViewWeights(const WorldTrainingOptions& options, const nn::ModelConfig& config) {
  const std::vector<double>& weights = options.view_weights;
  if (!weights.empty() && weights.size() != static_cast<std::size_t>(config.views))
    throw OptionError("world training", "view_weights",
                      "has " + std::to_string(weights.size()) + " numbers, wanted " + std::to_string(config.views) +
                          ": one per view, as `views` of the page of sizes says");
}

/// Strips are drawn at the first hold-out, hours after a number that no sampler takes was given.
void CheckStripSteps(const WorldOptions& options, const nn::ModelConfig& config) {
  if (options.strip_steps < 2 || options.strip_steps > config.schedule.steps)
    throw OptionError("training", "strip_steps",
                      "is " + std::to_string(options.strip_steps) + ", wanted 2 to " +
                          std::to_string(config.schedule.steps) + ", the steps of the page's schedule");
}

/// @returns the options as they are meant
WorldOptions Checked(const JobPlace& place, WorldOptions options, const WorldStart& start) {
  options.Resolve();
  options.world.windows.chunk = place.config.chunk;
  options.world.windows.memory = place.config.memory;
  CheckHoldoutSize(options.job);
  CheckViewWeights(options.world, place.config);
  CheckStripSteps(options, place.config);
  CheckStart(place.config, start);
  CheckOptions(options.job.trainer);
  CheckOptions(options.world, place.config);
  return options;
}

/// Those to learn from and the hold-out, with their latents: they fit one another, the page and the start.
std::pair<ShardSet, ShardSet> OpenChecked(const JobPlace& place, const WorldStart& start) {
  std::pair both(ShardSet(place.shards, Split::kTrain), ShardSet(EachOnce(place.shards), Split::kHoldout));
  auto& [shards, holdout] = both;
  for (ShardSet* set : {&shards, &holdout}) {
    set->OpenLatents(place.config.vae.z_channels, place.config.vae.Stride(), place.config.vae.scale_factor);
    CheckShards(*set, place.config, start);
  }
  CheckHoldout(holdout, shards);
  shards.CheckLike(holdout);
  if (place.config.object_forecast)
    CheckForecastFor(start.forecast.empty() ? start.init : start.forecast,
                     WhatForecastIsFor(shards.metadata(), place.config));
  return both;
}

/// What is measured is the same, whatever was learned from.
WorldTrainingOptions OfMeasuring(WorldTrainingOptions options) {
  options.windows.successes_only = false;
  return options;
}

std::string Number(double value) {
  char text[32];
  std::snprintf(text, sizeof text, "%.6g", value);
  return text;
}

std::string Numbers(const std::vector<double>& values) {
  std::string text;
  for (const double value : values) text += (text.empty() ? "" : ", ") + Number(value);
  return text;
}

/// What is written beside the weights.
TensorMetadata CardOf(const TrainerSummary& summary, const ShardSet& shards, const nn::ModelConfig& config,
                      std::uint64_t seed) {
  TensorMetadata card = WhatFor(shards.metadata());
  card.merge(summary.CardOfSteps());
  card.insert({{"seed", std::to_string(seed)},
               {"holdout", summary.best ? Number(*summary.best) : ""},
               {"recipe", shards.metadata().at("recipe")},
               {"codec", shards.codec()},
               {"sizes", nn::SizesNobodySees(config)}});
  return card;
}

}  // namespace

TensorMetadata WhatFor(const TensorMetadata& shards) {
  TensorMetadata card;
  for (const char* key : {"period_s", "cameras", "arms", "arms_read", "pose_map", "statistics", "tasks"}) {
    const auto found = shards.find(key);
    if (found != shards.end() && !found->second.empty()) card.insert(*found);
  }
  return card;
}

void CheckWorldTraining(const JobPlace& place, const WorldOptions& given, const WorldStart& start) {
  const WorldOptions options = Checked(place, given, start);
  const auto both = OpenChecked(place, start);
  WindowSampler(both.first, options.world.windows);  // there are some
  WindowSampler(both.second, OfMeasuring(options.world).windows);
}

TrainerSummary TrainWorld(const JobPlace& place, const WorldOptions& given, const WorldStart& start,
                          const std::function<void(std::int64_t step, const Strips&)>& look) {
  WorldOptions options = Checked(place, given, start);
  const auto both = OpenChecked(place, start);
  const ShardSet &shards = both.first, &holdout = both.second;
  Sources sources(start, place.config, options.job.trainer.seed);
  OnlyRead read(sources.routed, place.config);
  std::deque<WorldWorker> workers;
  for (std::int64_t i = 0; i < Workers(place, options.job); ++i)
    workers.emplace_back(read, shards, place.config, options, place.device);
  const TrainableWeights& weights = workers.front().weights;
  const nn::EvacModel& model = workers.front().model;
  const WorldTraining measuring(model, holdout, OfMeasuring(options.world), place.device);
  const std::vector<Window> windows = measuring.sampler().Spread(options.job.holdout_size),
                            drawn = measuring.sampler().Spread(kStripWindows);
  options.job.trainer.identity = IdentityOf(SettingsOf(options)) + shards.metadata().at("recipe") + " " +
                                 shards.LatentsIdentity() + IdentityOf(place, options.job);
  Trainer trainer(TrainedParameters(weights, place.config, options.world), options.job.trainer, place.out);
  for (std::size_t i = 1; i < workers.size(); ++i)
    trainer.AddReplica({TrainedParameters(workers[i].weights, place.config, options.world),
                        [&worker = workers[i]](const StepPlace& at) { return worker.training.Loss(at); }});
  const auto draw = [&](std::int64_t step) {
    const Strips strips = DrawStrips(model, holdout, drawn, {.steps = options.strip_steps, .device = place.device});
    if (place.say)
      place.say("step " + std::to_string(step) + ": by view, imagined " + Numbers(strips.psnr) + " dB, a frozen copy " +
                Numbers(strips.psnr_copy) + " dB" +
                (strips.psnr_carried.empty() ? "" : ", carried " + Numbers(strips.psnr_carried) + " dB"));
    if (look) look(step, strips);
  };
  const TrainerSummary summary =
      trainer.Run({.loss = [&](const StepPlace& at) { return workers.front().training.Loss(at); },
                   .holdout = [&] { return measuring.Measure(windows); },
                   .look = draw,
                   .interrupted = place.interrupted,
                   .on_progress = place.on_progress});
  if (!summary.IsDone()) return summary;
  trainer.WithBest([&] {
    Save(place.out / "weights.safetensors", weights, place.config,
         CardOf(summary, shards, place.config, options.job.trainer.seed));
  });
  return summary;
}

}  // namespace evac::train
