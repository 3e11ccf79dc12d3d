#include <algorithm>
#include <regex>

#include "apps/golden/golden_checks.h"
#include "worldmodel/nn/parameters.h"

namespace evac::golden {
namespace {

bool AnyNameEndsWith(const GoldenFile& file, const std::string& suffix) { return !file.PrefixesOf(suffix).empty(); }

bool HoldsResizedPictures(const GoldenFile& file) {
  static const std::regex kPicture("r[0-9]+x[0-9]+(_noaa)?");
  const std::vector<std::string> names = file.Names();
  return std::any_of(names.begin(), names.end(),
                     [](const std::string& name) { return std::regex_match(name, kPicture); });
}

struct Kind {
  bool holds;
  void (*check)(const GoldenFile&, Workshop&, Comparison&);
};

bool SameSizes(const nn::ModelConfig& a, const nn::ModelConfig& b) {
  const auto keys = [](const nn::ModelConfig& config) {
    std::vector<std::int64_t> sizes = {config.unet.num_head_channels, config.action_resampler.heads,
                                       config.image_encoder.head_width};
    for (const nn::ParameterShape& key : nn::CheckpointKeys(config))
      sizes.insert(sizes.end(), key.shape.begin(), key.shape.end());
    return sizes;
  };
  return keys(a) == keys(b);
}

}  // namespace

const nn::EvacModel& Workshop::ModelFor(const nn::ModelConfig& config) {
  if (model_ && SameSizes(model_->config(), config)) return *model_;
  nn::HashWeights weights;
  model_.emplace(weights, config);
  return *model_;
}

Tensor Workshop::FirstFrame() const {
  std::vector<std::filesystem::path> paths;
  for (const auto& entry : std::filesystem::directory_iterator(folder_)) {
    if (entry.path().extension() == ".safetensors") paths.push_back(entry.path());
  }
  std::sort(paths.begin(), paths.end());
  for (const std::filesystem::path& path : paths) {
    const GoldenFile file(path);
    if (file.Has("image_views_u8")) return file.Get("image_views_u8").select(1, 0).to(at::kFloat) / 255;
  }
  throw TensorError(folder_.string() + ": no file of the folder holds image_views_u8, the picture that was resized");
}

std::optional<Check> CheckFor(const GoldenFile& file) {
  const Kind kinds[] = {{file.Has("alphas_cumprod"), CheckSchedule},
                        {file.Has("sum_f64"), CheckWeights},
                        {file.Has("loss"), CheckTraining},
                        {file.Has("chunk0.samples"), CheckInference},
                        {file.Has("samples"), CheckDdim},
                        {file.Has("x") && file.Has("context"), CheckUNet},
                        {file.Has("moments"), CheckVae},
                        {file.Has("clip_tokens"), CheckClipResampler},
                        {AnyNameEndsWith(file, ".delta_raw_f64"), CheckActions},
                        {AnyNameEndsWith(file, ".crc32_all") || file.Has("syn.crc32"), CheckActionMaps},
                        {AnyNameEndsWith(file, ".dir_hwc") || file.Has("syn.dir"), CheckRayMaps},
                        {HoldsResizedPictures(file), CheckImageResize}};
  for (const Kind& kind : kinds) {
    if (kind.holds) return kind.check;
  }
  return std::nullopt;
}

}  // namespace evac::golden
