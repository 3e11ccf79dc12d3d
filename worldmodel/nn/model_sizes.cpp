#include "worldmodel/nn/model_sizes.h"

#include <algorithm>
#include <utility>

#include "worldmodel/nn/number_text.h"

namespace evac::nn {
namespace {

using Sizes = std::vector<Size>;

void AddSchedule(Sizes& sizes, ScheduleConfig& s) {
  const Sizes all = {{"schedule", "steps", &s.steps},
                     {"schedule", "linear_start", &s.linear_start},
                     {"schedule", "linear_end", &s.linear_end},
                     {"schedule", "zero_terminal_snr", &s.zero_terminal_snr},
                     {"schedule", "dynamic_rescale", &s.dynamic_rescale},
                     {"schedule", "base_scale", &s.base_scale},
                     {"schedule", "turning_step", &s.turning_step},
                     {"schedule", "from_last_frame", &s.from_last_frame},
                     {"schedule", "carry_plane_m", &s.carry_plane_m},
                     {"schedule", "carry_frames", &s.carry_frames},
                     {"schedule", "carry_unless_changed", &s.carry_unless_changed},
                     {"schedule", "carry_first", &s.carry_first},
                     {"schedule", "unchanged_below", &s.unchanged_below}};
  sizes.insert(sizes.end(), all.begin(), all.end());
}

void AddUNet(Sizes& sizes, UNetConfig& u) {
  const Sizes all = {{"unet", "in_channels", &u.in_channels},
                     {"unet", "out_channels", &u.out_channels},
                     {"unet", "model_channels", &u.model_channels},
                     {"unet", "channel_mult", &u.channel_mult},
                     {"unet", "num_res_blocks", &u.num_res_blocks},
                     {"unet", "attention_resolutions", &u.attention_resolutions},
                     {"unet", "num_head_channels", &u.num_head_channels},
                     {"unet", "transformer_depth", &u.transformer_depth},
                     {"unet", "context_dim", &u.context_dim},
                     {"unet", "init_attention_heads", &u.init_attention_heads},
                     {"unet", "domains", &u.domains},
                     {"unet", "frame_actions", &u.frame_actions},
                     {"unet", "hand_views", &u.hand_views}};
  sizes.insert(sizes.end(), all.begin(), all.end());
}

void AddMapsAndCodec(Sizes& sizes, PoseMapConfig& p, VaeConfig& v) {
  const Sizes all = {{"pose_map", "scaled", &p.scaled},
                     {"pose_map", "tool_length_m", &p.tool_length_m},
                     {"pose_map", "drop_line_m", &p.drop_line_m},
                     {"pose_map", "lag_frames", &p.lag_frames},
                     {"vae", "channels", &v.channels},
                     {"vae", "channel_mult", &v.channel_mult},
                     {"vae", "num_res_blocks", &v.num_res_blocks},
                     {"vae", "z_channels", &v.z_channels},
                     {"vae", "scale_factor", &v.scale_factor},
                     {"vae", "patch_px", &v.patch_px}};
  sizes.insert(sizes.end(), all.begin(), all.end());
}

void AddResampler(Sizes& sizes, const char* section, ResamplerConfig& r) {
  const Sizes all = {{section, "embedding_dim", &r.embedding_dim},
                     {section, "queries", &r.queries},
                     {section, "dim", &r.dim},
                     {section, "depth", &r.depth},
                     {section, "dim_head", &r.dim_head},
                     {section, "heads", &r.heads},
                     {section, "output_dim", &r.output_dim},
                     {section, "ff_mult", &r.ff_mult}};
  sizes.insert(sizes.end(), all.begin(), all.end());
}

void AddEncoder(Sizes& sizes, ImageEncoderConfig& e) {
  const Sizes all = {{"image_encoder", "width", &e.width},
                     {"image_encoder", "layers", &e.layers},
                     {"image_encoder", "head_width", &e.head_width},
                     {"image_encoder", "patch_px", &e.patch_px},
                     {"image_encoder", "image_px", &e.image_px},
                     {"image_encoder", "embed_dim", &e.embed_dim},
                     {"image_encoder", "vocabulary", &e.vocabulary},
                     {"image_encoder", "text_length", &e.text_length}};
  sizes.insert(sizes.end(), all.begin(), all.end());
}

std::string Text(std::int64_t value) { return std::to_string(value); }
std::string Text(bool value) { return value ? "true" : "false"; }
std::string Text(double value) { return TextOfNumber(value); }
std::string Text(const std::optional<double>& value) { return value ? Text(*value) : ""; }
std::string Text(const std::vector<std::int64_t>& values) {
  std::string text;
  for (const std::int64_t value : values) {
    if (!text.empty()) text += ',';
    text += Text(value);
  }
  return text;
}

bool Parse(const std::string& text, std::int64_t& value) { return ParseNumber(text, value); }
bool Parse(const std::string& text, double& value) { return ParseNumber(text, value); }
bool Parse(const std::string& text, bool& value) { return ParseFlag(text, value); }
bool Parse(const std::string& text, std::optional<double>& value) {
  double found = 0;
  if (!text.empty() && !Parse(text, found)) return false;
  value = text.empty() ? std::nullopt : std::optional(found);
  return true;
}
bool Parse(const std::string& text, std::vector<std::int64_t>& values) {
  std::vector<std::int64_t> found;
  for (std::size_t from = 0; !text.empty() && from <= text.size();) {
    const std::size_t comma = std::min(text.find(',', from), text.size());
    if (!Parse(text.substr(from, comma - from), found.emplace_back())) return false;
    from = comma + 1;
  }
  values = std::move(found);
  return true;
}

}  // namespace

std::vector<Size> SizesOf(ModelConfig& config) {
  Sizes sizes = {{"", "chunk", &config.chunk},
                 {"", "memory", &config.memory},
                 {"", "views", &config.views},
                 {"", "image_height_px", &config.image_height_px},
                 {"", "image_width_px", &config.image_width_px},
                 {"", "fps", &config.fps},
                 {"", "domain", &config.domain},
                 {"", "object_forecast", &config.object_forecast}};
  AddSchedule(sizes, config.schedule);
  AddUNet(sizes, config.unet);
  AddMapsAndCodec(sizes, config.pose_map, config.vae);
  AddResampler(sizes, "action_resampler", config.action_resampler);
  AddResampler(sizes, "image_resampler", config.image_resampler);
  AddEncoder(sizes, config.image_encoder);
  return sizes;
}

std::string TextOf(const Size& size) {
  return std::visit([](const auto* field) { return Text(*field); }, size.field);
}

bool SetFromText(const Size& size, const std::string& text) {
  return std::visit([&](auto* field) { return Parse(text, *field); }, size.field);
}

}  // namespace evac::nn
