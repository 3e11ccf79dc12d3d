#include "worldmodel/evac_config.h"

#include <utility>
#include <vector>

#include "core/config.h"
#include "core/tensor_file.h"

namespace evac {
namespace {

using Sides = std::vector<std::int64_t>;

/// Reads those fields that are there; the others keep the published value.
template <typename T>
void Read(const Config& page, const char* key, T& value) {
  if (page.Has(key)) value = page.Get<T>(key);
}

std::int64_t Whole(const Config& page, const char* key, std::uint64_t found) {
  page.Require(found < (1U << 30), key, "a whole number below 2^30");
  return static_cast<std::int64_t>(found);
}

void Read(const Config& page, const char* key, std::int64_t& value) {
  if (page.Has(key)) value = Whole(page, key, page.Get<std::uint64_t>(key));
}

void Read(const Config& page, const char* key, Sides& values) {
  if (!page.Has(key)) return;
  values.clear();
  for (const std::uint64_t value : page.Get<std::vector<std::uint64_t>>(key)) values.push_back(Whole(page, key, value));
}

void ReadUNet(const Config& page, nn::UNetConfig& unet) {
  Read(page, "in_channels", unet.in_channels);
  Read(page, "out_channels", unet.out_channels);
  Read(page, "model_channels", unet.model_channels);
  Read(page, "channel_mult", unet.channel_mult);
  Read(page, "num_res_blocks", unet.num_res_blocks);
  Read(page, "attention_resolutions", unet.attention_resolutions);
  Read(page, "num_head_channels", unet.num_head_channels);
  Read(page, "transformer_depth", unet.transformer_depth);
  Read(page, "context_dim", unet.context_dim);
}

void ReadResampler(const Config& page, nn::ResamplerConfig& resampler) {
  Read(page, "embedding_dim", resampler.embedding_dim);
  Read(page, "dim", resampler.dim);
  Read(page, "depth", resampler.depth);
  Read(page, "dim_head", resampler.dim_head);
  Read(page, "heads", resampler.heads);
  Read(page, "output_dim", resampler.output_dim);
  Read(page, "ff_mult", resampler.ff_mult);
}

void ReadOurUNet(const Config& page, nn::UNetConfig& unet) {
  page.AllowOnly({"in_channels", "out_channels", "model_channels", "channel_mult", "num_res_blocks",
                  "attention_resolutions", "num_head_channels", "transformer_depth", "context_dim",
                  "init_attention_heads", "domains", "frame_actions", "hand_views"});
  ReadUNet(page, unet);
  Read(page, "init_attention_heads", unet.init_attention_heads);
  Read(page, "domains", unet.domains);
  Read(page, "frame_actions", unet.frame_actions);
  Read(page, "hand_views", unet.hand_views);
}

void ReadOurVae(const Config& page, nn::VaeConfig& vae) {
  page.AllowOnly({"channels", "channel_mult", "num_res_blocks", "z_channels", "scale_factor", "patch_px"});
  Read(page, "channels", vae.channels);
  Read(page, "channel_mult", vae.channel_mult);
  Read(page, "num_res_blocks", vae.num_res_blocks);
  Read(page, "z_channels", vae.z_channels);
  Read(page, "scale_factor", vae.scale_factor);
  Read(page, "patch_px", vae.patch_px);
}

void ReadOurResampler(const Config& page, nn::ResamplerConfig& resampler) {
  page.AllowOnly({"embedding_dim", "queries", "dim", "depth", "dim_head", "heads", "output_dim", "ff_mult"});
  ReadResampler(page, resampler);
  Read(page, "queries", resampler.queries);
}

void ReadOurEncoder(const Config& page, nn::ImageEncoderConfig& encoder) {
  page.AllowOnly({"width", "layers", "head_width", "patch_px", "image_px", "embed_dim", "vocabulary", "text_length"});
  Read(page, "width", encoder.width);
  Read(page, "layers", encoder.layers);
  Read(page, "head_width", encoder.head_width);
  Read(page, "patch_px", encoder.patch_px);
  Read(page, "image_px", encoder.image_px);
  Read(page, "embed_dim", encoder.embed_dim);
  Read(page, "vocabulary", encoder.vocabulary);
  Read(page, "text_length", encoder.text_length);
}

void ReadOurSchedule(const Config& page, nn::ScheduleConfig& schedule) {
  page.AllowOnly(
      {"steps", "linear_start", "linear_end", "zero_terminal_snr", "dynamic_rescale", "base_scale", "turning_step",
       "from_last_frame", "carry_plane_m", "carry_frames", "carry_unless_changed", "carry_first",
       "unchanged_below"});
  Read(page, "steps", schedule.steps);
  Read(page, "linear_start", schedule.linear_start);
  Read(page, "linear_end", schedule.linear_end);
  Read(page, "zero_terminal_snr", schedule.zero_terminal_snr);
  Read(page, "dynamic_rescale", schedule.dynamic_rescale);
  Read(page, "base_scale", schedule.base_scale);
  Read(page, "turning_step", schedule.turning_step);
  Read(page, "from_last_frame", schedule.from_last_frame);
  Read(page, "carry_frames", schedule.carry_frames);
  Read(page, "carry_unless_changed", schedule.carry_unless_changed);
  Read(page, "carry_first", schedule.carry_first);
  Read(page, "unchanged_below", schedule.unchanged_below);
  if (page.Has("carry_plane_m")) schedule.carry_plane_m = page.Get<double>("carry_plane_m");
}

void ReadPoseMap(const Config& page, nn::PoseMapConfig& pose_map) {
  page.AllowOnly({"scaled", "drop_line_m", "tool_length_m", "lag_frames"});
  Read(page, "scaled", pose_map.scaled);
  Read(page, "tool_length_m", pose_map.tool_length_m);
  Read(page, "lag_frames", pose_map.lag_frames);
  if (page.Has("drop_line_m")) pose_map.drop_line_m = page.Get<double>("drop_line_m");
}

nn::ModelConfig ReadOurs(const Config& page) {
  page.AllowOnly({"chunk", "memory", "views", "image_height_px", "image_width_px", "fps", "domain", "schedule", "unet",
                  "vae", "action_resampler", "image_resampler", "image_encoder", "pose_map", "object_forecast"});
  nn::ModelConfig config;
  Read(page, "chunk", config.chunk);
  Read(page, "memory", config.memory);
  Read(page, "views", config.views);
  Read(page, "image_height_px", config.image_height_px);
  Read(page, "image_width_px", config.image_width_px);
  Read(page, "fps", config.fps);
  Read(page, "domain", config.domain);
  Read(page, "object_forecast", config.object_forecast);
  if (page.Has("pose_map")) ReadPoseMap(page.Section("pose_map"), config.pose_map);
  if (page.Has("schedule")) ReadOurSchedule(page.Section("schedule"), config.schedule);
  if (page.Has("unet")) ReadOurUNet(page.Section("unet"), config.unet);
  if (page.Has("vae")) ReadOurVae(page.Section("vae"), config.vae);
  if (page.Has("action_resampler")) ReadOurResampler(page.Section("action_resampler"), config.action_resampler);
  if (page.Has("image_resampler")) ReadOurResampler(page.Section("image_resampler"), config.image_resampler);
  if (page.Has("image_encoder")) ReadOurEncoder(page.Section("image_encoder"), config.image_encoder);
  return config;
}

/// `section.params`, if there is one.
template <typename Function>
void InParams(const Config& params, const char* section, Function read) {
  if (params.Has(section) && params.Section(section).Has("params")) read(params.Section(section).Section("params"));
}

void ReadPublishedVae(const Config& page, nn::VaeConfig& vae) {
  if (!page.Has("ddconfig")) return;
  const Config sizes = page.Section("ddconfig");
  Read(sizes, "ch", vae.channels);
  Read(sizes, "ch_mult", vae.channel_mult);
  Read(sizes, "num_res_blocks", vae.num_res_blocks);
  Read(sizes, "z_channels", vae.z_channels);
}

void ReadPublishedScalars(const Config& params, nn::ModelConfig& config) {
  Read(params, "linear_start", config.schedule.linear_start);
  Read(params, "linear_end", config.schedule.linear_end);
  Read(params, "timesteps", config.schedule.steps);
  Read(params, "rescale_betas_zero_snr", config.schedule.zero_terminal_snr);
  Read(params, "use_dynamic_rescale", config.schedule.dynamic_rescale);
  Read(params, "base_scale", config.schedule.base_scale);
  Read(params, "turning_step", config.schedule.turning_step);
  Read(params, "scale_factor", config.vae.scale_factor);
  Read(params, "chunk", config.chunk);
  Read(params, "n_previous", config.memory);
  Read(params, "n_view", config.views);
  if (!params.Has("image_size")) return;
  Sides latent;
  Read(params, "image_size", latent);
  params.Require(latent.size() == 2, "image_size", "height and width of the latent");
  config.image_height_px = latent[0] * config.vae.Stride();
  config.image_width_px = latent[1] * config.vae.Stride();
}

nn::ModelConfig ReadPublished(const Config& params) {
  nn::ModelConfig config;
  InParams(params, "unet_config", [&](const Config& page) { ReadUNet(page, config.unet); });
  InParams(params, "first_stage_config", [&](const Config& page) { ReadPublishedVae(page, config.vae); });
  for (const auto& [section, resampler] : {std::pair("cond_stage_config", &config.action_resampler),
                                           std::pair("image_proj_stage_config", &config.image_resampler)}) {
    InParams(params, section, [&, to = resampler](const Config& page) {
      ReadResampler(page, *to);
      Read(page, "num_queries", to->queries);
      const bool image = to == &config.image_resampler;
      if (image && to->queries == 16) to->queries = 256;  // the page may count a side of the 16 x 16 tokens
    });
  }
  ReadPublishedScalars(params, config);
  return config;
}

}  // namespace

nn::ModelConfig ReadEvacConfig(const std::filesystem::path& path) {
  const Config page = Config::FromFile(path);
  const bool published = page.Has("model") && page.Section("model").Has("params");
  const nn::ModelConfig config = published ? ReadPublished(page.Section("model").Section("params")) : ReadOurs(page);
  try {
    config.Check();
  } catch (const TensorError& error) {
    throw InvalidInput("{}: {}", path.string(), error.what());
  }
  return config;
}

}  // namespace evac
