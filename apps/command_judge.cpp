#include <fmt/format.h>

#include <memory>

#include "apps/commands.h"
#include "judges/classifier_judge.h"
#include "judges/judge_episodes.h"
#include "judges/oracle_judge.h"

namespace evac {
namespace {

struct JudgeArguments {
  std::string run;
  std::string judge = "oracle";
  std::string weights;
  bool again = false;
};

/// "60 rated (42 success, 18 failure), 0 had a verdict, 1 failed and is not judged"
std::string Sentence(const JudgeSummary& summary) {
  std::string labels;
  for (const auto& [label, count] : summary.labels)
    labels += fmt::format("{}{} {}", labels.empty() ? "" : ", ", count, Name(label));
  return fmt::format("{} rated{}, {} had a verdict already, {} failed episodes are not judged", summary.rated,
                     labels.empty() ? "" : " (" + labels + ")", summary.already, summary.failed);
}

std::unique_ptr<Judge> MakeJudge(const JudgeArguments& arguments, const Store& store) {
  if (arguments.judge == "oracle" && !arguments.weights.empty())
    throw InvalidInput("--weights: the oracle has none, wanted --judge classifier");
  if (arguments.judge == "oracle") return std::make_unique<OracleJudge>(store);
  if (arguments.judge != "classifier") throw InvalidInput("--judge: found '{}', wanted oracle or classifier", arguments.judge);
  if (arguments.weights.empty()) throw InvalidInput("--judge classifier: wanted --weights, a file of `evac train judge`");
  auto judge = std::make_unique<ClassifierJudge>(arguments.weights, store.folder());
  judge->CheckKnows(store.Tasks());
  return judge;
}

ExitCode Rate(const JudgeArguments& arguments) {
  Store store = Store::Open(arguments.run, Store::Mode::kReadWrite);
  const std::unique_ptr<Judge> judge = MakeJudge(arguments, store);
  fmt::print("{}: {}\n", judge->Name(), Sentence(JudgeEpisodes(*judge, store, {.again = arguments.again})));
  return ExitCode::kOk;
}

}  // namespace

void AddJudge(CLI::App& app, ExitCode& exit_code) {
  auto arguments = std::make_shared<JudgeArguments>();
  CLI::App* command = app.add_subcommand("judge", "Say of every episode of a run whether it succeeded");
  command->add_option("run", arguments->run, "the run's folder")->required();
  command->add_option("--judge", arguments->judge, "oracle: the task's rubric against the physics of the world; classifier: a network that sees the clip alone")
      ->capture_default_str();
  command->add_option("--weights", arguments->weights, "of the classifier (docs/classifier_judge.md)");
  command->add_flag("--again", arguments->again,
                    "rate also what this judge has rated; every verdict is kept, the last one counts");
  command->footer("Examples:\n  evac judge out/demo --judge oracle\n  evac judge out/demo --judge oracle --again\n"
                  "  evac judge out/demo --judge classifier --weights out/judge/judge.safetensors");
  command->callback([arguments, &exit_code] { exit_code = Rate(*arguments); });
}

}  // namespace evac
