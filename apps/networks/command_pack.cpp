#include <map>
#include <memory>

#include "apps/commands.h"
#include "apps/network_parts.h"
#include "apps/networks/pack.h"
#include "apps/number_range.h"

namespace evac {

void AddPack(CLI::App& app, ExitCode& exit_code) {
  static const std::map<std::string, ArmsKind> kKinds = {
      {"auto", ArmsKind::kAuto}, {"told", ArmsKind::kTold}, {"measured", ArmsKind::kMeasured}};
  CLI::App* command = app.add_subcommand(kPackCommand.name, kPackCommand.what);
  auto arguments = std::make_shared<PackArguments>();
  command->add_option("recordings", arguments->inputs, "folders: a collection, an AgiBot World tree, recordings (docs/formats/recording.md)")->required();
  command->add_option("-o,--out", arguments->out, "the folder to write; one that holds part of it is gone on with")->required();
  command->add_option("--config", arguments->config, "the network's page: picture size, views, chunk")->required();
  command->add_option("--statistics", arguments->statistics, "the actions' means and deviations that weights were trained with, to train those on; default: of these recordings");
  command->add_option("--cameras", arguments->cameras, "the views, with commas between them; default: as many as the network has, head first")->delimiter(',')->allow_extra_args(false);
  command->add_option("--arms", arguments->arms, "actions are where the arms were told to be, or measured; default: told in a collection, else measured")->transform(CLI::CheckedTransformer(kKinds))->option_text("TEXT:{auto,told,measured}");
  command->add_option("--period-s", arguments->period_s, "between two frames of a clip; every nth recorded step is kept")->check(Within(0.001, 10.0))->capture_default_str();
  command->add_option("--crops", arguments->crops, "clips per recording: the whole picture, then random crops")->check(CLI::Range(1, 1000))->capture_default_str();
  command->add_option("--holdout", arguments->hold_out, "share of the initial states that is kept from training")->check(Within(0.0, 0.9))->capture_default_str();
  command->add_option("--clips-per-shard", arguments->clips_per_shard, "at most")->check(CLI::Range(1, 4096))->capture_default_str();
  command->add_option("--shard-mb", arguments->shard_mb, "pictures and maps per shard, at most; each shard that is being made lies in memory")->check(Within(0.001, 1e6))->capture_default_str();
  command->add_option("--seed", arguments->seed, "of crops, split and order")->capture_default_str();
  command->add_option("--jobs", arguments->jobs, "shards at the same time; default: one per core")->check(CLI::Range(1, 256));
  command->footer("Example:\n  evac pack out/desk --out out/shards --config apps/configs/desk_model.yaml --crops 3");
  command->callback([&exit_code, arguments] {
    Pack(*arguments);
    exit_code = ExitCode::kOk;
  });
}

}  // namespace evac
