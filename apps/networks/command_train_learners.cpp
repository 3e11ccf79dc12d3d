#include <fmt/format.h>

#include <charconv>
#include <memory>
#include <optional>

#include "apps/commands.h"
#include "apps/interrupts.h"
#include "apps/network_parts.h"
#include "apps/networks/judge_run_clips.h"
#include "apps/networks/judge_shard_clips.h"
#include "apps/networks/run_training.h"
#include "apps/networks/train_judge.h"
#include "apps/networks/train_policy.h"
#include "apps/number_range.h"
#include "worldmodel/nn/memory.h"

/// evac train judge, evac train policy: the small networks beside the world model.
namespace evac {
namespace {

const TrainingKind kJudge{"judge", "judge.safetensors", true}, kPolicy{"policy", "policy.safetensors", true};

std::optional<ShardCodec> CodecOf(const TrainArguments& arguments, const train::JobPlace& place) {
  if (arguments.codec.empty()) return std::nullopt;
  return std::optional<ShardCodec>(std::in_place, arguments.codec, place.config.vae);
}

/// Adds --codec, and --config with it. @param whose  pictures are shown
void AddCodec(CLI::App& command, const std::shared_ptr<TrainArguments>& arguments, const std::string& whose) {
  CLI::Option* codec = command.add_option("--codec", arguments->codec,
                                          "half of the " + whose +
                                              " are shown as this codec, which encoded the shards, "
                                              "gives them back: how a world model would draw them");
  codec->check(CLI::ExistingFile)->needs(AddConfig(command, arguments));
}

/// Clips of the shards, for a judge that is trained or calibrated.
struct ShardJudgeData {
  ShardJudgeData(const TrainArguments& arguments, const train::JobPlace& place)
      : codec(CodecOf(arguments, place)),
        learn(place.shards, train::Split::kTrain, codec ? &*codec : nullptr),
        holdout(train::EachOnce(place.shards), train::Split::kHoldout, codec ? &*codec : nullptr),
        data{learn, holdout, arguments.init} {}

  std::optional<ShardCodec> codec;
  ShardClips learn, holdout;
  JudgeData data;
};

/// Its judge would be replaced, and be back uncalibrated when the training goes on.
void RefuseFolderOfATraining(const std::filesystem::path& out) {
  if (std::filesystem::exists(out / "training.safetensors"))
    throw InvalidInput(
        "--out: {} holds a training, whose judge would be replaced: wanted another folder with --calibrate-only",
        out.string());
}

ExitCode CalibrateOnly(const TrainArguments& arguments) {
  JudgeTrainingOptions options;
  ReadTrainingPage(arguments.training, "judge", arguments.settings, SettingsOf(options));
  TrainingProgress progress(stderr);
  const train::JobPlace place = PlaceOf(arguments, progress);
  CheckHoldouts(place.shards);
  const HeldFolder folder(arguments.out);
  RefuseFolderOfATraining(arguments.out);
  nn::KeepFreedMemory();
  SayingWhere(arguments, "judge", [&] { CalibrateJudge(place, options, ShardJudgeData(arguments, place).data); });
  fmt::print("{}: calibrated anew\n", (place.out / "judge.safetensors").string());
  return ExitCode::kOk;
}

ExitCode RunJudge(const TrainArguments& arguments) {
  if (arguments.calibrate_only) return CalibrateOnly(arguments);
  return RunTraining<JudgeTrainingOptions>(
      arguments, kJudge, [&](const train::JobPlace& place, const JudgeTrainingOptions& options) {
        return TrainJudge(place, options, ShardJudgeData(arguments, place).data);
      });
}

struct LabelledArguments {
  LabelledRuns runs;
  TrainArguments training;
};

ExitCode RunJudgeFromLabels(const LabelledArguments& arguments) {
  const auto run = [&](const train::JobPlace& place, JudgeTrainingOptions options) {
    options.longest = 1;  // runs' clips are as long as those it will judge
    LabelledRuns runs = arguments.runs;
    runs.seed = options.job.trainer.seed;
    const LabelledClips clips = ReadLabelledClips(runs, place.say);
    return TrainJudge(place, options, {*clips.learn, *clips.holdout});
  };
  return RunTraining<JudgeTrainingOptions>(arguments.training, kJudge, run);
}

/// What is wrong with the side of a picture, or nothing.
std::string ComplaintOfSide(const std::string& text) {
  int side_px = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), side_px);
  const bool is_whole = error == std::errc() && end == text.data() + text.size();
  return is_whole && side_px % 8 == 0 ? "" : "found " + text + ", wanted a multiple of 8";
}

