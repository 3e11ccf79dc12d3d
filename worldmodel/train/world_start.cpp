#include <algorithm>

#include "worldmodel/train/train_world.h"
#include "worldmodel/train/weight_files.h"

namespace evac::train {
namespace {

bool BeginsWithAny(const std::string& key, const std::vector<std::string>& prefixes) {
  return std::ranges::any_of(prefixes, [&](const std::string& prefix) { return key.starts_with(prefix); });
}

/// Whether `init` gives a forecast, and not all of it is excepted.
bool GivesForecast(const WorldStart& start) {
  if (start.init.empty()) return false;
  const TensorFile init = TensorFile::OpenCheckpoint(start.init);
  return std::ranges::any_of(init.tensors(), [&](const TensorView& tensor) {
    return tensor.name.starts_with(nn::kForecastPrefix) && !BeginsWithAny(tensor.name, start.init_except);
  });
}

/// What is drawn at random is not trained here: a forecast is one that was.
void CheckForecast(const nn::ModelConfig& config, const WorldStart& start) {
  if (!config.object_forecast && !start.forecast.empty())
    throw TensorError("the page of sizes has object_forecast: false, wanted true, or no --forecast " +
                      start.forecast.string());
  if (config.object_forecast && start.forecast.empty() && !GivesForecast(start))
    throw TensorError("the page of sizes has object_forecast: true and no forecast is given: wanted --forecast, or "
                      "--init with weights that hold one");
}

void CheckExceptions(const nn::ModelConfig& config, const WorldStart& start) {
  if (start.init_except.empty()) return;
  std::vector<std::string> from_others = {kCodecPrefix};
  if (!start.forecast.empty()) from_others.push_back(nn::kForecastPrefix);
  const std::vector<nn::ParameterShape> keys = nn::CheckpointKeys(config);
  for (const std::string& prefix : start.init_except) {
    const bool begins = std::ranges::any_of(keys, [&](const nn::ParameterShape& parameter) {
      return parameter.key.starts_with(prefix) && !BeginsWithAny(parameter.key, from_others);
    });
    if (!begins)
      throw TensorError("--init-except '" + prefix +
                        "' begins no key that --init gives: `evac weights inspect --list` says them");
  }
}

}  // namespace

void CheckStart(const nn::ModelConfig& config, const WorldStart& start) {
  CheckForecast(config, start);
  CheckExceptions(config, start);
}

}  // namespace evac::train
