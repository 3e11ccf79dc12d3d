#include "worldmodel/train/settings.h"

#include <cmath>
#include <cstdlib>
#include <set>
#include <sstream>
#include <type_traits>
#include <utility>

#include "worldmodel/nn/number_text.h"
#include "worldmodel/train/option_limits.h"

namespace evac::train {
namespace {

constexpr const char* kTraining = "world training";

void Add(Settings& settings, const Settings& more) { settings.insert(settings.end(), more.begin(), more.end()); }

void AddJob(Settings& settings, JobOptions& job) {
  Add(settings, SettingsOf(job.trainer));
  settings.push_back({"bf16", &job.bf16});
  settings.push_back({"holdout_size", &job.holdout_size});
}

/// "1,0.25". @throws TensorError for a number that is none, or not above 0
std::vector<double> Numbers(const std::string& text) {
  std::vector<double> numbers;
  std::istringstream words(text);
  for (std::string word; std::getline(words, word, ',');) {
    char* end = nullptr;
    const double number = std::strtod(word.c_str(), &end);
    if (word.empty() || *end != '\0' || !(number > 0) || !std::isfinite(number))
      throw OptionError(kTraining, "view_weights", "is '" + text + "', wanted numbers above 0 with commas between");
    numbers.push_back(number);
  }
  return numbers;
}

/// What may change from one process of a training to the next, and what the trainer compares itself.
bool IsLengthOrLook(const std::string& name) {
  static const std::set<std::string> kNames = {"steps", "minutes", "patience", "checkpoint_every_s", "strip_steps"};
  return kNames.contains(name);
}

/// As trainings are told apart by: what is said of a flag is 0 or 1 there.
std::string IdentityText(const Setting& setting) {
  const auto* flag = std::get_if<bool*>(&setting.field);
  return flag ? std::to_string(**flag) : TextOf(setting);
}

bool Parse(const std::string& text, std::string& field) {
  field = text;
  return true;
}
bool Parse(const std::string& text, bool& field) { return nn::ParseFlag(text, field); }
bool Parse(const std::string& text, double& field) { return nn::ParseNumber(text, field); }
bool Parse(const std::string& text, std::uint64_t& field) { return nn::ParseNumber(text, field); }
bool Parse(const std::string& text, std::int64_t& field) {
  std::int64_t found = 0;
  if (!nn::ParseNumber(text, found) || found < 0 || found >= std::int64_t{1} << 40) return false;  // as on the page
  field = found;
  return true;
}

}  // namespace

std::string TextOf(const Setting& setting) {
  return std::visit(
      [](const auto* field) -> std::string {
        using Type = std::decay_t<decltype(*field)>;
        if constexpr (std::is_same_v<Type, std::string>) return *field;
        else if constexpr (std::is_same_v<Type, bool>) return *field ? "true" : "false";
        else if constexpr (std::is_same_v<Type, double>) return nn::TextOfNumber(*field);
        else return std::to_string(*field);
      },
      setting.field);
}

bool SetFromText(const Setting& setting, const std::string& text) {
  return std::visit([&](auto* field) { return Parse(text, *field); }, setting.field);
}

Settings SettingsOf(TrainerOptions& t) {
  return {{"steps", &t.steps},
          {"minutes", &t.minutes},
          {"learning_rate", &t.learning_rate},
          {"warmup_steps", &t.warmup_steps},
          {"decay_from", &t.decay_from},
          {"optimiser", &t.optimiser},
          {"momentum", &t.momentum},
          {"beta1", &t.adamw.beta1},
          {"beta2", &t.adamw.beta2},
          {"epsilon", &t.adamw.epsilon},
          {"weight_decay", &t.adamw.weight_decay},
          {"clip_norm", &t.clip_norm},
          {"average_decay", &t.average_decay},
          {"accumulate", &t.accumulate},
          {"holdout_every", &t.holdout_every},
          {"patience", &t.patience},
          {"checkpoint_every_s", &t.checkpoint_every_s},
          {"seed", &t.seed}};
}

Settings SettingsOf(CodecOptions& options) {
  CodecTrainingOptions& c = options.codec;
  Settings settings = {{"batch", &c.batch},
                       {"map_share", &c.map_share},
                       {"squared_weight", &c.squared_weight},
                       {"kl_weight", &c.kl_weight},
                       {"latent_noise", &c.latent_noise},
                       {"foreground_weight", &c.foreground_weight},
                       {"foreground_radius", &c.foreground_radius},
                       {"contact_share", &c.contact_share}};
  AddJob(settings, options.job);
  return settings;
}

Settings SettingsOf(ForecastOptions& options) {
  ForecastTrainingOptions& f = options.forecast;
  Settings settings = {{"batch", &f.batch},
                       {"frames", &f.frames},
                       {"variant_share", &f.variant_share},
                       {"failure_weight", &f.failure_weight},
                       {"late_start", &f.late_start},
                       {"drop", &f.drop},
                       {"picture_gain", &f.picture_gain},
                       {"picture_noise", &f.picture_noise},
                       {"success_weight", &f.success_weight},
                       {"finder_weight", &f.finder_weight}};
  Add(settings, SettingsOf(options.job.trainer));
  return settings;
}

Settings SettingsOf(WorldOptions& options) {
  WorldTrainingOptions& w = options.world;
  Settings settings = {{"batch", &w.batch},
                       {"history", &w.windows.history},
                       {"rollout_share", &w.windows.rollout_share},
                       {"contact_share", &w.windows.contact_share},
                       {"closing_share", &w.windows.closing_share},
                       {"opening_share", &w.windows.opening_share},
                       {"successes_only", &w.windows.successes_only},
                       {"failure_weight", &w.windows.failure_weight},
                       {"first_image", &w.windows.first_image},
                       {"drop", &w.drop},
                       {"memory_noise_kind", &options.memory_noise_kind},
                       {"memory_noise", &w.memory_noise},
                       {"memory_noise_share", &w.memory_noise_share},
                       {"terminal_share", &w.terminal_share},
                       {"log_uniform", &w.log_uniform},
                       {"ratio_from", &w.ratio_from},
                       {"ratio_to", &w.ratio_to},
                       {"step_weight", &options.step_weight},
                       {"step_weight_cap", &w.step_weight_cap},
                       {"squared_below", &w.squared_below},
                       {"reach_weight", &w.reach_weight},
                       {"object_weight", &w.object_weight},
                       {"object_radius", &w.object_radius},
                       {"change_weight", &w.change_weight},
                       {"view_weights", &options.view_weights},
                       {"self_memory_share", &w.self_memory_share},
                       {"self_memory_from", &w.self_memory_from},
                       {"self_memory_chunks", &w.self_memory_chunks},
                       {"train_action_resampler", &w.train_action_resampler},
                       {"train_image_encoder", &w.train_image_encoder},
                       {"show_end_that_came", &w.show_end_that_came},
                       {"strip_steps", &options.strip_steps}};
  AddJob(settings, options.job);
  return settings;
}

void WorldOptions::Resolve() {
  world.view_weights = Numbers(view_weights);
  if (memory_noise_kind != "published" && memory_noise_kind != "uniform")
    throw OptionError(kTraining, "memory_noise_kind", "is '" + memory_noise_kind + "', wanted published or uniform");
  world.memory_noise_kind = memory_noise_kind == "uniform" ? MemoryNoise::kUniform : MemoryNoise::kPublished;
  if (step_weight != "velocity" && step_weight != "min_snr" && step_weight != "clean")
    throw OptionError(kTraining, "step_weight", "is '" + step_weight + "', wanted velocity, min_snr or clean");
  world.step_weight = step_weight == "min_snr" ? StepWeight::kMinSnr
                      : step_weight == "clean" ? StepWeight::kClean
                                               : StepWeight::kVelocity;
}

std::string IdentityOf(const Settings& settings) {
  std::string text;
  for (const Setting& setting : settings) {
    if (!IsLengthOrLook(setting.name)) text += setting.name + " " + IdentityText(setting) + "\n";
  }
  return text;
}

}  // namespace evac::train
