#include <algorithm>
#include <utility>

#include "worldmodel/nn/model_sizes.h"
#include "worldmodel/nn/weight_keys.h"
#include "worldmodel/nn/weights.h"
#include "worldmodel/train/train_world.h"
#include "worldmodel/train/weight_files.h"

namespace evac::train {
namespace {

bool BeginsWithAny(const std::string& key, const std::vector<std::string>& prefixes) {
  return std::ranges::any_of(prefixes, [&](const std::string& prefix) { return key.starts_with(prefix); });
}

/// Whether `init` gives a forecast, and none of it is excepted: what is drawn anew would stay as it was drawn.
bool GivesForecast(const WorldStart& start) {
  if (start.init.empty()) return false;
  const TensorFile init = TensorFile::OpenCheckpoint(start.init);
  bool gives = false;
  for (const TensorView& tensor : init.tensors()) {
    if (!tensor.name.starts_with(nn::kForecastPrefix)) continue;
    if (BeginsWithAny(tensor.name, start.init_except)) return false;
    gives = true;
  }
  return gives;
}

/// What is drawn at random is not trained here: a forecast is one that was.
void CheckForecast(const nn::ModelConfig& config, const WorldStart& start) {
  if (!config.object_forecast && !start.forecast.empty())
    throw TensorError("the page of sizes has object_forecast: false, wanted true, or no --forecast " +
                      start.forecast.string());
  if (!config.object_forecast && GivesForecast(start))
    throw TensorError(start.init.string() +
                      ": its model has an object_forecast, wanted object_forecast: true on the page of sizes");
  if (config.object_forecast && start.forecast.empty() && !GivesForecast(start))
    throw TensorError("the page of sizes has object_forecast: true and no forecast is given: wanted --forecast, or "
                      "--init with weights that hold one");
}

/// Beginnings of the keys that other files than `init` give.
std::vector<std::string> FromOthers(const WorldStart& start) {
  std::vector<std::string> prefixes = {kCodecPrefix};
  if (!start.forecast.empty()) prefixes.push_back(nn::kForecastPrefix);
  return prefixes;
}

/// What is excepted is a key of the page, drawn anew, or one of the file that the page lacks, left behind.
void CheckExceptions(const nn::ModelConfig& config, const WorldStart& start, const TensorFile& init) {
  std::vector<std::string> keys;
  for (nn::ParameterShape& parameter : nn::CheckpointKeys(config)) keys.push_back(std::move(parameter.key));
  for (const TensorView& tensor : init.tensors()) keys.push_back(tensor.name);
  const std::vector<std::string> from_others = FromOthers(start);
  for (const std::string& prefix : start.init_except) {
    const bool begins = std::ranges::any_of(
        keys, [&](const std::string& key) { return key.starts_with(prefix) && !BeginsWithAny(key, from_others); });
    if (!begins)
      throw TensorError("--init-except '" + prefix +
                        "' begins no key that --init gives: `evac weights inspect --list` says them");
  }
}

/// What is neither excepted nor given by others fits key by key, as a network's file does: what the page has no use for
/// would be left behind without a word, and the rest be another network than the one that was trained.
void CheckKeys(const nn::ModelConfig& config, const WorldStart& start, const TensorFile& init) {
  std::vector<std::string> aside = FromOthers(start);
  aside.insert(aside.end(), start.init_except.begin(), start.init_except.end());
  nn::KeyFit fit = nn::CompareKeys(init, config);
  for (std::vector<std::string>* complaints : {&fit.missing, &fit.extra, &fit.misshapen})
    std::erase_if(*complaints, [&](const std::string& complaint) { return BeginsWithAny(complaint, aside); });
  if (start.init_widen)  // WidenedWeights says what of it does not fit
    std::erase_if(fit.misshapen, [](const std::string& complaint) { return complaint.starts_with(kFirstLayer); });
  if (!fit.Fits())
    throw TensorError(init.name() + " does not fit the page of sizes: " + fit.Complaint() +
                      " (--init-except PREFIX leaves out what is not to be taken over)");
}

/// Sizes that no shape shows and that say what weights mean. The rest may be another robot's.
std::vector<std::string> SizesOfMeaning(const nn::ModelConfig& config, const WorldStart& start) {
  static const std::string kBase = "schedule.from_last_frame", kPlane = "schedule.carry_plane_m";
  std::vector<std::string> sizes = {"unet.num_head_channels", "unet.init_attention_heads", "action_resampler.",
                                    "image_resampler.",       "image_encoder.",            "vae.scale_factor"};
  // What the answer is counted from; a last layer that is drawn anew answers nothing yet.
  const bool keeps_answer = !BeginsWithAny("model.diffusion_model.out.2.weight", start.init_except);
  if (keeps_answer) sizes.push_back(kBase);
  const bool gives_forecast = config.object_forecast && start.forecast.empty();
  if (gives_forecast || (keeps_answer && start.init_widen)) sizes.push_back(kPlane);
  return sizes;
}

/// Weights know the noise that they learned from.
void CheckSchedule(const nn::ModelConfig& config, const WorldStart& start, const nn::MappedTensors& init) {
  for (const char* buffer : {"alphas_cumprod", "scale_arr"}) {
    if (BeginsWithAny(buffer, start.init_except)) return;
  }
  nn::CompareSchedule(init, config);
}

}  // namespace

TensorMetadata WhatForecastIsFor(const TensorMetadata& shards, const nn::ModelConfig& config) {
  TensorMetadata what = WhatFor(shards);
  nn::ModelConfig sizes = config;
  for (const nn::Size& size : nn::SizesOf(sizes)) {
    if (size.Key() == "schedule.carry_plane_m") what["carry_plane_m"] = nn::TextOf(size);
  }
  return what;
}

void CheckForecastFor(const std::filesystem::path& forecast, const TensorMetadata& what_for) {
  const TensorFile file = TensorFile::OpenCheckpoint(forecast);
  for (const char* key : {"period_s", "cameras", "arms", "arms_read", "pose_map", "carry_plane_m"}) {
    const auto own = file.metadata().find(key), wanted = what_for.find(key);
    if (own == file.metadata().end() || wanted == what_for.end() || own->second == wanted->second) continue;
    throw TensorError(forecast.string() + ": the forecast was trained for " + key + " '" + own->second + "', wanted '" +
                      wanted->second + "'");
  }
}

void CheckStart(const nn::ModelConfig& config, const WorldStart& start) {
  CheckForecast(config, start);
  if (start.init.empty()) return;
  const nn::MappedTensors init(TensorFile::OpenCheckpoint(start.init));
  CheckExceptions(config, start, init.file());
  CheckKeys(config, start, init.file());
  nn::CompareSizes(init.file(), config, SizesOfMeaning(config, start));
  CheckSchedule(config, start, init);
}

}  // namespace evac::train
