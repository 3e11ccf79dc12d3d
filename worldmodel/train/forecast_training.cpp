#include "worldmodel/train/forecast_training.h"

#include <ATen/ops/binary_cross_entropy_with_logits.h>
#include <ATen/ops/erfinv.h>
#include <ATen/ops/log_sigmoid.h>
#include <ATen/ops/where.h>

#include <algorithm>
#include <cmath>
#include <numbers>

#include "worldmodel/nn/hand_turns.h"
#include "worldmodel/train/option_limits.h"
#include "worldmodel/train/world_batch.h"

namespace evac::train {
namespace {

enum Stream : std::uint32_t { kClips = 41, kPictures, kLeftOut };

/// Leaves out each number with probability p and makes the others as much larger.
Tensor LeftOut(const Tensor& x, double p, Dice& dice) {
  const double bound = std::numbers::sqrt2 * at::erfinv(at::tensor(2 * p - 1, at::kDouble)).item<double>();
  return x * (dice.Normal(x.sizes()) > bound) / (1 - p);
}

bool SaysWhereItsObjectIs(const ShardSet& shards) {
  return std::ranges::any_of(shards.shards(),
                             [](const Shard& shard) { return shard.object_px.isfinite().any().item<bool>(); });
}

/// [N] bools: the place is within a grid of w x h.
Tensor IsWithin(const Tensor& place, std::int64_t w, std::int64_t h) {
  const Tensor x = place.select(-1, 0), y = place.select(-1, 1);  // comparisons with what is no number are false
  return (x >= -0.5).logical_and(x < static_cast<double>(w) - 0.5).logical_and(y >= -0.5).logical_and(
      y < static_cast<double>(h) - 0.5);
}

/// [..., h w + 1]: a place between four, each as much as it is near; what is not within is the last.
Tensor Shares(const Tensor& place, std::int64_t w, std::int64_t h) {
  const auto near = [&](std::int64_t axis, std::int64_t side) {  // [..., side]
    const Tensor along = place.select(-1, axis).clamp(0, static_cast<double>(side - 1)).unsqueeze(-1);
    return (1 - (at::arange(side, along.options().dtype(at::kFloat)) - along).abs()).clamp_min(0);
  };
  const Tensor within = IsWithin(place, w, h).unsqueeze(-1);
  const Tensor each = (near(1, h).unsqueeze(-1) * near(0, w).unsqueeze(-2)).flatten(-2);
  return at::cat({at::where(within, each, at::zeros_like(each)), within.logical_not().to(at::kFloat)}, -1);
}

/// [B, T, ends]: logarithms of each end and of the thing's being where it was in it, in all views.
Tensor OfEnds(const nn::ObjectForecast::Answer& answer, const Tensor& place, const nn::ModelConfig& config) {
  const Tensor shares = Shares(place, config.LatentWidth(), config.LatentHeight()).unsqueeze(2);
  const Tensor of_views = (shares * answer.places.log_softmax(3)).sum(3);  // [BV, T, ends]
  return of_views.unflatten(0, {-1, config.views}).sum(1) + answer.ends.log_softmax(2);
}

void Check(const ForecastTrainingOptions& o) {
  constexpr const char* kTraining = "forecast training";
  for (const NamedNumber& count : {NamedNumber{"batch", static_cast<double>(o.batch)},
                                   NamedNumber{"frames", static_cast<double>(o.frames)},
                                   NamedNumber{"failure_weight", o.failure_weight}}) {
    if (!(count.value >= 1)) RefuseOption(kTraining, count, "at least 1");
  }
  if (!(o.drop >= 0 && o.drop < 1)) RefuseOption(kTraining, {"drop", o.drop}, "0 or more and below 1");
  RequireShares(kTraining, {{"variant_share", o.variant_share}, {"late_start", o.late_start}});
  RequireWeights(kTraining, {{"picture_gain", o.picture_gain},
                             {"picture_noise", o.picture_noise},
                             {"success_weight", o.success_weight},
                             {"finder_weight", o.finder_weight}});
}

}  // namespace

Tensor EndThatCame(const nn::ObjectForecast::Answer& answer, const Tensor& place, const nn::ModelConfig& config) {
  const Tensor known = place.isfinite().flatten(1).any(1).unflatten(0, {-1, config.views}).any(1);  // [B]
  const Tensor of_ends = OfEnds(answer, place, config);
  return at::where(known.reshape({-1, 1, 1}), of_ends, answer.ends).argmax(2);
}

ForecastTraining::ForecastTraining(const ShardSet& shards, const nn::ModelConfig& config,
                                   const ForecastTrainingOptions& options)
    : shards_(shards), config_(config), options_(options) {
  Check(options_);
  if (!SaysWhereItsObjectIs(shards))
    throw TensorError(shards.shards().front().path.parent_path().string() +
                      ": object_px of no clip is a number, wanted shards that say where their objects are");
}

ForecastTraining::Track ForecastTraining::TrackOf(const Clip& clip, std::int64_t start) const {
  const Shard& shard = shards_.shards()[clip.shard];
  const std::int64_t from = clip.first + start, count = clip.frames - start;
  return {clip.shard, from, shard.actions.narrow(0, from, count), shard.object_px.narrow(0, from, count), clip.outcome};
}

ForecastTraining::Track ForecastTraining::TrackOf(const Variant& variant) const {
  const Shard& shard = shards_.shards()[variant.shard];
  return {variant.shard, variant.picture, shard.variant_actions.narrow(0, variant.first, variant.frames),
          shard.variant_object_px.narrow(0, variant.first, variant.frames), variant.outcome};
}

ForecastTraining::View ForecastTraining::PickView(Dice& dice) const {
  const auto one_of = [&](const auto& all) -> const auto& {
    return all[static_cast<std::size_t>(dice.Below(static_cast<std::int64_t>(all.size())))];
  };
  const bool varied = !shards_.variants().empty() && dice.Chance(options_.variant_share);
  const auto any = [&] {
    if (varied) return TrackOf(one_of(shards_.variants()));
    const Clip& clip = one_of(shards_.clips());
    return TrackOf(clip, dice.Chance(options_.late_start) ? dice.Below(clip.frames) : 0);
  };
  const auto is_left_out = [&](const Track& track) {
    return options_.failure_weight > 1 && track.outcome == 1 && !dice.Chance(1 / options_.failure_weight);
  };
  constexpr int kMostDraws = 1000;  // all may have succeeded
  View view{any(), {}};
  for (int draw = 1; draw < kMostDraws && is_left_out(view.track); ++draw) view.track = any();
  view.frames = {view.track.frames() - 1};
  while (static_cast<std::int64_t>(view.frames.size()) < options_.frames)
    view.frames.push_back(dice.Below(view.track.frames()));
  return view;
}

ForecastBatch ForecastTraining::BatchOf(const std::vector<View>& views) const {
  const std::vector<std::int64_t> picture_px = {shards_.height_px(), shards_.width_px()},
                                  latent_px = {config_.LatentHeight(), config_.LatentWidth()};
  const double per_px = static_cast<double>(latent_px[1]) / static_cast<double>(picture_px[1]);
  std::vector<Tensor> images, directions, origins, arms, turns, places, firsts;
  std::vector<float> success;
  for (const View& view : views) {
    const Track& track = view.track;
    const Shard& shard = shards_.shards()[track.shard];
    const Rays rays = RaysOf(shard.c2w[track.picture], shard.k[track.picture], picture_px, latent_px);
    images.push_back(PicturesFrom(shard.frames[track.picture]));
    directions.push_back(rays.direction.unsqueeze(2));
    origins.push_back(rays.origin.unsqueeze(2));
    const Tensor rows = track.actions.to(at::kFloat).contiguous();
    const std::vector<std::size_t> asked(view.frames.begin(), view.frames.end());
    const float* numbers = rows.data_ptr<float>();
    turns.push_back(at::tensor(nn::HandTurns({numbers, numbers + rows.numel()}, asked))
                        .reshape({static_cast<std::int64_t>(asked.size()), static_cast<std::int64_t>(nn::kTurnRow)}));
    const Tensor which = at::tensor(view.frames, at::kLong);
    arms.push_back(rows.index_select(0, which));
    const Tensor object = track.object_px.to(at::kFloat) * per_px - 0.5;
    places.push_back(object.index_select(0, which).transpose(0, 1));  // [V, T, 2]
    firsts.push_back(object[0]);
    for (const std::int64_t frame : view.frames)
      success.push_back(frame + 1 == track.frames() ? static_cast<float>(track.outcome) : -1.0F);
  }
  return {{at::cat(images), at::cat(directions), at::cat(origins), at::stack(arms), at::stack(turns)},
          at::cat(places),
          at::cat(firsts),
          at::tensor(success).reshape({static_cast<std::int64_t>(views.size()), -1})};
}

Tensor ForecastTraining::LossOf(const nn::ObjectForecast::Answer& answer, const ForecastBatch& batch) const {
  const std::int64_t w = config_.LatentWidth(), h = config_.LatentHeight();
  const Tensor known = (batch.success >= 0).to(at::kFloat);
  const Tensor sign = (batch.success * 2 - 1).unsqueeze(2);
  const Tensor as_told = at::log_sigmoid(answer.success * sign);  // [B, T, ends]: what is known was said, in each end
  const Tensor of_ends = OfEnds(answer, batch.place, config_) + as_told * known.unsqueeze(2);
  const Tensor places = of_ends.logsumexp(2).mean() / -static_cast<double>(shards_.views());
  const Tensor told = (answer.ends.log_softmax(2) + as_told).logsumexp(2);
  const Tensor success = -(told * known).sum() / known.sum().clamp_min(1);
  // in the first picture: a bell over the finer cells, and where their mean lies
  const std::int64_t finer = config_.vae.Stride() / nn::ObjectForecast::kCell_px;
  const double spread_cells = 3.0 / static_cast<double>(nn::ObjectForecast::kCell_px);
  const Tensor within = IsWithin(batch.first, w, h), seen = within.to(at::kFloat);
  // anywhere will do where it is not seen, but a number: 0 times an infinite error is none
  const Tensor at_place = at::where(within.unsqueeze(1), batch.first, at::zeros_like(batch.first));
  const auto squared = [&](std::int64_t axis, std::int64_t side) {  // [BV, side finer], cells
    const Tensor cell = ((at_place.select(1, axis) + 0.5) * static_cast<double>(finer) - 0.5).unsqueeze(1);
    return (at::arange(side * finer, at::kFloat) - cell).square();
  };
  const Tensor away = squared(1, h).unsqueeze(2) + squared(0, w).unsqueeze(1);
  const Tensor bell = (away.flatten(1) * (-0.5 / (spread_cells * spread_cells))).softmax(1);
  const Tensor spread = -(bell * answer.found.scores.log_softmax(1)).sum(1);
  constexpr double kPerPixel = 0.3, kMost_px = 20, kOfSeeing = 0.3;
  const Tensor off_px = (answer.found.place - at_place).abs().sum(1) * static_cast<double>(config_.vae.Stride());
  const Tensor finding = ((spread + kPerPixel * off_px.clamp_max(kMost_px)) * seen).sum() / seen.sum().clamp_min(1) +
                         kOfSeeing * at::binary_cross_entropy_with_logits(answer.found.seen, seen);
  return places + options_.success_weight * success + options_.finder_weight * finding;
}

Tensor ForecastTraining::Loss(const nn::ObjectForecast& forecast, const StepPlace& place) const {
  Dice clips(place, kClips), pictures(place, kPictures), left_out(place, kLeftOut);
  std::vector<View> views;
  while (static_cast<std::int64_t>(views.size()) < options_.batch) views.push_back(PickView(clips));
  ForecastBatch batch = BatchOf(views);
  Tensor& image = batch.scenes.image;
  const Tensor gain = 1 + options_.picture_gain * pictures.Normal({options_.batch, 1, 1, 1});
  image = image * gain.repeat_interleave(shards_.views(), 0) + options_.picture_noise * pictures.Normal(image.sizes());
  return LossOf(forecast(batch.scenes, [&](const Tensor& x) { return LeftOut(x, options_.drop, left_out); }), batch);
}

ForecastQuality ForecastTraining::Measure(const nn::ObjectForecast& forecast) const {
  const at::NoGradGuard no_gradients;
  ForecastQuality quality;
  std::int64_t right = 0, measured = 0;
  std::vector<double> off_px;
  constexpr std::size_t kAtOnce = 32;
  const std::vector<Clip>& clips = shards_.clips();
  for (std::size_t from = 0; from < clips.size(); from += kAtOnce) {
    std::vector<View> views;
    for (std::size_t i = from; i < std::min(clips.size(), from + kAtOnce); ++i) {
      View view{TrackOf(clips[i], 0), {}};
      for (std::int64_t k = 1; k <= options_.frames; ++k)
        view.frames.push_back((clips[i].frames - 1) * k / options_.frames);
      views.push_back(std::move(view));
    }
    const ForecastBatch batch = BatchOf(views);
    const nn::ObjectForecast::Answer answer = forecast(batch.scenes);
    const auto here = static_cast<std::int64_t>(views.size());
    quality.loss += LossOf(answer, batch).item<double>() * static_cast<double>(here);
    measured += here;
    const Tensor known = batch.success >= 0, is_right = (answer.Done() > 0.5).eq(batch.success > 0.5).logical_and(known);
    quality.told += known.sum().item<std::int64_t>();
    right += is_right.sum().item<std::int64_t>();
    const Tensor off = (answer.found.place - batch.first).square().sum(1).sqrt() * static_cast<double>(config_.vae.Stride());
    for (std::int64_t row = 0; row < off.size(0); row += shards_.views()) {
      if (std::isfinite(off[row].item<double>())) off_px.push_back(off[row].item<double>());
    }
  }
  quality.loss /= static_cast<double>(std::max<std::int64_t>(1, measured));
  quality.agreement = quality.told > 0 ? static_cast<double>(right) / static_cast<double>(quality.told) : 0;
  std::ranges::sort(off_px);
  if (!off_px.empty()) quality.finder_px = off_px[off_px.size() / 2];
  return quality;
}

}  // namespace evac::train
