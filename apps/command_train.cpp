#include <fmt/format.h>

#include <memory>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <optional>
#include <thread>

#include "apps/commands.h"
#include "apps/interrupts.h"
#include "apps/training_page.h"
#include "apps/training_progress.h"
#include "core/file.h"
#include "core/hash.h"
#include "worldmodel/evac_config.h"
#include "worldmodel/nn/threads.h"
#include "worldmodel/train/train_world.h"

namespace evac {
namespace {

namespace fs = std::filesystem;

struct TrainArguments {
  std::string shards, config, training, out, codec, init;
  std::vector<std::string> settings, init_except;
  std::optional<double> minutes;
  std::optional<std::int64_t> steps;
  int threads = 0;
};
using Arguments = std::shared_ptr<TrainArguments>;

int Threads(const TrainArguments& arguments) {
  return arguments.threads > 0 ? arguments.threads : std::max(1, static_cast<int>(std::thread::hardware_concurrency()));
}

/// What the command line says beside the page.
void Override(const TrainArguments& arguments, train::TrainerOptions& options) {
  if (arguments.minutes) options.minutes = *arguments.minutes;
  if (!arguments.steps) return;
  options.steps = *arguments.steps;
  options.minutes = 0;
}

train::JobPlace PlaceOf(const TrainArguments& arguments, TrainingProgress& progress) {
  return {arguments.shards,
          arguments.out,
          ReadEvacConfig(arguments.config),
          Threads(arguments),
          IsInterrupted,
          [&](const train::TrainerProgress& at) { progress.Show(at); },
          [&](const std::string& sentence) { progress.Say(sentence); }};
}

/// Threads that share the parts of a step use one core each.
int LibraryThreadsOf(const train::JobPlace& place, const train::JobOptions& options) {
  return Workers(place, options) > 1 ? 1 : place.threads;
}

ExitCode End(const train::TrainerSummary& summary, const fs::path& out, const char* file) {
  if (!summary.IsDone()) {
    fmt::print(stderr, "interrupted at step {} of {}: the same command goes on from there\n", summary.step, summary.steps);
    return ExitCode::kInternal;
  }
  const std::string best = summary.best ? fmt::format(", best hold-out {:.6g} at step {}", *summary.best, summary.best_step) : "";
  fmt::print("{}: {} after {} steps{}\n", (out / file).string(), summary.why, summary.step, best);
  return ExitCode::kOk;
}

ExitCode RunCodec(const TrainArguments& arguments) {
  train::CodecOptions options;
  ReadTrainingPage(arguments.training, "codec", arguments.settings, SettingsOf(options));
  Override(arguments, options.job.trainer);
  const CatchInterrupts catch_interrupts;
  TrainingProgress progress(stderr);
  const train::JobPlace place = PlaceOf(arguments, progress);
  const nn::LibraryThreads threads(LibraryThreadsOf(place, options.job));
  return End(TrainCodec(place, options), arguments.out, "codec.safetensors");
}

/// OUT/strips/step_00001200.png
void WriteStrips(const fs::path& out, std::int64_t step, const train::Strips& strips) {
  const auto rows = static_cast<int>(strips.picture.size(0)), columns = static_cast<int>(strips.picture.size(1));
  const cv::Mat rgb(rows, columns, CV_8UC3, strips.picture.data_ptr());
  cv::Mat bgr;
  cv::cvtColor(rgb, bgr, cv::COLOR_RGB2BGR);
  std::vector<unsigned char> png;
  cv::imencode(".png", bgr, png);
  MakeFolders(out / "strips");
  WriteFileAtomically(out / "strips" / fmt::format("step_{:08}.png", step),
                      {reinterpret_cast<const char*>(png.data()), png.size()});
}

ExitCode RunWorld(const TrainArguments& arguments) {
  train::WorldOptions options;
  ReadTrainingPage(arguments.training, "world", arguments.settings, SettingsOf(options));
  Override(arguments, options.job.trainer);
  const train::WorldStart start{arguments.codec, arguments.init, arguments.init_except, Sha256HexOfFile(arguments.codec)};
  const CatchInterrupts catch_interrupts;
  TrainingProgress progress(stderr);
  const train::JobPlace place = PlaceOf(arguments, progress);
  const nn::LibraryThreads threads(LibraryThreadsOf(place, options.job));
  const auto look = [&](std::int64_t step, const train::Strips& strips) { WriteStrips(arguments.out, step, strips); };
  return End(TrainWorld(place, options, start, look), arguments.out, "weights.safetensors");
}

void AddShared(CLI::App& command, const Arguments& arguments) {
  command.add_option("SHARDS", arguments->shards, "a folder of `evac pack` (docs/formats/shards.md)")
      ->required()
      ->check(CLI::ExistingDirectory);
  command.add_option("--config", arguments->config, "the page of the network's sizes")->required()->check(CLI::ExistingFile);
  command.add_option("--training", arguments->training, "the page of training options; what is left out is the paper's")
      ->check(CLI::ExistingFile);
  command.add_option("--set", arguments->settings, "NAME=VALUE, one option of that page; may be given again");
  command.add_option("--minutes", arguments->minutes, "as many steps as fit, counted once after the first")
      ->check(CLI::Range(0.001, 1e6));
  command.add_option("--steps", arguments->steps, "so many steps")->check(CLI::Range(std::int64_t{1}, std::int64_t{1} << 40));
  command.add_option("--threads", arguments->threads, "default: one per core; the last digits of the sums depend on it")
      ->check(CLI::Range(1, 1024));
  command.add_option("-o,--out", arguments->out, "the folder to write; if it holds this training, it goes on")->required();
}

void AddCodec(CLI::App& group, ExitCode& exit_code) {
  const auto arguments = std::make_shared<TrainArguments>();
  CLI::App* command = group.add_subcommand("codec", "Train the latent codec on pictures and pose maps.");
  AddShared(*command, arguments);
  command->footer(
      "Example:\n"
      "  evac train codec out/shards --config apps/configs/desk_model.yaml --training apps/configs/desk_training.yaml \\\n"
      "                   --minutes 8 --out out/codec\n"
      "Then: evac encode out/shards --config … --codec out/codec/codec.safetensors. More: docs/train.md");
  command->callback([arguments, &exit_code] { exit_code = RunCodec(*arguments); });
}

void AddWorld(CLI::App& group, ExitCode& exit_code) {
  const auto arguments = std::make_shared<TrainArguments>();
  CLI::App* command = group.add_subcommand("world", "Train the world model on encoded shards.");
  AddShared(*command, arguments);
  command->add_option("--codec", arguments->codec, "the codec's weights, which encoded the shards")
      ->required()
      ->check(CLI::ExistingFile);
  command->add_option("--init", arguments->init, "a checkpoint to go on from: fine-tuning; every key must fit")
      ->check(CLI::ExistingFile);
  command
      ->add_option("--init-except", arguments->init_except,
                   "keys that begin so are drawn anew instead, with commas between them")
      ->delimiter(',');
  command->footer(
      "Examples:\n"
      "  evac train world out/shards --config apps/configs/desk_model.yaml --training apps/configs/desk_training.yaml \\\n"
      "                   --codec out/codec/codec.safetensors --minutes 40 --out out/world\n"
      "  evac train world mine/shards --config my_model.yaml --codec codec.safetensors --init evac.safetensors \\\n"
      "                   --init-except model.diffusion_model.input_blocks.0 --steps 2000 --out out/mine\n"
      "OUT: weights.safetensors, metrics.csv, holdout.csv, strips/ (truth above, imagined below). More: docs/train.md");
  command->callback([arguments, &exit_code] { exit_code = RunWorld(*arguments); });
}

}  // namespace

void AddTrain(CLI::App& app, ExitCode& exit_code) {
  CLI::App* group = app.add_subcommand("train", "Train the codec and the world model.");
  group->require_subcommand(1);
  AddCodec(*group, exit_code);
  AddWorld(*group, exit_code);
}

}  // namespace evac
