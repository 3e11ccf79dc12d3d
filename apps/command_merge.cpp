#include <fmt/format.h>

#include <memory>

#include "apps/commands.h"
#include "harness/merge.h"

namespace evac {
namespace {

struct MergeArguments {
  std::string out;
  std::vector<std::string> shards;
};

ExitCode Merge(const MergeArguments& arguments) {
  const MergeSummary summary = MergeRuns({arguments.shards.begin(), arguments.shards.end()}, arguments.out);
  fmt::print("{}: {} episodes of {} runs; {} were in more than one and the same in all\n", arguments.out,
             summary.episodes, arguments.shards.size(), summary.duplicates);
  for (const std::string& note : summary.notes) fmt::print(stderr, "evac: note: {}\n", note);
  return ExitCode::kOk;
}

}  // namespace

void AddMerge(CLI::App& app, ExitCode& exit_code) {
  auto arguments = std::make_shared<MergeArguments>();
  CLI::App* command = app.add_subcommand("merge", "Join runs of one suite (shards) into a new run");
  command->add_option("shards", arguments->shards, "folders of the runs")->required();
  command->add_option("-o,--out", arguments->out, "the new run's folder")->required();
  command->footer(
      "Example:\n"
      "  evac run apps/configs/demo.yaml --out out/a --shard 1/2     # on one machine\n"
      "  evac run apps/configs/demo.yaml --out out/b --shard 2/2     # on another\n"
      "  evac merge out/a out/b --out out/demo\n"
      "Runs of different suites are refused, and so are episodes that two runs hold and that differ.");
  command->callback([arguments, &exit_code] { exit_code = Merge(*arguments); });
}

}  // namespace evac
