#include <fmt/format.h>

#include <algorithm>

#include "apps/factory.h"
#include "apps/networks/fidelity.h"
#include "apps/networks/fidelity_frames.h"
#include "apps/networks/fidelity_judge.h"
#include "apps/interrupts.h"
#include "apps/networks/pack_sources.h"
#include "worldmodel/echo_world.h"
#include "worldmodel/evac_config.h"

namespace evac {
namespace {

namespace fs = std::filesystem;

const InitialState kRecorded{"recording", 0};

const SuiteWorld& ModelOf(const Suite& suite) {
  const auto found = std::ranges::find_if(suite.worlds, [](const SuiteWorld& world) { return world.evac.has_value(); });
  if (found == suite.worlds.end()) throw InvalidInput("{}: field worlds: wanted one of type evac", suite.path.string());
  return *found;
}

/// Those that can be read as the network was trained; of the others, how many and why is said.
std::vector<Recording> ReadAll(const fs::path& folder, const SuiteWorld& model, const nn::ModelConfig& config) {
  const std::vector<fs::path> folders = FindRecordings(folder);
  SourceOptions how{.period_s = model.evac->period_s, .cameras = {}, .views = static_cast<std::size_t>(config.views)};
  how.least_frames = static_cast<std::size_t>(config.chunk) + 1;
  how.cameras = ChooseViews(folders, how);
  std::vector<Recording> recordings;
  std::vector<LeftOut> left_out;
  for (const fs::path& one : folders) {
    Looked looked = LookAt(one, how);
    if (looked.source) {
      recordings.push_back(ReadForPacking(one, how));
    } else {
      left_out.push_back(std::move(looked.left_out));
    }
  }
  for (std::size_t i = 0; i < std::min<std::size_t>(left_out.size(), 5); ++i)
    fmt::print(stderr, "evac: warning: {}\n", left_out[i].sentence);
  if (!left_out.empty()) fmt::print(stderr, "evac: warning: {}\n", CountByKind(left_out));
  if (recordings.empty()) throw InvalidInput("{}: none of {} recordings can be replayed", folder.string(), folders.size());
  return recordings;
}

/// Where the arms were told to be where that is recorded, else where they were.
std::vector<Arms> ActionsOf(const Recording& recording) {
  const std::vector<Arms>& track = recording.told.empty() ? recording.arms : recording.told;
  return {track.begin() + 1, track.end()};
}

/// The suite as if its recordings were tasks of a world: imagined episodes start from what that world stored.
Suite WithTasks(const Suite& suite, const std::vector<Recording>& recordings) {
  Suite changed = suite;
  changed.recording.reset();
  changed.tasks.clear();
  for (const Recording& recording : recordings) {
    changed.tasks.push_back(TaskFromRecording(recording));
    const auto chunks = (recording.arms.size() + static_cast<std::size_t>(suite.chunk_size) - 1) /
                        static_cast<std::size_t>(suite.chunk_size);
    changed.tasks.back().max_chunks = static_cast<int>(chunks) + 1;
  }
  changed.initial_states = {kRecorded};
  return changed;
}

}  // namespace

ExitCode RunRecordedFidelity(const FidelityArguments& arguments, const Suite& given) {
  const SuiteWorld& model = ModelOf(given);
  const nn::ModelConfig config = ReadEvacConfig(model.evac->config);
  const std::vector<Recording> recordings = ReadAll(*given.recording, model, config);
  const Suite suite = WithTasks(given, recordings);
  SuiteWorld recorded;
  recorded.name = "recorded";
  recorded.type = "echo";
  recorded.is_real = true;
  std::vector<Replay> replays;
  for (std::size_t i = 0; i < recordings.size(); ++i)
    replays.push_back({{suite.tasks[i].id, kRecorded.id, "recorded", "actions", 1}, &suite.tasks[i], kRecorded,
                       ActionsOf(recordings[i])});

  const fs::path out = arguments.out;
  ReplayRun run{suite, out / "open", "recordings", suite.tasks, {recorded, model}};
  run.make = [&](const SuiteWorld& world) -> std::unique_ptr<World> {
    if (world.type != "echo") return nullptr;
    return std::make_unique<EchoWorld>(recordings, world.name);
  };
  const Store store = RunReplays(run, replays);

  FidelityInput input;
  input.suite_hash = suite.hash;
  input.model_hash = model.evac->hash;
  const OutcomesOf found(store, "");
  DriftMeter drift(static_cast<int>(config.chunk));
  for (const Replay& replay : replays) {
    const std::string real = found.Clip({replay.pair, recorded.name}), imagined = found.Clip({replay.pair, model.name});
    input.rows.push_back({"open_loop", replay.pair, std::nullopt, std::nullopt, std::nullopt, real, imagined});
    if (real.empty() || imagined.empty()) continue;
    drift.Add({replay.task, out / real, out / imagined, replay.actions, suite.video.scale,
               config.pose_map.tool_length_m});
  }
  input.open_loop = {drift.object_px(), drift.Chunks()};
  input.horizon = drift.Chunks();
  input.seconds_per_chunk = SecondsPerChunk(model, suite, store, replays, static_cast<int>(config.chunk));
  FinishFidelity(out, std::move(input));
  return ExitCode::kOk;
}

}  // namespace evac
