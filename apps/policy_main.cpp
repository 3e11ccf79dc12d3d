#include <algorithm>
#include <memory>
#include <utility>

#include "apps/number_range.h"
#include "apps/policy_program.h"
#include "apps/program_beside.h"
#include "core/error.h"
#include "core/recording.h"
#include "core/types.h"
#include "core/version.h"
#include "policies/hold_policy.h"
#include "policies/policy_server.h"
#include "policies/replay_policy.h"
#include "policies/visual_pick.h"

namespace evac {
namespace {

/// What every policy is asked for; the harness sets the environment of the policies it starts.
struct Common {
  LcmAddress address;
  std::string checkpoint = kDefaultCheckpoint;
  int chunk_size = 16;
  double period_s = 0;

  PolicySpec Spec(const std::string& name) const {
    return {.name = name, .checkpoint = checkpoint, .period_s = period_s, .chunk_size = chunk_size};
  }
};

/// One subcommand and its own copy of the common options: CLI11 fills in the environment's values for all subcommands.
struct Command {
  CLI::App* app;
  std::shared_ptr<Common> common = std::make_shared<Common>();
};

Command AddPolicy(CLI::App& app, const std::string& name, const std::string& description) {
  const Command command{app.add_subcommand(name, description)};
  Common& common = *command.common;
  command.app->add_option("--checkpoint", common.checkpoint, "name that tells apart two of this policy in a run")
      ->capture_default_str();
  command.app->add_option("--chunk-size", common.chunk_size, "targets per chunk")
      ->envname("EVAC_CHUNK_SIZE")
      ->check(CLI::Range(1, 1000))
      ->capture_default_str();
  command.app->add_option("--period-s", common.period_s, "seconds between two targets; 0: any")
      ->check(Within(0.0, 60.0))
      ->capture_default_str();
  AddAddressOptions(*command.app, common.address);
  return command;
}

void AddHold(CLI::App& app, int& exit_code) {
  const Command command = AddPolicy(app, "hold", "Never moves: answers where the arms are.");
  command.app->footer("Example:\n  evac-policy hold --chunk-size 8");
  command.app->callback([&exit_code, common = command.common] {
    HoldPolicy policy(common->chunk_size);
    PolicySpec spec = common->Spec("hold");
    spec.needs = {"arms"};
    exit_code = ServePolicy(policy, spec, common->address);
  });
}

/// What is played.
struct Replayed {
  std::string folder;
  int every_nth = 0;  ///< 0: as many as make the period, or all of them if that is any
  bool told = false;
};

/// Of the cameras the head alone, which every recording has: no picture is looked at.
Recording Read(const Replayed& replayed, double period_s) {
  Recording recording = ReadRecording(replayed.folder, {.every_nth = std::max(1, replayed.every_nth),
                                                        .cameras = {"head"},
                                                        .count_video_frames = false,
                                                        .read_told = replayed.told});
  if (replayed.told && recording.told.empty())
    throw InvalidInput("--told: {}: it does not say where the arms were told to be", replayed.folder);
  if (replayed.every_nth > 0 || period_s == 0) return recording;
  return Thinned(std::move(recording), period_s);
}

void AddReplay(CLI::App& app, int& exit_code) {
  const Command command = AddPolicy(app, "replay", "Plays a recorded trajectory.");
  auto replayed = std::make_shared<Replayed>();
  command.app->add_option("--recording", replayed->folder, "folder of the recording (docs/formats/recording.md)")
      ->required();
  command.app->get_option("--period-s")
      ->description("seconds between two targets: one in so many recorded steps is kept; 0: all")
      ->envname("EVAC_PERIOD_S");
  command.app->add_option("--every-nth", replayed->every_nth, "keep every nth recorded step, whatever --period-s says")
      ->check(CLI::Range(1, 1000));
  command.app->add_flag("--told", replayed->told,
                        "play where the arms were told to be, not where they were: for world models that learned from "
                        "told arms");
  command.app->footer("Example:\n  evac-policy replay --recording agibot_examples/example0 --chunk-size 16");
  command.app->callback([&exit_code, common = command.common, replayed] {
    Recording recording = Read(*replayed, common->period_s);
    PolicySpec spec = common->Spec("replay");
    spec.arms = recording.arm_names;
    spec.period_s = recording.period_s;
    spec.needs = {"whole_chunks"};
    ReplayPolicy policy(std::move(recording), common->chunk_size);
    exit_code = ServePolicy(policy, spec, common->address);
  });
}

void AddVisualPick(CLI::App& app, int& exit_code) {
  const Command command =
      AddPolicy(app, "visual_pick", "Finds a thing of known colour and shape in the images, takes it and places it.");
  auto options = std::make_shared<VisualPickOptions>();
  auto bias_m = std::make_shared<std::vector<double>>(2, 0.0);
  command.app->add_option("--bias-m", *bias_m, "X,Y: how far off it takes the thing to be, base frame")
      ->delimiter(',')
      ->expected(2)
      ->capture_default_str();
  command.app->add_option("--noise-m", options->noise_m, "the same, random per episode: standard deviation")
      ->capture_default_str();
  command.app->add_option("--request-noise-m", options->request_noise_m, "the same, random each time it looks")
      ->capture_default_str();
  command.app
      ->add_option("--place-noise-m", options->place_noise_m,
                   "how far off it takes the place to put it to be: standard deviation, per episode")
      ->capture_default_str();
  command.app->add_option("--high-m", options->high_m, "takes hold this much too high");
  command.app->add_option("--turn-deg", options->turn_deg, "takes hold turned by this about the vertical");
  command.app->add_option("--hurry", options->hurry, "share of its pauses that it skips, 0 to 1");
  command.app->add_option("--late-close-s", options->late_close_s, "closes the hand this late (below 0: early), the arm does not wait")
      ->capture_default_str();
  command.app->add_option("--early-release-s", options->early_release_s, "opens the hand this early")
      ->capture_default_str();
  command.app->add_option("--blindness", options->blindness, "probability to see nothing in an episode")
      ->capture_default_str();
  command.app->add_option("--request-blindness", options->request_blindness, "probability to see nothing in a request")
      ->capture_default_str();
  command.app->add_option("--speed", options->speed, "of all motion; 1: at most 0.38 m/s")->capture_default_str();
  command.app->add_option("--retries", options->retries, "how often it goes back when its hand came up empty")
      ->capture_default_str();
  command.app->footer(
      "Example:\n  evac-policy visual_pick --checkpoint fair --noise-m 0.02\nWhat it does and how good it is: "
      "docs/visual_pick.md");
  command.app->callback([&exit_code, common = command.common, options, bias_m] {
    options->chunk_size = common->chunk_size;
    options->bias_m = {bias_m->at(0), bias_m->at(1)};
    VisualPick policy(*options);
    PolicySpec spec = common->Spec("visual_pick");
    spec.cameras = {{"head", 0, 0}, {"hand_right", 0, 0}};
    spec.needs = {"images", "arms", "whole_chunks"};
    exit_code = ServePolicy(policy, spec, common->address);
  });
}

/// Becomes the program beside this one whose policy is a network: loading libtorch takes half a second of a core, which
/// the others need not wait for.
void AddLearned(CLI::App& app) {
  CLI::App* command = app.add_subcommand("learned", "Does what it learned by imitation (evac train policy).");
  command->set_help_flag();  // -h and all else is for that program
  command->prefix_command();
  command->callback([command] { BecomeProgramBeside("evac-policy-learned", command->remaining()); });
}

}  // namespace
}  // namespace evac

int main(int argc, char** argv) {
  CLI::App app("evac-policy: the policies that come with evac, each served over LCM until SIGTERM.", "evac-policy");
  app.set_version_flag("--version", EVAC_VERSION);
  app.require_subcommand(1);
  app.footer(
      "A policy of your own: docs/write_a_policy.md.\nExit codes: 0 stopped, 2 invalid input, 4 internal error.");
  int exit_code = 0;
  evac::AddHold(app, exit_code);
  evac::AddReplay(app, exit_code);
  evac::AddVisualPick(app, exit_code);
  evac::AddLearned(app);
  return evac::RunPolicyProgram(app, argc, argv, exit_code);
}
