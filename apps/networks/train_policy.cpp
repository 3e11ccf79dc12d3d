#include "apps/networks/train_policy.h"

#include <fmt/format.h>

#include "apps/networks/learners.h"
#include "core/error.h"
#include "core/names.h"
#include "policies/learned_input.h"

namespace evac {
namespace {

constexpr std::int64_t kMeasuredMoments = 1024;

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

std::string KeptFile(std::int64_t step) { return fmt::format("policy_{:06}.safetensors", step); }

/// A step that is done and was not kept then would never be.
void CheckKept(const std::filesystem::path& folder, const std::vector<std::int64_t>& keep_steps, std::int64_t done) {
  for (const std::int64_t step : keep_steps) {
    if (step > done || std::filesystem::exists(folder / KeptFile(step))) continue;
    throw InvalidInput(
        "{}: step {} is to be kept, but the training has done {} and did not keep it: wanted a later step, or another "
        "--out",
        folder.string(), step, done);
  }
}

}  // namespace

train::TrainerSummary TrainPolicy(const train::JobPlace& place, const PolicyOptions& given, const ShardCodec* codec,
                                  const std::vector<std::int64_t>& keep_steps) {
  train::CheckOptions(given.job.trainer);
  PolicyOptions options = given;
  PackedSet set(place.shards, train::Split::kTrain);
  CheckSides(set.shards.height_px(), set.shards.width_px());
  const PackedSet holdout(train::EachOnce(place.shards), train::Split::kHoldout);
  if (codec) codec->Open(set.shards);
  const LearnedShape shape{set.tasks, set.cameras, ArmsOf(set), static_cast<int>(set.shards.height_px()),
                           static_cast<int>(set.shards.width_px())};
  const Learners<LearnedNet> learners(shape, options.job.trainer.seed, Workers(place, options.job));
  const LearnedNet& net = learners.net();
  const PolicyTraining training(set, options, codec), measuring(holdout, options, nullptr);
  TensorMetadata card = CardText(set, options, training.clips());
  if (place.say) place.say(fmt::format("{} clips to imitate, {} to measure with", training.clips(), measuring.clips()));
  if (codec) card["codec"] = set.shards.codec();
  options.job.trainer.identity = IdentityOf(SettingsOf(options)) + set.shards.metadata().at("recipe") + " " +
                                 set.shards.LatentsIdentity() + " workers " + std::to_string(learners.count()) +
                                 place.begun_with;
  train::Trainer trainer(learners.weights().all(), options.job.trainer, place.out);
  CheckKept(place.out, keep_steps, trainer.step());
  const auto loss = [&](const LearnedNet& of, const train::StepPlace& at) { return training.Loss(of, at); };
  learners.Replicate(trainer, loss);
  const auto measure = [&] { return measuring.Measure(net, kMeasuredMoments); };
  const auto write = [&](const std::string& file, TensorMetadata steps) {
    steps.insert(card.begin(), card.end());
    steps["holdout"] = fmt::format("{:.6g}", measure());
    learners.Write(place.out / file, steps);
  };
  const auto keep = [&](std::int64_t step) { write(KeptFile(step), {{"steps", std::to_string(step)}}); };
  const train::TrainerSummary summary = trainer.Run({.loss = [&](const train::StepPlace& at) { return loss(net, at); },
                                                     .holdout = measure,
                                                     .keep_steps = keep_steps,
                                                     .keep = keep,
                                                     .interrupted = place.interrupted,
                                                     .on_progress = place.on_progress});
  if (!summary.IsDone()) return summary;
  trainer.WithBest([&] { write("policy.safetensors", summary.CardOfSteps()); });
  return summary;
}

}  // namespace evac
