#include "worldmodel/train/world_training.h"

#include <algorithm>
#include <cmath>

#include "worldmodel/nn/frame_actions.h"
#include "worldmodel/nn/hand_views.h"
#include "worldmodel/nn/latent_pictures.h"
#include "worldmodel/nn/weight_keys.h"
#include "worldmodel/train/forecast_training.h"
#include "worldmodel/train/option_limits.h"
#include "worldmodel/train/reach.h"

namespace evac::train {
namespace {

enum Stream : std::uint32_t { kWindows = 1, kSteps, kDropouts, kNoise, kSelf, kMeasure };

constexpr std::int64_t kMeasureSteps[] = {999, 700, 400, 150};  ///< of 1000: how the hold-out is noised, in turn
constexpr std::int64_t kMeasureBatch = 8;

constexpr const char* kTraining = "world training";

void CheckRanges(const WorldTrainingOptions& o) {
  RequireShares(kTraining, {{"rollout_share", o.windows.rollout_share},
                            {"contact_share", o.windows.contact_share},
                            {"closing_share", o.windows.closing_share},
                            {"opening_share", o.windows.opening_share},
                            {"drop", o.drop},
                            {"memory_noise_share", o.memory_noise_share},
                            {"terminal_share", o.terminal_share},
                            {"self_memory_share", o.self_memory_share},
                            {"self_memory_from", o.self_memory_from}});
  RequireWeights(kTraining, {{"memory_noise", o.memory_noise},
                             {"squared_below", o.squared_below},
                             {"reach_weight", o.reach_weight},
                             {"object_weight", o.object_weight},
                             {"change_weight", o.change_weight}});
  RequireAboveZero(kTraining, {{"object_radius", o.object_radius}, {"step_weight_cap", o.step_weight_cap}});
}

}  // namespace

void CheckOptions(const WorldTrainingOptions& o, const nn::ModelConfig& config) {
  if (o.batch < 1) RefuseOption(kTraining, {"batch", static_cast<double>(o.batch)}, "at least 1");
  if (o.windows.chunk != config.chunk || o.windows.memory != config.memory)
    throw TensorError("world training: windows of " + std::to_string(o.windows.memory) + " + " +
                      std::to_string(o.windows.chunk) + " frames, the model has " + std::to_string(config.memory) +
                      " + " + std::to_string(config.chunk));
  if (config.unet.hand_views > 0 && !o.windows.first_image)
    throw OptionError(kTraining, "first_image", "is false, wanted true: unet.hand_views reads the oldest memory");
  if (config.object_forecast && !o.windows.first_image)
    throw OptionError(kTraining, "first_image", "is false, wanted true: object_forecast reads the oldest memory");
  if (o.self_memory_chunks < 1)
    RefuseOption(kTraining, {"self_memory_chunks", static_cast<double>(o.self_memory_chunks)}, "at least 1");
  CheckRanges(o);
  if (o.log_uniform && !(o.ratio_from > 0 && o.ratio_to > o.ratio_from))
    throw OptionError(kTraining, "ratio_from", "is " + std::to_string(o.ratio_from) + ", ratio_to " +
                                                   std::to_string(o.ratio_to) + ", wanted 0 < ratio_from < ratio_to");
}

bool IsTrained(const std::string& key, const WorldTrainingOptions& options) {
  if (key.starts_with("model.diffusion_model.") || key.starts_with("image_proj_model.")) return true;
  if (key.starts_with("cond_stage_model.")) return options.train_action_resampler;
  return key.starts_with("embedder.") && options.train_image_encoder;
}

std::vector<NamedTensor> TrainedParameters(const TrainableWeights& weights, const nn::ModelConfig& config,
                                           const WorldTrainingOptions& options) {
  const std::set<std::string> dead = nn::DeadKeys(nn::CheckpointKeys(config));
  return weights.Trained([&](const std::string& key) {
    return IsTrained(key, options) && !dead.contains(key) && !nn::IsClipLeftover(key);
  });
}

/// What is kept (1) and dropped (0) of each scene's conditions.
struct WorldTraining::Drops {
  std::vector<float> actions, image, mask, maps;
};

WorldTraining::WorldTraining(const nn::EvacModel& model, const ShardSet& shards, const WorldTrainingOptions& options,
                             at::Device device)
    : model_(model), shards_(shards), options_(options), sampler_(shards, options.windows), device_(device) {
  CheckOptions(options_, model.config());
}

Tensor WorldTraining::PerRow(const std::vector<float>& values, std::int64_t dims) const {
  std::vector<std::int64_t> shape(static_cast<std::size_t>(dims), 1);
  shape[0] = static_cast<std::int64_t>(values.size());
  return at::tensor(values).reshape(shape).to(device_);
}

std::int64_t WorldTraining::DrawStep(Dice& dice) const {
  const std::int64_t steps = model_.schedule().steps();
  const double which = dice.Uniform(), where = dice.Uniform();
  if (which < options_.terminal_share) return steps - 1;
  if (!options_.log_uniform) return static_cast<std::int64_t>(where * static_cast<double>(steps));
  const double ratio = options_.ratio_from * std::pow(options_.ratio_to / options_.ratio_from, where);
  const double alpha_bar = 1 / (1 + ratio * ratio);  // noise² / signal² = (1 - alpha_bar) / alpha_bar
  std::int64_t low = 0, high = steps - 1;            // alpha_bar falls with the step
  while (low < high) {
    const std::int64_t middle = (low + high) / 2;
    model_.schedule().AlphaBar(middle) > alpha_bar ? low = middle + 1 : high = middle;
  }
  return low;
}

WorldTraining::Drops WorldTraining::DrawDrops(const WorldBatch& batch, Dice& dice) const {
  Drops drops;
  const double p = options_.drop;
  for (std::int64_t scene = 0; scene < batch.scenes; ++scene) {
    const double r = dice.Uniform();
    const auto kept = [](bool dropped) { return dropped ? 0.0F : 1.0F; };
    drops.actions.push_back(kept(r < 2 * p));
    const bool mask = r < 0.5 * p || (p <= r && r < 1.5 * p) || (2.5 * p <= r && r < 3.5 * p);
    for (std::int64_t view = 0; view < batch.views; ++view) {
      drops.image.push_back(kept(p <= r && r < 3 * p));
      drops.mask.push_back(kept(mask));
      drops.maps.push_back(kept(0.5 * p <= r && r < 1.5 * p));
    }
  }
  return drops;
}

nn::UNet::Context WorldTraining::ContextOf(const Tensor& tokens, const WorldBatch& batch) const {
  const auto constant = [&](std::int64_t value) { return at::full({batch.scenes}, value, at::kLong).to(device_); };
  nn::UNet::Context context{tokens, constant(model_.config().fps), constant(model_.config().domain), batch.views};
  if (model_.config().unet.frame_actions) context.frames = nn::FrameActions(batch.arms, batch.memory);
  if (model_.config().unet.hand_views > 0)
    context.hands = nn::HandViews(batch.images, batch.direction, batch.origin, batch.arms,
                                  model_.config().pose_map.tool_length_m);
  return context;
}

Tensor WorldTraining::ObjectMapsOf(const WorldBatch& batch) const {
  if (!model_.object_forecast()) return {};
  const at::NoGradGuard no_gradients;
  const nn::ObjectForecast& forecast = *model_.object_forecast();
  const nn::ObjectForecast::Scenes scenes{batch.images, batch.direction, batch.origin, batch.arms, batch.turns};
  if (!options_.show_end_that_came) return forecast.Maps(scenes);
  const nn::ObjectForecast::Answer answer = forecast(scenes);
  return forecast.MapsOf(answer, EndThatCame(answer, batch.object.transpose(1, 2) - 0.5, model_.config()));
}

Tensor WorldTraining::TokensOf(const WorldBatch& batch) const {
  return model_.ContextTokens(model_.ImageTokens(batch.images), model_.ActionTokens(batch.deltas));
}

/// [BV, 1, K, h, w], mean 1: by place, and by the step's noise.
Tensor WorldTraining::Weight(const WorldBatch& batch, const Tensor& still, const Tensor& t) const {
  const std::int64_t n = batch.memory, chunk = batch.latents.size(2) - n, h = batch.latents.size(3),
                     w = batch.latents.size(4);
  Tensor weight = at::ones({batch.latents.size(0), 1, chunk, h, w}, batch.latents.options());
  const Tensor frames = batch.latents.narrow(2, n, chunk);
  if (options_.reach_weight > 0)
    weight += options_.reach_weight * WithinReach(batch, model_.config(), options_.object_radius);
  if (options_.change_weight > 0) weight += options_.change_weight * (frames - still).abs().mean(1, true);
  if (options_.object_weight > 0) {
    const Tensor object = batch.object.narrow(2, n, chunk);                                // [BV, 2, K]
    const Tensor x = at::arange(w, batch.latents.options()) + 0.5 - object.select(1, 0).unsqueeze(-1);  // [BV, K, w]
    const Tensor y = at::arange(h, batch.latents.options()) + 0.5 - object.select(1, 1).unsqueeze(-1);
    const Tensor distance = x.square().unsqueeze(2) + y.square().unsqueeze(3);  // [BV, K, h, w]
    const Tensor bell = (distance * (-0.5 / (options_.object_radius * options_.object_radius))).exp();
    weight += options_.object_weight * bell.nan_to_num(0).unsqueeze(1);
  }
  if (!options_.view_weights.empty()) {
    std::vector<float> by_row;
    for (std::int64_t i = 0; i < weight.size(0); ++i)
      by_row.push_back(static_cast<float>(options_.view_weights.at(static_cast<std::size_t>(i % batch.views))));
    weight = weight * PerRow(by_row, 5);
  }
  weight = weight / weight.mean();
  std::vector<float> by_step;
  const Tensor on_cpu = t.cpu();
  const std::int64_t* steps = on_cpu.data_ptr<std::int64_t>();
  for (std::int64_t i = 0; i < weight.size(0); ++i) {
    const double alpha_bar = model_.schedule().AlphaBar(steps[i / batch.views]), noise = 1 - alpha_bar;
    double factor = 1;
    if (options_.step_weight == StepWeight::kMinSnr) factor = std::min(alpha_bar, options_.step_weight_cap * noise);
    if (options_.step_weight == StepWeight::kClean) factor = std::min(1.0, options_.step_weight_cap * noise);
    by_step.push_back(static_cast<float>(factor));
  }
  return weight * PerRow(by_step, 5);
}

Tensor WorldTraining::LossOf(const WorldBatch& given, const Drops& drops, const Tensor& t, Dice& dice,
                             bool noisy_memory) const {
  WorldBatch batch = given;
  const std::int64_t rows = batch.latents.size(0), n = batch.memory;
  batch.images = batch.images * PerRow(drops.image, 4);
  batch.deltas = batch.deltas * PerRow(drops.actions, 3);
  const Tensor kept =
      at::ones({rows, 1, batch.latents.size(2), batch.latents.size(3), batch.latents.size(4)}, batch.latents.options());
  kept.narrow(2, n, kept.size(2) - n).mul_(PerRow(drops.mask, 5));
  nn::DiffusionBatch step{batch.latents,
                          {{}, kept, batch.pose_maps * PerRow(drops.maps, 5), batch.direction, batch.origin},
                          ContextOf(TokensOf(batch), batch),
                          t,
                          Noise(dice, batch.latents.sizes()),
                          n,
                          std::nullopt};
  if (model_.object_forecast()) step.concat.object = ObjectMapsOf(given) * PerRow(drops.image, 5);
  if (step.context.frames.defined()) step.context.frames = step.context.frames * PerRow(drops.actions, 3);
  if (step.context.hands.defined()) step.context.hands = step.context.hands * PerRow(drops.actions, 4);
  if (noisy_memory && options_.memory_noise_kind == MemoryNoise::kPublished) {
    std::vector<float> angles;
    for (std::int64_t i = 0; i < rows * n; ++i) angles.push_back(static_cast<float>(dice.Uniform(-1.57, 1.57)));
    std::vector<std::int64_t> shape = {rows * n, batch.latents.size(1), batch.latents.size(3), batch.latents.size(4)};
    step.teacher_forcing =
        nn::TeacherForcing{at::tensor(angles).reshape({rows, n}).to(device_), 3 + dice.Below(18), Noise(dice, shape)};
  } else if (noisy_memory) {
    std::vector<float> deviations;
    for (std::int64_t i = 0; i < rows; ++i)
      deviations.push_back(
          dice.Chance(options_.memory_noise_share) ? static_cast<float>(dice.Uniform(0, options_.memory_noise)) : 0.0F);
    step.latents = batch.latents.clone();
    Tensor memory = step.latents.narrow(2, 0, n);
    memory.add_(Noise(dice, memory.sizes()) * PerRow(deviations, 5));
  }
  nn::Remember(model_, step.latents.narrow(2, 0, n), step.concat, batch.latents.narrow(2, 0, n));
  step.weight = Weight(batch, step.concat.still, t);
  step.squared_below = options_.squared_below;
  return nn::DiffusionLoss(model_, step);
}

Tensor WorldTraining::ImagineOnce(const WorldBatch& batch, Dice& dice) const {
  const at::NoGradGuard no_gradients;
  const std::int64_t n = batch.memory, chunk = batch.latents.size(2) - n, last = model_.schedule().steps() - 1;
  const Tensor memory = batch.latents.narrow(2, 0, n);
  const Tensor mask = at::ones_like(batch.latents.narrow(1, 0, 1));
  nn::Concat concat{{}, mask, batch.pose_maps, batch.direction, batch.origin};
  concat.object = ObjectMapsOf(batch);
  nn::Remember(model_, memory, concat);
  const Tensor noise = Noise(dice, batch.latents.sizes());
  const double scale = model_.schedule().Scale(last);
  const Tensor x = at::cat({memory * scale, noise.narrow(2, n, chunk)}, 2);
  const Tensor t = at::full({batch.latents.size(0)}, last, at::kLong).to(device_);
  const nn::UNet::Input input{nn::DenoiserInput(x, concat), t, batch.views, n};
  const Tensor answer = model_.unet()(input, model_.unet().Prepare(ContextOf(TokensOf(batch), batch)));
  const Tensor v = nn::FromLastFrame(model_.schedule(), answer, concat, t);
  const Tensor imagined = nn::CleanFrom(x, v, model_.schedule().AlphaBar(last)).narrow(2, n, chunk) / scale;
  return nn::LeaveUnchanged(model_.schedule(), imagined, concat.still);
}

void WorldTraining::RememberOwn(const std::vector<Window>& windows, double share, std::int64_t chunks,
                                WorldBatch& batch, Dice& dice) const {
  const at::NoGradGuard no_gradients;
  std::vector<Window> before;
  std::vector<std::int64_t> scenes;
  const std::int64_t chunk = options_.windows.chunk, views = batch.views;
  for (std::size_t i = 0; i < windows.size(); ++i) {
    const bool own = share >= 1 || dice.Chance(share);
    if (!own || windows[i].last < chunk) continue;
    Window window = windows[i];
    window.last -= chunk;
    window.memory = RolloutMemory(window.last, options_.windows.memory);
    window.image = window.memory.front();
    before.push_back(window);
    scenes.push_back(static_cast<std::int64_t>(i));
  }
  if (before.empty()) return;
  WorldBatch batch_before = BatchOf(before);
  if (chunks > 1) RememberOwn(before, 1, chunks - 1, batch_before, dice);
  const Tensor imagined = ImagineOnce(batch_before, dice);  // [B'V, z, K, h, w]
  for (std::size_t i = 0; i < before.size(); ++i) {
    const std::vector<std::int64_t>& memory = windows[static_cast<std::size_t>(scenes[i])].memory;
    for (std::size_t j = 0; j < memory.size(); ++j) {
      const std::int64_t k = memory[j] - before[i].last - 1;
      if (k < 0) continue;
      const auto from = static_cast<std::int64_t>(i) * views;
      batch.latents.narrow(0, scenes[i] * views, views)
          .select(2, static_cast<std::int64_t>(j))
          .copy_(imagined.narrow(0, from, views).select(2, k));
    }
    if (memory.size() > 1) continue;  // of one frame, it is what the image encoder sees when imagining
    const Tensor newest = imagined.narrow(0, static_cast<std::int64_t>(i) * views, views).select(2, chunk - 1);
    batch.images.narrow(0, scenes[i] * views, views).copy_(nn::PicturesShown(model_, newest));
  }
}

Tensor WorldTraining::Loss(const StepPlace& place) const {
  Dice windows_dice(place, kWindows), steps(place, kSteps), dropouts(place, kDropouts), noise(place, kNoise),
      self(place, kSelf);
  std::vector<Window> windows;
  std::vector<std::int64_t> t;
  for (std::int64_t i = 0; i < options_.batch; ++i) {
    windows.push_back(sampler_.Pick(windows_dice));
    t.push_back(DrawStep(steps));
  }
  WorldBatch batch = BatchOf(windows);
  if (options_.self_memory_share > 0 && place.done >= options_.self_memory_from)
    RememberOwn(windows, options_.self_memory_share, options_.self_memory_chunks, batch, self);
  return LossOf(batch, DrawDrops(batch, dropouts), at::tensor(t, at::kLong).to(device_), noise, true);
}

double WorldTraining::Measure(const std::vector<Window>& windows) const {
  const at::NoGradGuard no_gradients;
  double sum = 0;
  const auto count = static_cast<std::int64_t>(windows.size());
  for (std::int64_t from = 0; from < count; from += kMeasureBatch) {
    const std::int64_t here = std::min(kMeasureBatch, count - from);
    const WorldBatch batch = BatchOf({windows.begin() + from, windows.begin() + from + here});
    std::vector<std::int64_t> t;
    for (std::int64_t i = 0; i < here; ++i)
      t.push_back(kMeasureSteps[static_cast<std::size_t>((from + i) % 4)] * model_.schedule().steps() / 1000);
    const auto rows = static_cast<std::size_t>(batch.latents.size(0));
    const std::vector<float> kept(rows, 1.0F);
    const Drops all{std::vector<float>(static_cast<std::size_t>(here), 1.0F), kept, kept, kept};
    Dice dice({0, from, 0, 0}, kMeasure);
    const Tensor steps = at::tensor(t, at::kLong).to(device_);
    sum += LossOf(batch, all, steps, dice, false).item<double>() * static_cast<double>(here);
  }
  return sum / static_cast<double>(count);
}

}  // namespace evac::train
