#include "worldmodel/evac_config.h"

#include <map>
#include <optional>
#include <string>
#include <type_traits>
#include <utility>
#include <vector>

#include "core/config.h"
#include "core/tensor_file.h"
#include "worldmodel/nn/model_sizes.h"

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

void Read(const Config& page, const nn::Size& size) {
  std::visit(
      [&](auto* field) {
        if constexpr (std::is_same_v<decltype(field), std::optional<double>*>) {
          if (page.Has(size.name)) *field = page.Get<double>(size.name);
        } else {
          Read(page, size.name.c_str(), *field);
        }
      },
      size.field);
}

/// Our page: the fields of nn::SizesOf, by section.
nn::ModelConfig ReadOurs(const Config& page) {
  nn::ModelConfig config;
  const std::vector<nn::Size> sizes = nn::SizesOf(config);
  std::map<std::string, std::vector<const char*>> fields;  // by section; of the page itself: its sections too
  for (const nn::Size& size : sizes) fields[size.section].push_back(size.name.c_str());
  for (const auto& [section, names] : fields) {
    if (!section.empty()) fields[""].push_back(section.c_str());
  }
  page.AllowOnly(fields[""]);
  for (const auto& [section, names] : fields) {
    if (!section.empty() && page.Has(section)) page.Section(section).AllowOnly(names);
  }
  for (const nn::Size& size : sizes) {
    if (size.section.empty()) Read(page, size);
    else if (page.Has(size.section)) Read(page.Section(size.section), size);
  }
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
  sizes.Require(!vae.channel_mult.empty() && vae.channel_mult.size() <= 8, "ch_mult", "1 to 8 levels");
  Read(sizes, "num_res_blocks", vae.num_res_blocks);
  Read(sizes, "z_channels", vae.z_channels);
}

void ReadPublishedScalars(const Config& params, nn::ModelConfig& config) {
  if (params.Has("parameterization"))
    params.Require(params.Get<std::string>("parameterization") == "v", "parameterization",
                   "v: the network predicts velocities");
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
