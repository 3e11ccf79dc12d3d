#include <memory>
#include <optional>

#include "apps/commands.h"
#include "apps/interrupts.h"
#include "apps/train_arguments.h"
#include "apps/train_judge.h"
#include "apps/train_policy.h"
#include "apps/training_page.h"
#include "worldmodel/nn/memory.h"
#include "worldmodel/nn/threads.h"

/// evac train judge, evac train policy: the small networks beside the world model.
namespace evac {
namespace {

/// What both commands do around their training. @param section  of the training page
/// @param train  (place, options) → the summary
template <class Options, class Train>
ExitCode RunLearner(const TrainArguments& arguments, const std::string& section, const Train& train) {
  Options options;
  ReadTrainingPage(arguments.training, section, arguments.settings, SettingsOf(options));
  Override(arguments, options.job.trainer);
  const CatchInterrupts catch_interrupts;
  TrainingProgress progress(stderr);
  const train::JobPlace place = PlaceOf(arguments, progress);
  nn::KeepFreedMemory();
  const nn::LibraryThreads threads(1);
  return End(train(place, options), arguments.out, (section + ".safetensors").c_str());
}

ExitCode RunJudge(const TrainArguments& arguments) {
  return RunLearner<JudgeOptions>(arguments, "judge", [&](const train::JobPlace& place, const JudgeOptions& options) {
    if (arguments.codec.empty()) return TrainJudge(place, options);
    const JudgeCodec codec(arguments.codec, place.config.vae);
    return TrainJudge(place, options, &codec);
  });
}

ExitCode RunPolicy(const TrainArguments& arguments) {
  return RunLearner<PolicyOptions>(arguments, "policy",
                                   [&](const train::JobPlace& place, const PolicyOptions& options) {
                                     return TrainPolicy(place, options, arguments.keep_steps);
                                   });
}

}  // namespace

void AddTrainJudge(CLI::App& group, ExitCode& exit_code) {
  const auto arguments = std::make_shared<TrainArguments>();
  CLI::App* command = group.add_subcommand("judge", "Train the classifier judge on clips with a known outcome.");
  AddShared(*command, arguments);
  CLI::Option* codec = command->add_option("--codec", arguments->codec,
                                           "half of the clips are shown as this codec, which encoded the shards, gives "
                                           "them back: how a world model's clips look");
  codec->check(CLI::ExistingFile)->needs(AddConfig(*command, arguments));
  command->footer(
      "Example:\n"
      "  evac train judge out/shards --training apps/configs/desk_training.yaml --config apps/configs/desk_model.yaml \\\n"
      "                   --codec out/codec/codec.safetensors --out out/judge\n"
      "OUT: judge.safetensors with its card (docs/classifier_judge.md), metrics.csv, holdout.csv");
  command->callback([arguments, &exit_code] { exit_code = RunJudge(*arguments); });
}

void AddTrainPolicy(CLI::App& group, ExitCode& exit_code) {
  const auto arguments = std::make_shared<TrainArguments>();
  CLI::App* command = group.add_subcommand("policy", "Train a policy to imitate recordings that succeeded.");
  AddShared(*command, arguments);
  command
      ->add_option("--keep-steps", arguments->keep_steps,
                   "steps after which a checkpoint is kept beside the last, with commas between them")
      ->delimiter(',');
  command->footer(
      "Example:\n"
      "  evac train policy out/shards --training apps/configs/desk_training.yaml --keep-steps 500,1000,2000 --out out/policy\n"
      "OUT: policy.safetensors and policy_<step>.safetensors, each with its card (docs/learned_policy.md)\n"
      "Then: evac-policy learned --checkpoint out/policy/policy.safetensors");
  command->callback([arguments, &exit_code] { exit_code = RunPolicy(*arguments); });
}

}  // namespace evac
