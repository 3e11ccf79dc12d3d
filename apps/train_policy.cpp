#include "apps/train_policy.h"

#include <fmt/format.h>

#include <deque>

#include "apps/relu_weights.h"
#include "core/error.h"
#include "policies/learned_input.h"

namespace evac {
namespace {

constexpr std::int64_t kMeasuredMoments = 1024;

/// One copy of the network that is trained.
struct PolicyWorker {
  PolicyWorker(const LearnedShape& shape, const PolicyOptions& options)
      : random(options.job.trainer.seed),
        weights(random),
        net(shape, [this](const std::string& key, const std::vector<std::int64_t>& sizes) {
          return weights.Take(key, sizes);
        }) {}
  PolicyWorker(const PolicyWorker&) = delete;
  PolicyWorker& operator=(const PolicyWorker&) = delete;

  ReluWeights random;
  train::TrainableWeights weights;
  LearnedNet net;
};

TensorMetadata CardText(const PackedSet& set, const PolicyOptions& options, std::size_t imitated) {
  TensorMetadata card = {{"format", kLearnedFormat},
                         {"tasks", Joined(set.tasks)},
                         {"cameras", Joined(set.cameras)},
                         {"arms", Joined(ArmsOf(set))},
                         {"chunk", std::to_string(kLearnedChunk)},
                         {"period_s", set.shards.metadata().at("period_s")},
                         {"height_px", std::to_string(set.shards.height_px())},
                         {"width_px", std::to_string(set.shards.width_px())},
                         {"recipe", set.shards.metadata().at("recipe")},
                         {"behaviours", options.behaviours},
                         {"imitated_clips", std::to_string(imitated)},
                         {"seed", std::to_string(options.job.trainer.seed)},
                         {"licence", "as the project"}};
  for (const Camera& camera : CamerasOf(set)) card["camera." + camera.name] = CardLine(camera);
  return card;
}

void Write(const std::filesystem::path& path, const train::TrainableWeights& weights, const TensorMetadata& card) {
  std::vector<TensorView> views;
  for (const train::NamedTensor& weight : weights.all())
    views.push_back(nn::ViewOf(weight.name, weight.tensor.detach()));
  WriteTensorFile(path, views, card);
}

}  // namespace

train::TrainerSummary TrainPolicy(const train::JobPlace& place, const PolicyOptions& given,
                                  const std::vector<std::int64_t>& keep_steps) {
  PolicyOptions options = given;
  const PackedSet set(place.shards, train::Split::kTrain), holdout(place.shards, train::Split::kHoldout);
  const LearnedShape shape{set.tasks, set.cameras, ArmsOf(set), static_cast<int>(set.shards.height_px()),
                           static_cast<int>(set.shards.width_px())};
  std::deque<PolicyWorker> workers;
  for (std::int64_t i = 0; i < Workers(place, options.job); ++i) workers.emplace_back(shape, options);
  const train::TrainableWeights& weights = workers.front().weights;
  const LearnedNet& net = workers.front().net;
  const PolicyTraining training(set, options), measuring(holdout, options);
  TensorMetadata card = CardText(set, options, training.clips());
  if (place.say) place.say(fmt::format("{} clips to imitate, {} to measure with", training.clips(), measuring.clips()));
  options.job.trainer.identity = IdentityOf(SettingsOf(options)) + set.shards.metadata().at("recipe") + " workers " +
                                 std::to_string(workers.size());
  train::Trainer trainer(weights.all(), options.job.trainer, place.out);
  for (std::size_t i = 1; i < workers.size(); ++i)
    trainer.AddReplica(
        {workers[i].weights.all(), [&, i](const train::StepPlace& at) { return training.Loss(workers[i].net, at); }});
  const auto measure = [&] { return measuring.Measure(net, kMeasuredMoments); };
  const auto write = [&](const std::string& file, std::int64_t step) {
    card["steps"] = std::to_string(step);
    card["holdout"] = fmt::format("{:.6g}", measure());
    Write(place.out / file, weights, card);
  };
  const auto keep = [&](std::int64_t step) { write(fmt::format("policy_{:06}.safetensors", step), step); };
  const train::TrainerSummary summary =
      trainer.Run({.loss = [&](const train::StepPlace& at) { return training.Loss(net, at); },
                   .holdout = measure,
                   .keep_steps = keep_steps,
                   .keep = keep,
                   .interrupted = place.interrupted,
                   .on_progress = place.on_progress});
  if (!summary.IsDone()) return summary;
  trainer.WithBest([&] { write("policy.safetensors", summary.step); });
  return summary;
}

}  // namespace evac
