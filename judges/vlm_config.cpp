#include "judges/vlm_config.h"

#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <cstdlib>

#include "core/config.h"
#include "core/file.h"
#include "core/hash.h"

namespace evac {
namespace {

bool IsPlain(const std::string& name) {
  return !name.empty() && std::all_of(name.begin(), name.end(), [](unsigned char c) {
    return std::isalnum(c) || c == '-' || c == '_' || c == '.';
  });
}

Config SectionOrEmpty(const Config& page, const std::string& key) {
  return page.Has(key) ? page.Section(key) : Config::FromText("{}", page.file());
}

void ReadKey(const Config& page, VlmConfig& config) {
  const Config key = SectionOrEmpty(page, "key");
  key.AllowOnly({"env", "file"});
  config.key_env = key.Get<std::string>("env", "");
  if (key.Has("file")) config.key_file = key.Path("file");
  key.Require(config.key_env.empty() || config.key_file.empty(), "env", "either env or file, not both");
}

void ReadSampling(const Config& page, VlmSampling& sampling) {
  const Config section = SectionOrEmpty(page, "sampling");
  section.AllowOnly({"temperature", "seed", "max_tokens"});
  sampling.model = page.Get<std::string>("model");
  sampling.temperature = section.Get("temperature", sampling.temperature);
  sampling.seed = section.Get("seed", sampling.seed);
  sampling.max_tokens = section.Get("max_tokens", sampling.max_tokens);
  section.Require(sampling.temperature >= 0, "temperature", "0 or more");
  section.Require(sampling.max_tokens >= 100, "max_tokens", "100 or more: an answer must fit in");
}

void ReadVlmClipOptions(const Config& page, VlmClipOptions& clip) {
  const Config section = SectionOrEmpty(page, "clip");
  section.AllowOnly({"frames", "tail_frames", "long_side_px", "jpeg_quality"});
  clip.frames = section.Get("frames", clip.frames);
  clip.tail_frames = section.Get("tail_frames", clip.tail_frames);
  clip.long_side_px = section.Get("long_side_px", clip.long_side_px);
  clip.jpeg_quality = section.Get("jpeg_quality", clip.jpeg_quality);
  section.Require(clip.frames >= 2 && clip.frames <= 256, "frames", "2 … 256");
  section.Require(clip.tail_frames >= 0 && clip.tail_frames <= 256, "tail_frames", "0 … 256");
  section.Require(clip.long_side_px >= 28 && clip.long_side_px <= 4096, "long_side_px", "28 … 4096");
  section.Require(clip.jpeg_quality >= 1 && clip.jpeg_quality <= 100, "jpeg_quality", "1 … 100");
}

void ReadLimits(const Config& page, HttpLimits& limits) {
  const Config section = SectionOrEmpty(page, "timeouts");
  section.AllowOnly({"connect_s", "first_byte_s", "idle_s", "total_s"});
  limits.connect_s = section.Get("connect_s", limits.connect_s);
  limits.first_byte_s = section.Get("first_byte_s", limits.first_byte_s);
  limits.idle_s = section.Get("idle_s", limits.idle_s);
  limits.total_s = section.Get("total_s", limits.total_s);
  for (const auto& [key, value] : {std::pair("connect_s", limits.connect_s),
                                   {"first_byte_s", limits.first_byte_s},
                                   {"idle_s", limits.idle_s},
                                   {"total_s", limits.total_s}})
    section.Require(value > 0 && value < 86400, key, "a positive number of seconds, less than a day");
}

void ReadBudget(const Config& page, VlmBudget& budget) {
  const Config section = SectionOrEmpty(page, "budget");
  section.AllowOnly(
      {"max_requests", "max_tokens", "max_usd", "usd_per_million_prompt_tokens", "usd_per_million_completion_tokens"});
  budget.max_requests = section.Get("max_requests", 0);
  budget.max_tokens = section.Get("max_tokens", 0);
  budget.max_usd = section.Get("max_usd", 0.0);
  budget.usd_per_million_prompt_tokens = section.Get("usd_per_million_prompt_tokens", 0.0);
  budget.usd_per_million_completion_tokens = section.Get("usd_per_million_completion_tokens", 0.0);
  for (const auto& [key, value] : {std::pair("max_requests", static_cast<double>(budget.max_requests)),
                                   {"max_tokens", static_cast<double>(budget.max_tokens)},
                                   {"max_usd", budget.max_usd},
                                   {"usd_per_million_prompt_tokens", budget.usd_per_million_prompt_tokens},
                                   {"usd_per_million_completion_tokens", budget.usd_per_million_completion_tokens}})
    section.Require(value >= 0, key, "0 (none) or more");
  const bool has_prices = budget.usd_per_million_prompt_tokens > 0 || budget.usd_per_million_completion_tokens > 0;
  section.Require(budget.max_usd == 0 || has_prices, "max_usd", "prices too: usd_per_million_prompt_tokens, …");
}

}  // namespace

VlmConfig VlmConfig::FromFile(const std::filesystem::path& path) {
  const Config page = Config::FromFile(path);
  page.AllowOnly({"name", "base_url", "model", "key", "sampling", "clip", "probe_share", "timeouts", "budget"});
  VlmConfig config;
  config.name = page.Get<std::string>("name");
  page.Require(IsPlain(config.name), "name", "letters, digits, - _ .");
  config.base_url = page.Get<std::string>("base_url");
  config.probe_share = page.Get("probe_share", config.probe_share);
  page.Require(config.probe_share >= 0 && config.probe_share <= 1, "probe_share", "0 … 1");
  ReadKey(page, config);
  ReadSampling(page, config.sampling);
  ReadVlmClipOptions(page, config.clip);
  ReadLimits(page, config.limits);
  ReadBudget(page, config.budget);
  return config;
}

std::string VlmConfig::JudgeName() const {
  const std::string decisive =
      fmt::format("{} {} {} {} {} {} {} {} {}", kVlmVersion, sampling.model, sampling.temperature, sampling.seed,
                  sampling.max_tokens, clip.frames, clip.tail_frames, clip.long_side_px, clip.jpeg_quality);
  return fmt::format("vlm:{}-{}", name, Sha256Hex(decisive).substr(0, 8));
}

std::string VlmConfig::Key() const {
  std::string key;
  if (!key_env.empty()) {
    const char* value = std::getenv(key_env.c_str());
    if (value == nullptr) throw InvalidInput("the environment variable {} is not set; it is to hold the key", key_env);
    key = value;
  } else if (!key_file.empty()) {
    key = ReadFile(key_file);
  }
  std::erase_if(key, [](unsigned char c) { return std::isspace(c); });
  return key;
}

}  // namespace evac
