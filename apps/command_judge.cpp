#include <fmt/format.h>

#include <memory>
#include <utility>

#include "apps/commands.h"
#include "apps/interrupts.h"
#include "apps/judge_with_progress.h"
#include "apps/judge_with_vlm.h"
#include "apps/network_parts.h"
#include "judges/oracle_judge.h"

namespace evac {

// Subcommands of this one: command_calibrate.cpp, command_balance.cpp.
void AddCalibrate(CLI::App& judge, ExitCode& exit_code);
void AddBalance(CLI::App& judge, ExitCode& exit_code);

namespace {

struct JudgeArguments {
  std::string run;
  std::string judge = "oracle";
  std::string weights;
  bool again = false;
  VlmJudgeArguments vlm{};
};

/// An option that does nothing is a slip: who asks what a judgement would cost wants none given.
void RefuseWhatMeansNothing(const JudgeArguments& arguments) {
  const VlmJudgeArguments& vlm = arguments.vlm;
  if (arguments.judge == "vlm") {
    if (!arguments.weights.empty())
      throw InvalidInput("--weights: a model server has its own, wanted --judge classifier");
    if (vlm.dry_run && vlm.offline)
      throw InvalidInput("--offline: asks no server, which costs nothing: wanted it without --dry-run");
    return;
  }
  const std::pair<const char*, bool> given[] = {{"--config", !vlm.config.empty()},
                                                {"--dry-run", vlm.dry_run},
                                                {"--offline", vlm.offline},
                                                {"--retest", vlm.retest}};
  for (const auto& [option, is_given] : given) {
    if (is_given)
      throw InvalidInput("{}: is of a vision-language model alone; found --judge {}, wanted --judge vlm", option,
                         arguments.judge);
  }
}

ExitCode RateWithVlm(const JudgeArguments& arguments) {
  VlmJudgeArguments vlm = arguments.vlm;
  if (vlm.config.empty()) throw InvalidInput("--judge vlm: wanted --config PAGE.yaml as well (docs/vlm_judge.md)");
  vlm.run = arguments.run;
  vlm.again = arguments.again;
  return JudgeWithVlm(vlm);
}

std::unique_ptr<Judge> MakeJudge(const JudgeArguments& arguments, const Store& store) {
  if (arguments.judge == "oracle" && !arguments.weights.empty())
    throw InvalidInput("--weights: the oracle has none, wanted --judge classifier");
  if (arguments.judge == "oracle") return std::make_unique<OracleJudge>(store);
  if (arguments.judge != "classifier")
    throw InvalidInput("--judge: found '{}', wanted oracle, classifier or vlm", arguments.judge);
  if (arguments.weights.empty())
    throw InvalidInput("--judge classifier: wanted --weights, a file of `evac judge train` or `evac train judge`");
  return MakeClassifier(arguments.weights, store);
}

ExitCode Rate(const JudgeArguments& arguments) {
  if (arguments.run.empty()) throw InvalidInput("wanted the run's folder: evac judge RUN --judge NAME");
  RefuseWhatMeansNothing(arguments);
  if (arguments.judge == "vlm") return RateWithVlm(arguments);
  if (arguments.judge == "classifier") NeedNetworks();
  Store store = Store::Open(arguments.run, Store::Mode::kReadWrite);
  const std::unique_ptr<Judge> judge = MakeJudge(arguments, store);
  const CatchInterrupts catch_interrupts;
  fmt::print("{}: {}\n", judge->Name(), Sentence(JudgeWithProgress(*judge, store, {.again = arguments.again})));
  return ExitCode::kOk;
}

void AddVlmOptions(CLI::App& command, VlmJudgeArguments& vlm) {
  command.add_option("--config", vlm.config, "vlm: the model server's page (docs/vlm_judge.md)");
  command.add_flag("--dry-run", vlm.dry_run, "vlm: say how many requests and tokens it would take, and ask nothing");
  command.add_flag("--offline", vlm.offline, "vlm: answers of earlier calls alone; no network");
  command.add_flag("--retest", vlm.retest, "vlm: ask a share of the episodes twice, to see whether answers repeat");
}

}  // namespace

void AddJudge(CLI::App& app, ExitCode& exit_code) {
  auto arguments = std::make_shared<JudgeArguments>();
  CLI::App* command = app.add_subcommand("judge", "Say of every episode of a run whether it succeeded");
  command->add_option("run", arguments->run, "the run's folder");
  command
      ->add_option(
          "--judge", arguments->judge,
          "oracle: the task's rubric against the physics of the world; classifier: a network that sees the clip alone; "
          "vlm: a vision-language model that looks at the clip")
      ->capture_default_str();
  command->add_option("--weights", arguments->weights, "of the classifier (docs/classifier_judge.md)");
  command->add_flag("--again", arguments->again,
                    "rate also what this judge has rated; every verdict is kept, the last one counts");
  command->footer(
      "Examples:\n  evac judge out/demo --judge oracle\n  evac judge out/demo --judge oracle --again\n"
      "  evac judge out/demo --judge classifier --weights out/judge/judge.safetensors\n"
      "  evac judge out/demo --judge vlm --config qwen.yaml --dry-run\n"
      "  evac judge calibrate out/demo --judge vlm:qwen-1a2b3c4d");
  AddVlmOptions(*command, arguments->vlm);
  AddCalibrate(*command, exit_code);
  AddBalance(*command, exit_code);
  AddJudgeTrain(*command, exit_code);
  RefuseOptionsBeforeSubcommands(*command);
  command->callback([command, arguments, &exit_code] {
    if (command->get_subcommands().empty()) exit_code = Rate(*arguments);
  });
}

}  // namespace evac