ExitCode RunPolicy(const TrainArguments& arguments) {
  return RunTraining<PolicyOptions>(
      arguments, kPolicy, [&](const train::JobPlace& place, const PolicyOptions& options) {
        const std::optional<ShardCodec> codec = CodecOf(arguments, place);
        return TrainPolicy(place, options, codec ? &*codec : nullptr, arguments.keep_steps);
      });
}

}  // namespace

void AddTrainJudge(CLI::App& group, ExitCode& exit_code) {
  const auto arguments = std::make_shared<TrainArguments>();
  CLI::App* command = group.add_subcommand("judge", "Train the classifier judge on clips with a known outcome.");
  AddShared(*command, arguments);
  AddCodec(*command, arguments, "clips");
  CLI::Option* init = command->add_option("--init", arguments->init, "a judge of the same tasks and cameras to go on from");
  init->check(CLI::ExistingFile);
  command
      ->add_flag("--calibrate-only", arguments->calibrate_only,
                 "nothing is learned: temperature and threshold of --init are chosen anew on these shards")
      ->needs(init)
      ->excludes("--steps", "--minutes");
  command->footer(
      "Example:\n"
      "  evac train judge out/shards --training apps/configs/desk_training.yaml --config apps/configs/desk_model.yaml "
      "\\\n"
      "                   --codec out/codec/codec.safetensors --out out/judge\n"
      "OUT: judge.safetensors with its card, metrics.csv, holdout.csv, judged.csv, thresholds.csv (docs/classifier_judge.md)");
  command->callback([arguments, &exit_code] { exit_code = RunJudge(*arguments); });
}

void AddJudgeTrain(CLI::App& judge, ExitCode& exit_code) {
  const auto arguments = std::make_shared<LabelledArguments>();
  LabelledRuns& runs = arguments->runs;
  CLI::App* command = judge.add_subcommand(kJudgeTrainCommand.name, kJudgeTrainCommand.what);
  command->add_option("RUNS", runs.runs, "folders of runs; their clips are what it learns from")
      ->required()
      ->check(CLI::ExistingDirectory);
  command->add_option("--truth", runs.truth, "whose verdicts: a judge's name, human say (evac ls shows them)")
      ->capture_default_str();
  command->add_option("--worlds", runs.worlds, "clips of these worlds alone, with commas between them")
      ->delimiter(',')
      ->allow_extra_args(false);
  command->add_option("--holdout", runs.holdout, "share of initial states that are kept apart to measure with")
      ->check(Within(0.05, 0.9))
      ->capture_default_str();
  command->add_option("--least", runs.least, "labels of each kind that a task must have")
      ->check(CLI::Range(1, 1000000))
      ->capture_default_str();
  const auto side = CLI::Range(8, 1024) & CLI::Validator(ComplaintOfSide, "multiple of 8");
  command->add_option("--height-px", runs.height_px, "of a picture as the judge sees it")
      ->check(side)
      ->capture_default_str();
  command->add_option("--width-px", runs.width_px, "likewise")->check(side)->capture_default_str();
  AddTraining(*command, std::shared_ptr<TrainArguments>(arguments, &arguments->training));
  command->footer(
      "Example:\n"
      "  evac judge train out/mine --truth human --training apps/configs/desk_training.yaml --out out/judge\n"
      "  evac judge out/next --judge classifier --weights out/judge/judge.safetensors\n"
      "It does not judge clips that it learned from. OUT: judge.safetensors with its card, metrics.csv, holdout.csv,\n"
      "judged.csv, thresholds.csv, curves.svg (docs/classifier_judge.md)");
  command->callback([arguments, &exit_code] { exit_code = RunJudgeFromLabels(*arguments); });
}

void AddTrainPolicy(CLI::App& group, ExitCode& exit_code) {
  const auto arguments = std::make_shared<TrainArguments>();
  CLI::App* command = group.add_subcommand("policy", "Train a policy to imitate recordings that succeeded.");
  AddShared(*command, arguments);
  AddCodec(*command, arguments, "moments");
  command
      ->add_option("--keep-steps", arguments->keep_steps,
                   "steps after which a checkpoint is kept beside the last, with commas between them")
      ->delimiter(',')
      ->allow_extra_args(false);
  command->footer(
      "Example:\n"
      "  evac train policy out/shards --training apps/configs/desk_training.yaml --config apps/configs/desk_model.yaml "
      "\\\n"
      "                    --codec out/codec/codec.safetensors --keep-steps 500,1000,2000 --out out/policy\n"
      "OUT: policy.safetensors and policy_<step>.safetensors, each with its card (docs/learned_policy.md)\n"
      "Then: evac-policy learned --checkpoint out/policy/policy.safetensors");
  command->callback([arguments, &exit_code] { exit_code = RunPolicy(*arguments); });
}

}  // namespace evac
