#include <memory>

#include "apps/collect.h"
#include "apps/collect_recipe.h"
#include "apps/commands.h"

namespace evac {

void AddCollect(CLI::App& app, ExitCode& exit_code) {
  CLI::App* command = app.add_subcommand("collect", "Makes recordings of many policies at work in MuJoCo, in AgiBot World's layout.");
  auto arguments = std::make_shared<CollectArguments>();
  command->add_option("recipe", arguments->recipe, "what is collected: one YAML page (docs/collect.md)")->required();
  command->add_option("-o,--out", arguments->out, "the folder to write; one that holds part of it is gone on with")->required();
  command->add_option("--episodes", arguments->episodes, "how many; default: as the recipe says")->check(CLI::Range(1, kMostEpisodes));
  command->add_option("--seed", arguments->seed, "of initial states, behaviours and noise")->capture_default_str();
  command->add_option("--jobs", arguments->jobs, "episodes at the same time; default: one per core")->check(CLI::Range(1, 256));
  command->add_option("--set", arguments->assignments, "path.to.field=VALUE: overrides a field of the recipe; repeatable")->take_all()->expected(1)->allow_extra_args(false);
  command->footer("Example:\n  evac collect apps/configs/desk_recipe.yaml --out out/desk --episodes 100");
  command->callback([&exit_code, arguments] {
    Collect(*arguments);
    exit_code = ExitCode::kOk;
  });
}

}  // namespace evac
