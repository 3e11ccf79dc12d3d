#include <memory>

#include "apps/commands.h"
#include "apps/network_parts.h"
#include "apps/networks/imagine.h"
#include "apps/number_range.h"

namespace evac {
namespace {

void AddInputs(CLI::App& command, ImagineArguments& arguments) {
  ImagineInputs& inputs = arguments.inputs;
  command.add_option("--recording", inputs.recording, "a recording's folder (docs/formats/recording.md), or:");
  command.add_option("--frame", inputs.files.frame, "the first frame, PNG");
  command.add_option("--actions", inputs.files.actions, "action.npy [T, 16], or AgiBot World's proprio_stats.h5");
  command.add_option("--extrinsics", inputs.files.extrinsics, "base_from_camera: .npy [4, 4], or AgiBot World's .json");
  command.add_option("--intrinsics", inputs.files.intrinsics, "pinhole: .npy [3, 3], or AgiBot World's .json");
  command
      .add_option("--cameras", inputs.cameras, "the views, with commas between them (a folder's; default: what the weights "
                  "say, else the first that are there of head, hand_left, hand_right)")
      ->delimiter(',')
      ->allow_extra_args(false);
  command
      .add_option("--arms", inputs.arms, "the actions are where the arms were told to be, or measured; default: as the weights "
                  "say, else measured")
      ->check(CLI::IsMember({"told", "measured"}));
  command.add_option("--stride", inputs.stride, "every Nth recorded step is a frame; default: those as far apart as the weights say, else 0.1 s")
      ->check(CLI::Range(1, 1000));
}

void AddShared(CLI::App& command, ImagineArguments& arguments) {
  command.add_option("--config", arguments.config, "a page of sizes; default: apps/configs/evac_published.yaml's");
  command.add_option("--chunks", arguments.chunks, "at most so many; default: until the actions end")
      ->check(CLI::Range(1, 1000000));
  command.add_flag("--scaled-maps", arguments.scaled_maps,
                   "maps: radius and thickness in parts of the height (published: 50 and 8 of 320 pixels)");
  command.add_option("--reference-quirks", arguments.quirks,
                     "do as the reference does: all, or names with commas between them (docs/evac_quirks.md)");
  command.add_option("-o,--out", arguments.out, "the folder to write")->required();
}

void AddModel(CLI::App& command, ImagineArguments& arguments) {
  SamplerArguments& sampler = arguments.sampler;
  command.add_option("--weights", arguments.weights, "a checkpoint (docs/weights.md)");
  command.add_option("--statistics", arguments.statistics,
                     "a robot's page of motion statistics; default: what the weights say, of weights that say nothing "
                     "apps/configs/robots/agibotworld.yaml's");
  command.add_option("--solver", sampler.solver, "ddim, or dpm: DPM-Solver++(2M)")
      ->check(CLI::IsMember({"ddim", "dpm"}))
      ->capture_default_str();
  command
      .add_option("--steps", sampler.steps, "times the network is asked per chunk; default: 27 with ddim, 10 with dpm")
      ->check(CLI::Range(1, 1000));
  command.add_option("--eta", sampler.eta, "of ddim: 0 deterministic … 1")
      ->check(Within(0.0, 1.0))
      ->capture_default_str();
  command.add_option("--cfg", sampler.cfg, "guidance; 1: none, in half the time")
      ->check(Within(0.0, 100.0))
      ->capture_default_str();
  command.add_option("--cfg-rescale", sampler.cfg_rescale, "how far guidance is pulled back to its spread")
      ->check(Within(0.0, 1.0))
      ->capture_default_str();
  command.add_option("--seed", sampler.seed, "of all noise")->capture_default_str();
  command.add_option("--dtype", sampler.dtype, "of the weights in memory: f32, bf16, f16")
      ->check(CLI::IsMember({"f32", "bf16", "f16"}))
      ->capture_default_str();
  command.add_option("--device", sampler.device, "cpu, or cuda where libtorch has it")
      ->check(CLI::IsMember({"cpu", "cuda"}))
      ->capture_default_str();
  command.add_option("--threads", sampler.threads, "default: one per core; another number may change a grey level")
      ->check(CLI::Range(1, 1024));
  command.add_flag("--png", arguments.png, "also OUT/frames/frame_%05d.png");
  command.add_flag("--restart", arguments.restart, "throw away what OUT holds of another job");
}

/// Where it has no effect, an option may still say what it is by default: the recorded command does.
void RefuseWithoutEffect(const SamplerArguments& sampler) {
  const SamplerArguments usual;
  if (sampler.solver == "dpm" && sampler.eta != usual.eta)
    throw InvalidInput("--eta: found {} with --solver dpm, wanted none: DPM-Solver++ draws no noise", sampler.eta);
  if (sampler.cfg == 1 && sampler.cfg_rescale != usual.cfg_rescale)
    throw InvalidInput("--cfg-rescale: found {} with --cfg 1, wanted none: nothing is guided", sampler.cfg_rescale);
}

ExitCode Imagine(const ImagineArguments& arguments, bool maps_only) {
  if (maps_only) return ImagineMaps(arguments);
  RefuseWithoutEffect(arguments.sampler);
  if (arguments.weights.empty()) {
    throw InvalidInput("--weights is missing: wanted a checkpoint, or --maps-only, which needs none");
  }
  return ImagineFrames(arguments);
}

}  // namespace

void AddImagine(CLI::App& app, ExitCode& exit_code) {
  auto arguments = std::make_shared<ImagineArguments>();
  CLI::App* command = app.add_subcommand(kImagineCommand.name, kImagineCommand.what);
  AddInputs(*command, *arguments);
  AddShared(*command, *arguments);
  auto maps_only = std::make_shared<bool>(false);
  CLI::Option* maps =
      command->add_flag("--maps-only", *maps_only,
                        "write OUT/maps/frame_%05d.png alone, what the network would be told; needs no weights");
  AddModel(*command, *arguments);
  maps->excludes("--statistics", "--solver", "--steps", "--eta", "--cfg", "--cfg-rescale", "--seed", "--dtype",
                 "--device", "--threads", "--png", "--restart");  // nothing is imagined
  command->footer(
      "Examples:\n"
      "  evac imagine --maps-only --recording path/to/recording --out out/maps\n"
      "  evac imagine --frame frame.png --actions action.npy --extrinsics extrinsics.npy --intrinsics intrinsics.npy "
      "\\\n"
      "               --weights evac.safetensors --chunks 2 --out out/imagined\n"
      "  evac imagine --recording agibot/observations/327/648642 --weights mine.safetensors --config mine.yaml \\\n"
      "               --solver dpm --steps 10 --dtype bf16 --png --out out/imagined\n"
      "OUT holds imagined.mp4 (the picture above its map), imagined.json (all that is needed to do it again), maps/,\n"
      "frames/ with --png, and chunks/: the same command goes on where it was killed. More: docs/imagine.md");
  command->callback([arguments, maps_only, &exit_code] { exit_code = Imagine(*arguments, *maps_only); });
}

}  // namespace evac
