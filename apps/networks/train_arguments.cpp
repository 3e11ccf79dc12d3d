#include "apps/networks/train_arguments.h"

#include <fmt/format.h>

#include <algorithm>
#include <thread>

#include "apps/interrupts.h"
#include "apps/number_range.h"
#include "apps/warnings.h"
#include "core/config.h"
#include "core/file.h"
#include "core/hash.h"
#include "worldmodel/evac_config.h"
#include "worldmodel/nn/library.h"

namespace evac {
namespace {

/// " page <hash> init <hash>": what JobPlace::begun_with is.
std::string BegunWith(const TrainArguments& arguments) {
  std::string text;
  if (!arguments.config.empty()) text += " page " + Config::FromFile(arguments.config).ContentHash();
  if (!arguments.forecast.empty()) text += " forecast " + Sha256HexOfFile(arguments.forecast);
  if (arguments.init.empty()) return text;
  text += (arguments.init_widen ? " widened init " : " init ") + Sha256HexOfFile(arguments.init);
  for (const std::string& prefix : arguments.init_except) text += " except " + prefix;
  return text;
}

/// Makes the folder of a training.
/// @returns what of it and of what every training writes there at once was not there, in the order to remove it
std::vector<std::filesystem::path> MakeMissing(const std::filesystem::path& out) {
  if (out.empty()) throw InvalidInput("--out is required");  // where --job may stand in its place
  std::vector<std::filesystem::path> missing;
  std::error_code unknown;  // what cannot be looked at is told where it is made
  const auto add = [&](const std::filesystem::path& path) {
    if (!std::filesystem::exists(path, unknown)) missing.push_back(path);
  };
  for (const char* file : {"begun_by", "lock"}) add(out / file);
  for (std::filesystem::path at = out; !at.empty() && at != at.root_path(); at = at.parent_path()) add(at);
  MakeFolders(out);
  return missing;
}

/// ", best hold-out 0.03 at step 650, 12 steps left out: …": what else there is to say of it.
std::string HowItWent(const train::TrainerSummary& summary) {
  std::string text;
  if (summary.best) text += fmt::format(", best hold-out {:.6g} at step {}", *summary.best, summary.best_step);
  if (!summary.best && summary.holdouts_since_best > 0) text += ", no hold-out was a number";
  if (summary.left_out > 0)
    text += fmt::format(", {} steps left out: their loss or gradient was not finite", summary.left_out);
  return text;
}

}  // namespace

void AddShared(CLI::App& command, const std::shared_ptr<TrainArguments>& arguments) {
  command
      .add_option("SHARDS", arguments->shards,
                  "folders of `evac pack` (docs/formats/shards.md); one that is named twice is drawn from twice as "
                  "often")
      ->required()
      ->check(CLI::ExistingDirectory);
  AddTraining(command, arguments);
}

void AddTraining(CLI::App& command, const std::shared_ptr<TrainArguments>& arguments) {
  command
      .add_option("--training", arguments->training, "the page of training options; what is left out is the paper's")
      ->check(CLI::ExistingFile);
  command.add_option("--set", arguments->settings, "NAME=VALUE, one option of that page; may be given again")
      ->allow_extra_args(false);  // or it would take the folders behind it too
  CLI::Option* minutes =
      command.add_option("--minutes", arguments->minutes, "as many steps as fit, counted once after the first");
  minutes->check(Within(0.001, 1e6));
  command.add_option("--steps", arguments->steps, "so many steps")
      ->check(CLI::Range(std::int64_t{1}, std::int64_t{1} << 40))
      ->excludes(minutes);
  command
      .add_option("--threads", arguments->threads, "default: one per core; the last digits of the sums depend on it")
      ->check(CLI::Range(1, 1024));
  command.add_option("-o,--out", arguments->out, "the folder to write; if it holds this training, it goes on")
      ->required();
}

void AddElsewhere(CLI::App& command, const std::shared_ptr<TrainArguments>& arguments) {
  command.add_option("--device", arguments->device, "cpu, or cuda where libtorch has it")
      ->check(CLI::IsMember({"cpu", "cuda"}))
      ->capture_default_str();
  CLI::Option* out = command.get_option("--out");
  out->required(false);
  command
      .add_option("--job", arguments->job,
                  "a file to write instead of training: what this command says, for evac-train on a machine that has "
                  "libtorch alone")
      ->excludes(out);
}

CLI::Option* AddConfig(CLI::App& command, const std::shared_ptr<TrainArguments>& arguments) {
  return command.add_option("--config", arguments->config, "the page of the network's sizes")->check(CLI::ExistingFile);
}

void Override(const TrainArguments& arguments, train::TrainerOptions& options) {
  if (arguments.minutes) options.minutes = *arguments.minutes;
  if (!arguments.steps) return;
  options.steps = *arguments.steps;
  options.minutes = 0;
}

train::JobPlace PlaceOf(const TrainArguments& arguments, TrainingProgress& progress) {
  if (arguments.device == "cuda" && !nn::HasCuda())
    throw InvalidInput("--device cuda: the libtorch that evac was built with has no CUDA; wanted cpu");
  const int cores = std::max(1, static_cast<int>(std::thread::hardware_concurrency()));
  return {train::ShardFolders(arguments.shards.begin(), arguments.shards.end()),
          arguments.out,
          arguments.config.empty() ? nn::ModelConfig{} : ReadEvacConfig(arguments.config),
          arguments.threads > 0 ? arguments.threads : cores,
          IsInterrupted,
          [&](const train::TrainerProgress& at) { progress.Show(at); },
          [&](const std::string& sentence) { progress.Say(sentence); },
          BegunWith(arguments),
          arguments.device == "cuda" ? at::Device(at::kCUDA) : at::Device(at::kCPU)};
}

HeldFolder::HeldFolder(const std::filesystem::path& out) : out_(out), made_(MakeMissing(out)), lock_(out / "lock") {}

HeldFolder::~HeldFolder() {
  std::error_code ignored;
  const auto holds = [&](const char* file) { return std::filesystem::exists(out_ / file, ignored); };
  if (std::uncaught_exceptions() <= exceptions_ || holds("training.safetensors") || holds("training.unsaved")) return;
  for (const std::filesystem::path& made : made_) std::filesystem::remove(made, ignored);  // no folder that holds more
}

void KeepWhoBegan(const std::filesystem::path& out) {
  KeepWhoBegan(out / "begun_by", std::filesystem::exists(out / "training.safetensors"), out.string());
}

int LibraryThreadsOf(const train::JobPlace& place, const train::JobOptions& options) {
  return Workers(place, options) > 1 ? 1 : place.threads;
}

ExitCode End(const train::TrainerSummary& summary, const std::filesystem::path& out, const char* file) {
  if (!summary.IsDone()) {
    fmt::print(stderr, "interrupted at step {}{}: the same command goes on from there\n", summary.step,
               summary.steps > 0 ? fmt::format(" of {}", summary.steps) : "");
    return ExitCode::kInternal;
  }
  if (summary.steps_now == 0 && summary.steps > 0 && summary.step >= summary.steps)
    fmt::print(stderr,
               "nothing was left to do: the training in {} is planned for {} steps and has done them; more --steps go "
               "on for longer\n",
               out.string(), summary.steps);
  else if (summary.steps_now == 0)
    fmt::print(stderr,
               "nothing was left to do: the training in {} had ended after {} steps, {}, which is its `patience`; "
               "--set patience=N with a larger N goes on\n",
               out.string(), summary.step, summary.why);
  fmt::print("{}: {} after {} steps{}\n", (out / file).string(), summary.why, summary.step, HowItWent(summary));
  return ExitCode::kOk;
}

}  // namespace evac
