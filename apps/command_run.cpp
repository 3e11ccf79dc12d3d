#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <memory>

#include "apps/commands.h"
#include "apps/evaluate.h"
#include "apps/factory.h"
#include "apps/for_shell.h"
#include "apps/network_parts.h"
#include "apps/recorded_suite.h"
#include "core/version.h"

namespace evac {
namespace {

namespace fs = std::filesystem;

RunInfo InfoOf(const Suite& suite) {
  return {.suite_text = suite.text, .suite_hash = suite.hash, .suite_path = fs::absolute(suite.path).lexically_normal().string(), .evac_version = EVAC_VERSION};
}

struct RunArguments {
  std::string suite, out;
  std::vector<std::string> assignments;
  bool retry_failed = false;
  std::string shard = "1/1";
};

struct ResumeArguments {
  std::string run;
  bool retry_failed = false;
  int lanes = 0;
  std::string shard = "1/1";
};

/// "2/4": the second of four.
Shard ShardNamed(const std::string& text) {
  Shard shard;
  const std::size_t slash = std::min(text.find('/'), text.size());
  const auto reads = [&](std::size_t from, std::size_t to, int& number) {
    const auto [end, error] = std::from_chars(text.data() + std::min(from, to), text.data() + to, number);
    return error == std::errc() && end == text.data() + to;
  };
  const bool is_read = reads(0, slash, shard.number) && reads(slash + 1, text.size(), shard.of);
  if (is_read && shard.number >= 1 && shard.number <= shard.of) return shard;
  throw InvalidInput("--shard: found '{}', wanted which of how many, such as 2/4", text);
}

std::string ResumeCommand(const std::string& run) { return "evac resume " + ForShell(run); }

/// What goes on with the run as it goes now. `evac resume` goes by the suite as the run began with it: a deadline that was
/// changed since, which the hash leaves out, would be the old one again, and what the suite names would be looked for
/// where it lay.
std::string CommandAgain(const RunArguments& arguments, const Suite& suite, const Store& store) {
  const RunInfo began = store.run(), now = InfoOf(suite);
  if (began.suite_text == now.suite_text && began.suite_path == now.suite_path) return ResumeCommand(arguments.out);
  std::string command = fmt::format("evac run {} --out {}", ForShell(arguments.suite), ForShell(arguments.out));
  for (const std::string& assignment : arguments.assignments) command += " --set " + ForShell(assignment);
  return command;
}

ExitCode Run(const RunArguments& arguments) {
  Suite suite = ReadSuite(arguments.suite, arguments.assignments);
  const Shard shard = ShardNamed(arguments.shard);
  NeedNetworksFor(suite);
  Store store = Store::CreateOrContinue(arguments.out, InfoOf(suite));
  FillInRecordedTask(suite);
  return Evaluate(suite, store,
                  {.shard = shard, .retry_failed = arguments.retry_failed, .go_on = CommandAgain(arguments, suite, store)});
}

/// @throws InvalidInput where lanes would measure each other, as in a suite that says so many.
void TakeLanes(int lanes, Suite& suite) {
  if (lanes > 1 && suite.latency.kind == PolicyLatency::Kind::kMeasured)
    throw InvalidInput("--lanes: found {}, wanted 1 with the suite's `policy.latency: measured`: else one episode's thinking is "
                       "another's waiting, and is measured too", lanes);
  if (lanes > 0) suite.lanes = lanes;
}

ExitCode Resume(const ResumeArguments& arguments) {
  const Shard shard = ShardNamed(arguments.shard);
  const RunInfo info = Store::Open(arguments.run, Store::Mode::kReadOnly).run();
  Suite suite = ParseSuite(info.suite_text, info.suite_path);
  if (suite.hash != info.suite_hash) {
    throw InvalidInput("{}: a file that the suite {} names has changed since the run began (suite hash {:.12}…, was {:.12}…); "
                       "start a new run with `evac run`", arguments.run, info.suite_path, suite.hash, info.suite_hash);
  }
  TakeLanes(arguments.lanes, suite);
  NeedNetworksFor(suite);
  Store store = Store::CreateOrContinue(arguments.run, info);
  FillInRecordedTask(suite);
  const std::string go_on = ResumeCommand(arguments.run) + (arguments.lanes > 0 ? fmt::format(" --lanes {}", arguments.lanes) : "");
  return Evaluate(suite, store, {.shard = shard, .retry_failed = arguments.retry_failed, .go_on = go_on});
}

}  // namespace

void AddRun(CLI::App& app, ExitCode& exit_code) {
  auto arguments = std::make_shared<RunArguments>();
  CLI::App* command = app.add_subcommand("run", "Evaluate the policies of a suite in its worlds");
  command->add_option("suite", arguments->suite, "the suite's YAML file (docs/suite.md)")->required();
  command->add_option("-o,--out", arguments->out, "the run's folder; one that is there is continued")->required();
  command->add_option("--set", arguments->assignments, "override a field: path.to.field=VALUE (repeatable)")->expected(1)->take_all()->allow_extra_args(false);
  command->add_flag("--retry-failed", arguments->retry_failed, "run the failed episodes of a run that is there again");
  command->add_option("--shard", arguments->shard, "run only part I of N of the episodes: I/N (join the parts with evac merge)");
  command->footer("Examples:\n"
                  "  evac run apps/configs/demo.yaml --out out/demo\n"
                  "  evac run apps/configs/demo.yaml --out out/unseen --set initial_states.seed=9 --set initial_states.count=40\n"
                  "  evac run apps/configs/agibot_replay.yaml --out out/replay --set recording=path/to/recording\n"
                  "Into a run that is there already with the same suite it goes on where it was.");
  command->callback([arguments, &exit_code] { exit_code = Run(*arguments); });
}

void AddResume(CLI::App& app, ExitCode& exit_code) {
  auto arguments = std::make_shared<ResumeArguments>();
  CLI::App* command = app.add_subcommand("resume", "Go on with a run that was interrupted");
  command->add_option("run", arguments->run, "the run's folder")->required();
  command->add_flag("--retry-failed", arguments->retry_failed, "run the failed episodes again");
  command->add_option("--lanes", arguments->lanes, "episodes that advance together (changes no result)")->check(CLI::Range(1, 256));
  command->add_option("--shard", arguments->shard, "run only part I of N of the episodes: I/N (join the parts with evac merge)");
  command->footer("Example:\n  evac resume out/demo --retry-failed");
  command->callback([arguments, &exit_code] { exit_code = Resume(*arguments); });
}

}  // namespace evac
