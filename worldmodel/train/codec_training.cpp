#include "worldmodel/train/codec_training.h"

#include <algorithm>
#include <cmath>

#include "worldmodel/train/option_limits.h"

namespace evac::train {
namespace {

enum Stream : std::uint32_t { kPick = 1, kNoise = 2 };

constexpr std::uint8_t kMapGround = 50;  ///< the grey of a pose map where nothing is drawn

/// 1, and `inside` within `radius_px` of the middle. @returns [H, W]
Tensor DiscWeight(const Tensor& middle_px, const Tensor& like, double radius_px, double inside) {
  const auto* at_px = middle_px.data_ptr<float>();
  const std::int64_t height = like.size(0), width = like.size(1);
  if (inside == 1 || !std::isfinite(at_px[0]) || !std::isfinite(at_px[1])) return at::ones({height, width});
  const Tensor x = at::arange(width, at::kFloat) + 0.5 - at_px[0], y = at::arange(height, at::kFloat) + 0.5 - at_px[1];
  const Tensor is_inside = (x * x).unsqueeze(0) + (y * y).unsqueeze(1) < radius_px * radius_px;
  return is_inside.to(at::kFloat) * (inside - 1) + 1;
}

}  // namespace

void CheckOptions(const CodecTrainingOptions& o) {
  constexpr const char* kTraining = "codec training";
  if (o.batch < 1) RefuseOption(kTraining, {"batch", static_cast<double>(o.batch)}, "at least 1");
  RequireShares(kTraining, {{"map_share", o.map_share}, {"contact_share", o.contact_share}});
  RequireWeights(kTraining, {{"squared_weight", o.squared_weight},
                             {"kl_weight", o.kl_weight},
                             {"latent_noise", o.latent_noise},
                             {"foreground_weight", o.foreground_weight},
                             {"foreground_radius", o.foreground_radius}});
}

CodecTraining::CodecTraining(const ShardSet& shards, const nn::VaeConfig& config, const CodecTrainingOptions& options,
                             at::Device device)
    : shards_(shards), config_(config), options_(options), device_(device) {
  CheckOptions(options);
  for (std::size_t s = 0; s < shards.shards().size(); ++s) {
    const Tensor rows = shards.shards()[s].contact.nonzero().flatten();
    for (std::int64_t i = 0; i < rows.numel(); ++i) contacts_.push_back({s, rows.data_ptr<std::int64_t>()[i]});
  }
}

CodecTraining::Row CodecTraining::PickRow(Dice& dice) const {
  if (!contacts_.empty() && dice.Chance(options_.contact_share))
    return contacts_[static_cast<std::size_t>(dice.Below(static_cast<std::int64_t>(contacts_.size())))];
  const auto& clips = shards_.clips();
  const Clip& clip = clips[static_cast<std::size_t>(dice.Below(static_cast<std::int64_t>(clips.size())))];
  return {clip.shard, clip.first + dice.Below(clip.frames)};
}

CodecBatch CodecTraining::Batch(const StepPlace& place) const {
  Dice pick(place, kPick), noise(place, kNoise);
  const double radius_px = options_.foreground_radius * static_cast<double>(shards_.height_px());
  std::vector<Tensor> pictures, weights;
  for (std::int64_t i = 0; i < options_.batch; ++i) {
    const Row at = PickRow(pick);
    const Shard& shard = shards_.shards()[at.shard];
    const std::int64_t view = pick.Below(shards_.views());
    if (pick.Chance(options_.map_share)) {
      pictures.push_back(shard.maps[at.row][view]);
      const Tensor drawn = (pictures.back() != kMapGround).any(-1).to(at::kFloat);
      weights.push_back(drawn * (options_.foreground_weight - 1) + 1);
    } else {
      pictures.push_back(shard.frames[at.row][view]);
      weights.push_back(
          DiscWeight(shard.object_px[at.row][view], pictures.back(), radius_px, options_.foreground_weight));
    }
  }
  const std::int64_t stride = config_.Stride();
  const Tensor random =
      noise.Normal({options_.batch, config_.z_channels, shards_.height_px() / stride, shards_.width_px() / stride});
  return {PicturesFrom(at::stack(pictures)).to(device_), at::stack(weights).unsqueeze(1).to(device_), random.to(device_)};
}

Tensor CodecTraining::Loss(const nn::Vae& vae, const CodecBatch& batch) const {
  const nn::Posterior posterior = vae.Encode(batch.pictures);
  const Tensor mean = posterior.Sample({});
  Tensor latents, divergence;  // from a standard normal
  if (options_.latent_noise > 0) {
    latents = mean + batch.noise * options_.latent_noise;
    divergence = 0.5 * (mean * mean).mean();
  } else {
    const std::int64_t z = config_.z_channels;
    const Tensor log_variance = posterior.moments.narrow(1, z, z).clamp(-30, 20);
    latents = posterior.Sample(batch.noise);
    divergence = 0.5 * (mean * mean + log_variance.exp() - 1 - log_variance).mean();
  }
  const Tensor error = vae.Decode(latents * vae.scale_factor()) - batch.pictures;
  const Tensor errors = (error.abs() + options_.squared_weight * error * error) * batch.weight;
  return errors.mean() + options_.kl_weight * divergence;
}

}  // namespace evac::train
