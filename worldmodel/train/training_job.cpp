#include "worldmodel/train/training_job.h"

#include <algorithm>
#include <cstdio>
#include <fstream>
#include <sstream>
#include <system_error>

#include "worldmodel/nn/model_sizes.h"
#include "worldmodel/nn/number_text.h"

namespace evac::train {
namespace {

constexpr const char *kFirstLine = "evac-training 1", *kSize = "size ", *kOption = "option ", *kLastLine = "begun_with";
constexpr std::size_t kMostBytes = 1 << 20;

Settings OptionsOf(TrainingJob& job) {
  return job.kind == TrainingKind::kCodec ? SettingsOf(job.codec) : SettingsOf(job.world);
}

/// What stands on a line besides sizes and options.
bool SetOther(TrainingJob& job, const std::string& name, const std::string& value) {
  if (name == "codec_sha256") job.start.codec_sha256 = value;
  else if (name == "init_except") job.start.init_except.push_back(value);
  else if (name == "init_sha256") job.init_sha256 = value;
  else if (name == "forecast_sha256") job.forecast_sha256 = value;
  else if (name == "recipe") job.recipe = value;
  else if (name == kLastLine) job.begun_with = value;
  else if (name == "init_widen") return nn::ParseFlag(value, job.start.init_widen);
  else if (name == "wants_init") return nn::ParseFlag(value, job.wants_init);
  else if (name == "wants_forecast") return nn::ParseFlag(value, job.wants_forecast);
  else return false;
  return true;
}

/// "size unet.in_channels 19" and the like. @returns whether there is such a name and it may be that
bool SetLine(TrainingJob& job, const std::string& line) {
  const auto split = [](const std::string& text) {
    const std::size_t space = std::min(text.find(' '), text.size());
    return std::pair(text.substr(0, space), text.substr(std::min(space + 1, text.size())));
  };
  if (line.starts_with(kSize)) {
    const auto [key, value] = split(line.substr(std::string(kSize).size()));
    for (const nn::Size& size : nn::SizesOf(job.config)) {
      if (size.Key() == key) return nn::SetFromText(size, value);
    }
    return false;
  }
  if (line.starts_with(kOption)) {
    const auto [name, value] = split(line.substr(std::string(kOption).size()));
    for (const Setting& setting : OptionsOf(job)) {
      if (setting.name == name) return SetFromText(setting, value);
    }
    return false;
  }
  const auto [name, value] = split(line);
  return SetOther(job, name, value);
}

/// A job is written anew; what is no job is somebody's shards, weights or page.
void RequireNoOthersFile(const std::filesystem::path& path) {
  std::error_code unknown;  // what cannot be looked at cannot be written either
  if (!std::filesystem::exists(path, unknown)) return;
  const std::string wanted = std::string(kFirstLine) + "\n";
  std::string found(wanted.size(), '\0');
  std::ifstream file;
  if (std::filesystem::is_regular_file(path, unknown)) file.open(path, std::ios::binary);  // a pipe would be waited for
  if (file.read(found.data(), static_cast<std::streamsize>(found.size())) && found == wanted) return;
  throw TensorError(path.string() + ": what is there does not begin with '" + kFirstLine +
                    "', so it would be lost: wanted the name of a new file, or of an earlier job");
}

}  // namespace

std::string TextOf(const TrainingJob& given) {
  TrainingJob job = given;
  const bool is_codec = job.kind == TrainingKind::kCodec;
  std::string text = std::string(kFirstLine) + "\n" + (is_codec ? "codec" : "world") + "\n";
  for (const nn::Size& size : nn::SizesOf(job.config)) text += kSize + size.Key() + " " + nn::TextOf(size) + "\n";
  for (const Setting& setting : OptionsOf(job)) text += kOption + setting.name + " " + TextOf(setting) + "\n";
  const auto flag = [&](const char* name, bool value) { text += std::string(name) + (value ? " true\n" : " false\n"); };
  if (!job.start.codec_sha256.empty()) text += "codec_sha256 " + job.start.codec_sha256 + "\n";
  for (const std::string& prefix : job.start.init_except) text += "init_except " + prefix + "\n";
  flag("init_widen", job.start.init_widen);
  flag("wants_init", job.wants_init);
  flag("wants_forecast", job.wants_forecast);
  if (!job.init_sha256.empty()) text += "init_sha256 " + job.init_sha256 + "\n";
  if (!job.forecast_sha256.empty()) text += "forecast_sha256 " + job.forecast_sha256 + "\n";
  if (!job.recipe.empty()) text += "recipe " + job.recipe + "\n";
  return text + kLastLine + " " + job.begun_with + "\n";
}

TrainingJob ParseTrainingJob(const std::string& text, const std::string& name) {
  std::istringstream lines(text);
  std::string line, kind;
  if (!std::getline(lines, line) || line != kFirstLine)
    throw TensorError(name + ": its first line is '" + line.substr(0, 40) + "', wanted '" + kFirstLine +
                      "', as `evac train … --job` writes it");
  const TensorError cut_off(name + ": it is cut off: wanted '" + kLastLine +
                            " …' as its last line, as `evac train … --job` writes it");
  if (!text.ends_with('\n')) throw cut_off;
  TrainingJob job;
  std::getline(lines, kind);
  if (kind != "codec" && kind != "world")
    throw TensorError(name + ":2: found '" + kind.substr(0, 40) + "', wanted codec or world");
  job.kind = kind == "codec" ? TrainingKind::kCodec : TrainingKind::kWorld;
  bool is_whole = false;
  for (int number = 3; std::getline(lines, line); ++number) {
    if (!SetLine(job, line))
      throw TensorError(name + ":" + std::to_string(number) + ": found '" + line.substr(0, 100) +
                        "', wanted a size or an option that this version has, and a value that it may have");
    is_whole = line.starts_with(kLastLine);
  }
  if (!is_whole) throw cut_off;
  try {
    job.config.Check();
  } catch (const TensorError& error) {
    throw TensorError(name + ": " + error.what());
  }
  return job;
}

void WriteTrainingJob(const std::filesystem::path& path, const TrainingJob& job) {
  RequireNoOthersFile(path);
  const std::filesystem::path unfinished = path.string() + ".tmp";
  {
    std::ofstream file(unfinished, std::ios::binary | std::ios::trunc);
    file << TextOf(job);
    file.close();
    if (!file) {
      std::error_code ignored;
      std::filesystem::remove(unfinished, ignored);
      throw TensorError(path.string() + ": cannot be written");
    }
  }
  std::error_code error;
  std::filesystem::rename(unfinished, path, error);
  if (!error) return;
  std::error_code ignored;
  std::filesystem::remove(unfinished, ignored);
  throw TensorError(path.string() + ": cannot be written: " + error.message());
}

TrainingJob ReadTrainingJob(const std::filesystem::path& path) {
  std::error_code error;
  const auto size = std::filesystem::file_size(path, error);
  if (error) throw TensorError(path.string() + ": cannot be read: " + error.message());
  if (size > kMostBytes)
    throw TensorError(path.string() + ": " + std::to_string(size) + " bytes, wanted a file of `evac train … --job`");
  std::ifstream file(path, std::ios::binary);
  std::ostringstream text;
  text << file.rdbuf();
  if (!file) throw TensorError(path.string() + ": cannot be read");
  return ParseTrainingJob(text.str(), path.string());
}

}  // namespace evac::train
