#include "worldmodel/train/train_codec.h"

#include <algorithm>
#include <cstdio>
#include <deque>
#include <optional>
#include <utility>

#include "worldmodel/nn/weights.h"
#include "worldmodel/train/option_limits.h"
#include "worldmodel/train/weight_files.h"

namespace evac::train {
namespace {

std::string Decibel(double value) {
  char text[24];
  std::snprintf(text, sizeof text, "%.2f", value);
  return text;
}

/// Those to learn from and the hold-out, which fit one another and the page; after the options.
std::pair<ShardSet, ShardSet> OpenChecked(const JobPlace& place, const CodecOptions& options) {
  CheckHoldoutSize(options.job);
  CheckOptions(options.job.trainer);
  CheckOptions(options.codec);
  std::pair both(ShardSet(place.shards, Split::kTrain), ShardSet(EachOnce(place.shards), Split::kHoldout));
  CheckPictures(both.first, place.config);
  both.first.CheckLike(both.second);
  return both;
}

void WriteCodec(const std::filesystem::path& path, const std::vector<NamedTensor>& weights,
                const CodecQuality& quality) {
  std::vector<NamedTensor> on_cpu;
  for (const NamedTensor& weight : weights) on_cpu.push_back({weight.name, weight.tensor.detach().cpu()});
  std::vector<TensorView> views;
  for (const NamedTensor& weight : on_cpu) views.push_back(nn::ViewOf(weight.name, weight.tensor));
  WriteTensorFile(path, views,
                  {{"format", "pt"},
                   {"psnr", Decibel(quality.psnr)},
                   {"psnr_object", quality.psnr_object == 0 ? "unknown" : Decibel(quality.psnr_object)},
                   {"psnr_maps", Decibel(quality.psnr_maps)}});
}

/// One copy of the codec that is trained, and its loss.
struct CodecWorker {
  CodecWorker(nn::ParameterSource& source, const ShardSet& shards, const nn::ModelConfig& config,
              const CodecOptions& options, at::Device device)
      : weights(source, options.job.bf16 ? at::kBFloat16 : at::kFloat, device),
        vae(nn::Scope(weights, kCodecPrefix), config.vae),
        training(shards, config.vae, options.codec, device) {}
  Tensor Loss(const StepPlace& at) const { return training.Loss(vae, training.Batch(at)); }

  TrainableWeights weights;
  nn::Vae vae;
  CodecTraining training;
};

}  // namespace

std::int64_t Workers(const JobPlace& place, const JobOptions& options) {
  if (!place.device.is_cpu()) return 1;  // each has a copy of all that is trained, and the GPU would hold them all
  return std::clamp<std::int64_t>(place.threads, 1, options.trainer.accumulate);
}

std::string IdentityOf(const JobPlace& place, const JobOptions& options) {
  const std::int64_t workers = Workers(place, options);
  std::string text = " workers " + std::to_string(workers);
  if (!place.device.is_cpu()) return text + " device " + at::Device(place.device.type()).str() + place.begun_with;
  if (workers == 1) text += " threads " + std::to_string(place.threads);
  return text + place.begun_with;
}

void CheckPictures(const ShardSet& shards, const nn::ModelConfig& config) {
  const auto sizes = [](std::int64_t views, std::int64_t height_px, std::int64_t width_px) {
    return "views: " + std::to_string(views) + ", image_height_px: " + std::to_string(height_px) +
           ", image_width_px: " + std::to_string(width_px);
  };
  const std::string found = sizes(shards.views(), shards.height_px(), shards.width_px()),
                    wanted = sizes(config.views, config.image_height_px, config.image_width_px);
  if (found != wanted)
    throw TensorError(shards.FolderNames() + ": its pictures have " + found + "; the page of sizes wants " + wanted +
                      ": another page, or pack again with this one");
}

void CheckHoldoutSize(const JobOptions& options) {
  if (options.holdout_size < 1)
    RefuseOption("training", {"holdout_size", static_cast<double>(options.holdout_size)}, "at least 1");
}

void CheckCodecTraining(const JobPlace& place, const CodecOptions& options, const std::filesystem::path& init) {
  OpenChecked(place, options);
  if (init.empty()) return;
  CheckpointWeights start(init);
  nn::Vae(nn::Scope(start, kCodecPrefix), place.config.vae);  // asks for every key and its shape
}

TrainerSummary TrainCodec(const JobPlace& place, const CodecOptions& given, const std::filesystem::path& init) {
  CodecOptions options = given;
  const auto both = OpenChecked(place, options);
  const ShardSet &shards = both.first, &holdout = both.second;
  nn::RandomWeights random(options.job.trainer.seed);
  std::optional<CheckpointWeights> start;
  if (!init.empty()) start.emplace(init);
  nn::ParameterSource& source = start ? static_cast<nn::ParameterSource&>(*start) : random;
  std::deque<CodecWorker> workers;
  for (std::int64_t i = 0; i < Workers(place, options.job); ++i)
    workers.emplace_back(source, shards, place.config, options, place.device);
  const TrainableWeights& weights = workers.front().weights;
  const nn::Vae& vae = workers.front().vae;
  options.job.trainer.identity =
      IdentityOf(SettingsOf(options)) + shards.metadata().at("recipe") + IdentityOf(place, options.job);
  Trainer trainer(weights.all(), options.job.trainer, place.out);
  for (std::size_t i = 1; i < workers.size(); ++i)
    trainer.AddReplica(
        {workers[i].weights.all(), [&worker = workers[i]](const StepPlace& at) { return worker.Loss(at); }});
  const auto say = [&](const char* when, const CodecQuality& quality) {
    if (place.say)
      place.say(std::string(when) + ": hold-out " + Decibel(quality.psnr) + " dB, around the object " +
                (quality.psnr_object == 0 ? "unknown" : Decibel(quality.psnr_object) + " dB") + ", maps " +
                Decibel(quality.psnr_maps) + " dB");
  };
  TrainerSummary summary = trainer.Run({.loss = [&](const StepPlace& at) { return workers.front().Loss(at); },
                                        .holdout =
                                            [&] {
                                              const CodecQuality quality =
                                                  MeasureCodec(vae, holdout, options.job.holdout_size, place.device);
                                              say("codec", quality);
                                              return -quality.psnr;
                                            },
                                        .interrupted = place.interrupted,
                                        .on_progress = place.on_progress});
  if (!summary.IsDone()) return summary;
  trainer.WithBest([&] {
    NormaliseLatents(vae, shards, weights.all(), options.codec.latent_noise > 0);
    const CodecQuality quality = MeasureCodec(vae, holdout, options.job.holdout_size, place.device);
    say("codec, latents normalised", quality);
    WriteCodec(place.out / "codec.safetensors", weights.all(), quality);
  });
  return summary;
}

}  // namespace evac::train
