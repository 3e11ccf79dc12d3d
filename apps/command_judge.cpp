#include <fmt/format.h>

#include <memory>

#include "apps/commands.h"
#include "judges/judge_episodes.h"
#include "judges/oracle_judge.h"

namespace evac {
namespace {

struct JudgeArguments {
  std::string run;
  std::string judge = "oracle";
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

ExitCode Rate(const JudgeArguments& arguments) {
  if (arguments.judge != "oracle") throw InvalidInput("--judge: found '{}', wanted oracle", arguments.judge);
  Store store = Store::Open(arguments.run, Store::Mode::kReadWrite);
  OracleJudge oracle(store);
  fmt::print("{}: {}\n", oracle.Name(), Sentence(JudgeEpisodes(oracle, store, {.again = arguments.again})));
  return ExitCode::kOk;
}

}  // namespace

void AddJudge(CLI::App& app, ExitCode& exit_code) {
  auto arguments = std::make_shared<JudgeArguments>();
  CLI::App* command = app.add_subcommand("judge", "Say of every episode of a run whether it succeeded");
  command->add_option("run", arguments->run, "the run's folder")->required();
  command->add_option("--judge", arguments->judge, "oracle: the task's rubric against the physics of the world")
      ->capture_default_str();
  command->add_flag("--again", arguments->again,
                    "rate also what this judge has rated; every verdict is kept, the last one counts");
  command->footer("Examples:\n  evac judge out/demo --judge oracle\n  evac judge out/demo --judge oracle --again");
  command->callback([arguments, &exit_code] { exit_code = Rate(*arguments); });
}

}  // namespace evac
