#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <memory>

#include "apps/commands.h"
#include "apps/factory.h"
#include "apps/network_parts.h"
#include "apps/recorded_suite.h"
#include "core/error.h"
#include "harness/scheduler.h"
#include "harness/suite_hash.h"

namespace evac {
namespace {

struct ValidateArguments {
  std::string suite;
  std::vector<std::string> assignments;
};

/// Everything that can be known to be wrong before the first episode, short of starting the policies.
ExitCode Validate(const ValidateArguments& arguments) {
  Suite suite = ReadSuite(arguments.suite, arguments.assignments);
  NeedNetworksFor(suite);
  FillInRecordedTask(suite);
  CheckRubrics(suite);
  int episodes = 0;
  for (const SuiteWorld& world : suite.worlds) {
    if (world.evac) CheckNetwork(world, suite.tasks);
    const std::unique_ptr<World> built = MakeWorld(world, suite, nullptr);
    const bool needs_real_run = world.type == "evac" && !suite.recording;
    for (const Task& task : suite.tasks) {
      if (!needs_real_run) CheckStart(*built, task, suite.initial_states.front());
    }
    for (const SuitePolicy& policy : suite.policies) {
      if (!policy.command.empty()) CommandLine(policy, suite);
      episodes += static_cast<int>(AllJobs(suite, world, policy).size());
    }
  }
  const bool all_states = std::ranges::all_of(suite.worlds, [](const SuiteWorld& world) { return world.initial_states == 0; });
  fmt::print("{}: valid. {} worlds x {} tasks x {} policies x {}{} initial states x {} seeds = {} episodes. Suite hash {}\n", arguments.suite,
             suite.worlds.size(), suite.tasks.size(), suite.policies.size(), all_states ? "" : "up to ", suite.initial_states.size(), suite.seeds.size(), episodes, suite.hash);
  for (const SuitePolicy& policy : suite.policies) {
    if (const std::vector<std::string> files = FilesInNoHash(suite, policy); !files.empty())
      fmt::print("note: {}@{} is given {}, whose content is in no hash: list under its `files` what decides its actions\n",
                 policy.name, policy.checkpoint, fmt::join(files, ", "));
  }
  return ExitCode::kOk;
}

}  // namespace

void AddValidate(CLI::App& app, ExitCode& exit_code) {
  auto arguments = std::make_shared<ValidateArguments>();
  CLI::App* command = app.add_subcommand("validate", "Check a suite and everything it names, without running it");
  command->add_option("suite", arguments->suite, "the suite's YAML file (docs/suite.md)")->required();
  command->add_option("--set", arguments->assignments, "override a field: path.to.field=VALUE (repeatable)")->expected(1)->take_all()->allow_extra_args(false);
  command->footer("Example:\n  evac validate apps/configs/demo.yaml --set initial_states.count=5");
  command->callback([arguments, &exit_code] { exit_code = Validate(*arguments); });
}

}  // namespace evac
