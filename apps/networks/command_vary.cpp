#include <memory>

#include "apps/commands.h"
#include "apps/network_parts.h"
#include "apps/networks/vary_shards.h"

namespace evac {

void AddVary(CLI::App& app, ExitCode& exit_code) {
  const auto arguments = std::make_shared<VaryArguments>();
  CLI::App* command = app.add_subcommand(kVaryCommand.name, kVaryCommand.what);
  command->add_option("SHARDS", arguments->shards, "a folder of `evac pack`")->required()->check(CLI::ExistingDirectory);
  command->add_option("COLLECTION", arguments->collection, "of `evac collect`, the one that was packed")->required()->check(CLI::ExistingDirectory);
  command->add_option("--recipe", arguments->recipe, "the page that the collection was made by")->required()->check(CLI::ExistingFile);
  command->add_option("--set", arguments->assignments, "path.to.field=VALUE: as the collection was made with; repeatable")->take_all()->expected(1)->allow_extra_args(false);
  command->add_option("--count", arguments->count, "variants of each clip")->check(CLI::Range(1, 1000))->capture_default_str();
  command->add_option("--seed", arguments->seed, "of the changes")->capture_default_str();
  command->add_option("--jobs", arguments->jobs, "clips at the same time; default: one per core")->check(CLI::Range(1, 256));
  command->footer(
      "Example:\n"
      "  evac vary out/shards out/desk --recipe apps/configs/desk_recipe.yaml --count 4\n"
      "What the arms were told is done again in each clip's scene, closing and opening a little elsewhere and at other\n"
      "times; nothing is drawn. `evac train forecast` reads what came of it (docs/train.md).");
  command->callback([arguments, &exit_code] {
    VaryShards(*arguments);
    exit_code = ExitCode::kOk;
  });
}

}  // namespace evac
