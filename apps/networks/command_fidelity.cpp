#include <memory>

#include "apps/commands.h"
#include "apps/network_parts.h"
#include "apps/networks/fidelity.h"

namespace evac {

void AddFidelity(CLI::App& app, ExitCode& exit_code) {
  auto arguments = std::make_shared<FidelityArguments>();
  CLI::App* command = app.add_subcommand(kFidelityCommand.name, kFidelityCommand.what);
  command->add_option("suite", arguments->suite, "a suite with a real world, the same once more, and a world model (docs/fidelity.md)")->required();
  command->add_option("-o,--out", arguments->out, "the folder to write; one that is there is gone on with")->required();
  command->add_option("--set", arguments->assignments, "override a field: path.to.field=VALUE (repeatable)")->expected(1)->take_all()->allow_extra_args(false);
  command->add_option("--parts", arguments->parts, "beside the closed loop, which is always run: open, executed, counterfactual, horizon")
      ->delimiter(',')->allow_extra_args(false)->capture_default_str();
  command->add_option("--classifier", arguments->classifier, "weights of the judge of imagined clips (docs/classifier_judge.md)");
  command->add_option("--reality", arguments->reality, "an earlier OUT of the same suite, but for its world model, policies and how many initial states: its episodes that would come out the same are taken over")
      ->check(CLI::ExistingDirectory);
  command->add_option("--counterfactual-states", arguments->counterfactual_states, "successes per task that are made to fail")
      ->check(CLI::Range(1, 100000))->capture_default_str();
  command->add_option("--horizon-states", arguments->horizon_states, "long rollouts per task")->check(CLI::Range(1, 100000))->capture_default_str();
  command->add_option("--horizon-chunks", arguments->horizon_chunks, "their length in chunks of the network")
      ->check(CLI::Range(1, 1000))->capture_default_str();
  command->footer("Example:\n"
                  "  evac fidelity apps/configs/fidelity.yaml --classifier judge.safetensors --out out/fidelity \\\n"
                  "                --set initial_states.seed=9 --set initial_states.count=40\n"
                  "OUT holds index.html, fidelity.json, episodes.csv, and a run per part; the same command goes on where it was killed.");
  command->callback([arguments, &exit_code] { exit_code = RunFidelity(*arguments); });
}

}  // namespace evac
