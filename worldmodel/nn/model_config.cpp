#include "worldmodel/nn/model_config.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <utility>

#include "core/tensor_file.h"
#include "worldmodel/nn/object_forecast.h"

namespace evac::nn {
namespace {

constexpr std::int64_t kGroups = 32;

void Require(bool holds, const std::string& name, std::int64_t found, const std::string& wanted) {
  if (!holds) throw TensorError(name + " is " + std::to_string(found) + ", wanted " + wanted);
}

void RequireSize(const std::string& name, std::int64_t size) {
  Require(size > 0 && size < (1 << 20), name, size, "a number from 1 to 2^20");
}

void RequirePositive(std::initializer_list<std::pair<const char*, std::int64_t>> sizes) {
  for (const auto& [name, size] : sizes) RequireSize(name, size);
}

void CheckLevels(const char* name, const std::vector<std::int64_t>& multipliers) {
  Require(!multipliers.empty() && multipliers.size() <= 8, name, static_cast<std::int64_t>(multipliers.size()),
          "1 to 8 levels");
  for (const std::int64_t multiplier : multipliers)
    Require(multiplier > 0 && multiplier < 1024, name, multiplier, "positive");
}

void CheckUNet(const UNetConfig& unet) {
  RequirePositive({{"unet.in_channels", unet.in_channels},
                   {"unet.out_channels", unet.out_channels},
                   {"unet.num_res_blocks", unet.num_res_blocks},
                   {"unet.num_head_channels", unet.num_head_channels},
                   {"unet.transformer_depth", unet.transformer_depth},
                   {"unet.context_dim", unet.context_dim},
                   {"unet.init_attention_heads", unet.init_attention_heads},
                   {"unet.domains", unet.domains},
                   {"unet.model_channels", unet.model_channels}});
  CheckLevels("unet.channel_mult", unet.channel_mult);
  Require(unet.model_channels % kGroups == 0, "unet.model_channels", unet.model_channels, "a multiple of 32");
  for (const std::int64_t multiplier : unet.channel_mult)
    Require(unet.model_channels * multiplier % unet.num_head_channels == 0, "unet.num_head_channels",
            unet.num_head_channels, "a divisor of every level's width");
}

/// @param name  of the page's section
void CheckResampler(const std::string& name, const ResamplerConfig& resampler, std::int64_t context_dim) {
  const std::pair<const char*, std::int64_t> sizes[] = {
      {"embedding_dim", resampler.embedding_dim}, {"queries", resampler.queries},   {"dim", resampler.dim},
      {"depth", resampler.depth},                 {"dim_head", resampler.dim_head}, {"heads", resampler.heads},
      {"ff_mult", resampler.ff_mult}};
  for (const auto& [field, size] : sizes) RequireSize(name + "." + field, size);
  Require(resampler.output_dim == context_dim, name + ".output_dim", resampler.output_dim,
          "unet.context_dim = " + std::to_string(context_dim));
}

void CheckEncoder(const ImageEncoderConfig& clip) {
  RequirePositive({{"image_encoder.width", clip.width},
                   {"image_encoder.layers", clip.layers},
                   {"image_encoder.head_width", clip.head_width},
                   {"image_encoder.patch_px", clip.patch_px},
                   {"image_encoder.image_px", clip.image_px}});
  Require(clip.width % clip.head_width == 0, "image_encoder.head_width", clip.head_width,
          "a divisor of image_encoder.width = " + std::to_string(clip.width));
  Require(clip.image_px % clip.patch_px == 0, "image_encoder.image_px", clip.image_px,
          "a multiple of image_encoder.patch_px = " + std::to_string(clip.patch_px));
}

std::string Number(double value) {
  char text[32];
  std::snprintf(text, sizeof text, "%.6g", value);
  return text;
}

std::string Field(const char* name, double value) { return std::string(" ") + name + "=" + Number(value); }

void RequireBetween(const char* name, double found, double from, double to, const char* wanted) {
  if (!(found > from && found < to))
    throw TensorError(std::string(name) + ": found " + Number(found) + ", wanted " + wanted);
}

/// Numbers by which others are multiplied and divided.
void CheckFactors(const ModelConfig& config) {
  RequireBetween("vae.scale_factor", config.vae.scale_factor, 0, 1e6, "above 0");
  RequireBetween("schedule.linear_start", config.schedule.linear_start, 0, 1, "between 0 and 1");
  RequireBetween("schedule.linear_end", config.schedule.linear_end, 0, 1, "between 0 and 1");
  RequireBetween("schedule.base_scale", config.schedule.base_scale, 0, 1e6, "above 0");
  constexpr std::int64_t kMostSteps = 1'000'000;
  Require(config.schedule.steps <= kMostSteps, "schedule.steps", config.schedule.steps, "at most a million");
  Require(config.schedule.turning_step >= 1 && config.schedule.turning_step <= kMostSteps, "schedule.turning_step",
          config.schedule.turning_step, "1 … a million");
}

/// A page in millimetres would draw its marks beside every picture. Arms are never 5 m from their base (ReadRecording).
void CheckMetres(const ModelConfig& config) {
  const auto check = [](const char* name, double found, double most) {
    if (!(std::fabs(found) <= most))
      throw TensorError(std::string(name) + ": found " + Number(found) + ", wanted metres, -" + Number(most) + " … " +
                        Number(most));
  };
  check("pose_map.tool_length_m", config.pose_map.tool_length_m, 5);
  check("pose_map.drop_line_m", config.pose_map.drop_line_m.value_or(0), 10);
  check("schedule.carry_plane_m", config.schedule.carry_plane_m.value_or(0), 10);
}

/// Rays are told from the corners of the latent: one place high or wide, it has none.
void CheckCorners(const ModelConfig& config) {
  const bool reads_rays = config.schedule.carry_plane_m || config.unet.hand_views > 0 || config.object_forecast;
  if (!reads_rays || (config.LatentHeight() >= 2 && config.LatentWidth() >= 2)) return;
  throw TensorError("image_height_px and image_width_px: found " + std::to_string(config.image_height_px) + " and " +
                    std::to_string(config.image_width_px) + ", wanted twice the codec's stride of " +
                    std::to_string(config.vae.Stride()) +
                    " or more with schedule.carry_plane_m, unet.hand_views or object_forecast");
}

/// @param memory, views  the model's
void CheckSchedule(const ScheduleConfig& schedule, std::int64_t memory, std::int64_t views) {
  if (schedule.zero_terminal_snr)  // the one step would be all noise and none
    Require(schedule.steps >= 2, "schedule.steps", schedule.steps, "2 or more with schedule.zero_terminal_snr");
  if (schedule.carry_plane_m && !schedule.from_last_frame)
    throw TensorError("schedule.carry_plane_m: wanted schedule.from_last_frame: true as well");
  if ((schedule.carry_frames != 1 || schedule.carry_first) && !schedule.carry_plane_m)
    throw TensorError(std::string(schedule.carry_first ? "schedule.carry_first" : "schedule.carry_frames") +
                      ": wanted schedule.carry_plane_m as well");
  Require(schedule.carry_frames >= 1 && schedule.carry_frames <= memory, "schedule.carry_frames", schedule.carry_frames,
          "1 … memory = " + std::to_string(memory));
  if (!(schedule.carry_unless_changed >= 0 && schedule.carry_unless_changed <= 10))
    throw TensorError("schedule.carry_unless_changed: found " + Number(schedule.carry_unless_changed) +
                      ", wanted 0 … 10");
  if (schedule.carry_unless_changed > 0 && (schedule.carry_frames < 2 || views < 2))
    throw TensorError("schedule.carry_unless_changed: wanted schedule.carry_frames and views of 2 or more as well");
  if (!(schedule.unchanged_below >= 0 && schedule.unchanged_below <= 10))
    throw TensorError("schedule.unchanged_below: found " + Number(schedule.unchanged_below) + ", wanted 0 … 10");
  if (schedule.unchanged_below > 0 && !schedule.from_last_frame)
    throw TensorError("schedule.unchanged_below: wanted schedule.from_last_frame: true as well");
}

}  // namespace

std::string PoseMapConfig::Differences() const {
  const PoseMapConfig published;
  return (drop_line_m ? Field("drop_line_m", *drop_line_m) : "") +
         (std::fabs(tool_length_m - published.tool_length_m) > 1e-6 ? Field("tool_length_m", tool_length_m) : "") +
         (lag_frames > 0 ? Field("lag_frames", lag_frames) : "");
}

PoseMapSizes PoseMapConfig::Sizes(std::int64_t height_px) const {
  const PoseMapSizes published;
  if (!scaled) return published;
  const auto in_parts = [&](int size_px) {
    return std::max(1, static_cast<int>(std::lround(size_px * static_cast<double>(height_px) / 320)));
  };
  return {in_parts(published.radius_px), in_parts(published.thickness_px)};
}

std::string PoseMapConfig::Words(std::int64_t height_px) const {
  const PoseMapSizes sizes = Sizes(height_px);
  return "radius_px=" + std::to_string(sizes.radius_px) + " thickness_px=" + std::to_string(sizes.thickness_px) +
         Differences();
}

void ModelConfig::Check() const {
  CheckUNet(unet);
  CheckLevels("vae.channel_mult", vae.channel_mult);
  RequirePositive({{"vae.channels", vae.channels},
                   {"vae.z_channels", vae.z_channels},
                   {"vae.num_res_blocks", vae.num_res_blocks},
                   {"vae.patch_px", vae.patch_px},
                   {"chunk", chunk},
                   {"memory", memory},
                   {"views", views},
                   {"schedule.steps", schedule.steps}});
  Require(vae.channels % kGroups == 0, "vae.channels", vae.channels, "a multiple of 32");
  CheckEncoder(image_encoder);
  CheckResampler("action_resampler", action_resampler, unet.context_dim);
  CheckResampler("image_resampler", image_resampler, unet.context_dim);
  Require(image_resampler.embedding_dim == image_encoder.width, "image_resampler.embedding_dim",
          image_resampler.embedding_dim, "image_encoder.width = " + std::to_string(image_encoder.width));
  Require(action_resampler.embedding_dim >= 14 && action_resampler.embedding_dim % 2 == 0,
          "action_resampler.embedding_dim", action_resampler.embedding_dim, "14, or more by an even number");
  const std::int64_t carried = (schedule.carry_plane_m ? 1 : 0) + (schedule.carry_first ? 1 : 0),
                     inputs = 3 * vae.z_channels + 7 + carried * (vae.z_channels + 1) + (object_forecast ? 1 : 0);
  Require(unet.in_channels == inputs, "unet.in_channels", unet.in_channels,
          "3 latents, a mask and 6 of the rays" +
              std::string(carried > 0 ? ", of each carried frame a latent and a mask more" : "") +
              (object_forecast ? ", one of the object's forecast" : "") + ": " +
              std::to_string(inputs));
  if (object_forecast)
    Require(vae.Stride() % ObjectForecast::kCell_px == 0, "the codec's stride", vae.Stride(),
            "a multiple of " + std::to_string(ObjectForecast::kCell_px) + " with object_forecast");
  CheckFactors(*this);
  CheckSchedule(schedule, memory, views);
  CheckMetres(*this);
  if (!(pose_map.lag_frames >= 0 && pose_map.lag_frames <= 1))
    throw TensorError("pose_map.lag_frames: found " + Number(pose_map.lag_frames) + ", wanted 0 … 1");
  Require(unet.hand_views == 0 || unet.hand_views == views, "unet.hand_views", unet.hand_views,
          "0, or views = " + std::to_string(views));
  Require(unet.out_channels == vae.z_channels, "unet.out_channels", unet.out_channels, "vae.z_channels");
  Require(domain >= 0 && domain < unet.domains, "domain", domain, "a row of unet.domains");
  const std::int64_t multiple = vae.Stride() << (unet.channel_mult.size() - 1);
  const std::string wanted = "a multiple of " + std::to_string(multiple) + ", codec stride x 2^(levels - 1)";
  Require(image_height_px > 0 && image_height_px % multiple == 0, "image height", image_height_px, wanted);
  Require(image_width_px > 0 && image_width_px % multiple == 0, "image width", image_width_px, wanted);
  CheckCorners(*this);
}

}  // namespace evac::nn
