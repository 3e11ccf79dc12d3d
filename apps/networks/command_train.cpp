#include <fmt/format.h>

#include <memory>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include "apps/commands.h"
#include "apps/network_parts.h"
#include "apps/networks/packed_clips.h"
#include "apps/networks/run_training.h"
#include "core/file.h"
#include "core/hash.h"
#include "worldmodel/train/sha256.h"
#include "worldmodel/train/train_forecast.h"
#include "worldmodel/train/train_world.h"
#include "worldmodel/train/training_job.h"

namespace evac {
namespace {

namespace fs = std::filesystem;

using Arguments = std::shared_ptr<TrainArguments>;

/// What is to be typed where it is done: each file that was named, by its own name.
std::string CommandThere(const TrainArguments& arguments) {
  std::string command = fmt::format("evac-train {} SHARDS", fs::path(arguments.job).filename().string());
  const auto add = [&](const char* option, const std::string& file) {
    if (!file.empty()) command += fmt::format(" {} {}", option, fs::path(file).filename().string());
  };
  add("--codec", arguments.codec);
  add("--init", arguments.init);
  add("--forecast", arguments.forecast);
  return command + " --out OUT";
}

/// --job: all is looked at and the files are hashed, as if the training began; it is done elsewhere.
/// @param options  of the job, of its kind
template <class Options>
ExitCode WriteJob(const TrainArguments& arguments, const std::string& section, train::TrainingJob& job,
                  Options& options) {
  ReadTrainingPage(arguments.training, section, arguments.settings, SettingsOf(options));
  Override(arguments, options.job.trainer);
  TrainingProgress progress(stderr);
  const train::JobPlace place = PlaceOf(arguments, progress);
  CheckHoldouts(place.shards);
  SayingWhere(arguments, section, [&] {
    if (job.kind == train::TrainingKind::kCodec) train::CheckCodecTraining(place, job.codec, arguments.init);
    else train::CheckWorldTraining(place, job.world, job.start);
  });
  job.config = place.config;
  job.begun_with = place.begun_with;
  job.recipe = train::RecipesOf(place.shards);
  job.wants_init = !arguments.init.empty();
  job.wants_forecast = !arguments.forecast.empty();
  if (job.wants_init) job.init_sha256 = Sha256HexOfFile(arguments.init);
  if (job.wants_forecast) job.forecast_sha256 = Sha256HexOfFile(arguments.forecast);
  train::WriteTrainingJob(arguments.job, job);
  fmt::print("{}: carry it, the shards and the weights that were named. There: {}\n", arguments.job,
             CommandThere(arguments));
  return ExitCode::kOk;
}

ExitCode RunCodec(const TrainArguments& arguments) {
  if (!arguments.job.empty()) {
    train::TrainingJob job;
    job.kind = train::TrainingKind::kCodec;
    return WriteJob(arguments, "codec", job, job.codec);
  }
  const auto run = [&](const train::JobPlace& place, const train::CodecOptions& options) {
    return TrainCodec(place, options, arguments.init);
  };
  return RunTraining<train::CodecOptions>(arguments, {"codec", "codec.safetensors"}, run);
}

ExitCode RunForecast(const TrainArguments& arguments) {
  return RunTraining<train::ForecastOptions>(arguments, {"forecast", "forecast.safetensors"}, train::TrainForecast);
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
  const train::WorldStart start{arguments.codec,      arguments.init,     arguments.init_except,
                                arguments.init_widen, arguments.forecast, train::CodecSha256(arguments.codec)};
  if (!arguments.job.empty()) {
    train::TrainingJob job;
    job.start = start;
    return WriteJob(arguments, "world", job, job.world);
  }
  const auto look = [&](std::int64_t step, const train::Strips& strips) { WriteStrips(arguments.out, step, strips); };
  const auto run = [&](const train::JobPlace& place, const train::WorldOptions& options) {
    return TrainWorld(place, options, start, look);
  };
  return RunTraining<train::WorldOptions>(arguments, {"world", "weights.safetensors"}, run);
}

CLI::Option* AddInit(CLI::App& command, TrainArguments& arguments, const char* what) {
  return command.add_option("--init", arguments.init, what)->check(CLI::ExistingFile);
}

void AddCodec(CLI::App& group, ExitCode& exit_code) {
  const auto arguments = std::make_shared<TrainArguments>();
  CLI::App* command = group.add_subcommand("codec", "Train the latent codec on pictures and pose maps.");
  AddShared(*command, arguments);
  AddConfig(*command, arguments)->required();
  AddElsewhere(*command, arguments);
  AddInit(*command, *arguments, "a file with a codec (alone or in a whole model) to go on from; every key must fit");
  command->footer(
      "Examples:\n"
      "  evac train codec out/shards --config apps/configs/desk_model.yaml --training apps/configs/desk_training.yaml "
      "\\\n"
      "                   --minutes 8 --out out/codec\n"
      "  evac train codec mine/shards --config my_model.yaml --init evac.safetensors --steps 1000 --out out/codec\n"
      "Then: evac encode out/shards --config … --codec out/codec/codec.safetensors. More: docs/train.md");
  command->callback([arguments, &exit_code] { exit_code = RunCodec(*arguments); });
}

void AddForecast(CLI::App& group, ExitCode& exit_code) {
  const auto arguments = std::make_shared<TrainArguments>();
  CLI::App* command = group.add_subcommand("forecast", "Train what tells the world model where the thing will be.");
  AddShared(*command, arguments);
  AddConfig(*command, arguments)->required();
  command->footer(
      "Example:\n"
      "  evac train forecast out/shards --config my_model.yaml --training apps/configs/desk_training.yaml \\\n"
      "                   --out out/forecast\n"
      "The page of sizes has object_forecast: true. The world model is shown the end that came while it learns,\n"
      "and the likeliest later: evac train world … --forecast out/forecast/forecast.safetensors. More: docs/train.md");
  command->callback([arguments, &exit_code] { exit_code = RunForecast(*arguments); });
}

void AddWorld(CLI::App& group, ExitCode& exit_code) {
  const auto arguments = std::make_shared<TrainArguments>();
  CLI::App* command = group.add_subcommand("world", "Train the world model on encoded shards.");
  AddShared(*command, arguments);
  AddConfig(*command, arguments)->required();
  AddElsewhere(*command, arguments);
  command->add_option("--codec", arguments->codec, "the codec's weights, which encoded the shards")
      ->required()
      ->check(CLI::ExistingFile);
  command
      ->add_option("--forecast", arguments->forecast,
                   "of `evac train forecast`, where the sizes have one and --init has not; stays as it is")
      ->check(CLI::ExistingFile);
  CLI::Option* init = AddInit(*command, *arguments, "a checkpoint to go on from: fine-tuning; every key must fit");
  command
      ->add_option("--init-except", arguments->init_except,
                   "keys that begin so are drawn anew instead, with commas between them")
      ->delimiter(',')
      ->allow_extra_args(false)
      ->needs(init);
  command
      ->add_flag("--init-widen", arguments->init_widen,
                 "the checkpoint is of a model that was shown less: what is new counts nothing at first")
      ->needs(init);
  command->footer(
      "Examples:\n"
      "  evac train world out/shards --config apps/configs/desk_model.yaml --training apps/configs/desk_training.yaml "
      "\\\n"
      "                   --codec out/codec/codec.safetensors --minutes 40 --out out/world\n"
      "  evac train world mine/shards --config my_model.yaml --codec codec.safetensors --init evac.safetensors \\\n"
      "                   --init-except model.diffusion_model.input_blocks.0 --steps 2000 --out out/mine\n"
      "OUT: weights.safetensors, metrics.csv, holdout.csv, strips/ (truth above, imagined below). More: docs/train.md");
  command->callback([arguments, &exit_code] { exit_code = RunWorld(*arguments); });
}

}  // namespace

void AddTrain(CLI::App& app, ExitCode& exit_code) {
  CLI::App* group = app.add_subcommand(kTrainCommand.name, kTrainCommand.what);
  group->require_subcommand(1);
  AddCodec(*group, exit_code);
  AddForecast(*group, exit_code);
  AddWorld(*group, exit_code);
  AddTrainJudge(*group, exit_code);
  AddTrainPolicy(*group, exit_code);
}

}  // namespace evac
