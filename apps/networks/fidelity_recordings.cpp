#include <fmt/format.h>

#include <algorithm>
#include <utility>

#include "apps/factory.h"
#include "apps/networks/fidelity.h"
#include "apps/networks/fidelity_frames.h"
#include "apps/networks/fidelity_judge.h"
#include "apps/interrupts.h"
#include "apps/networks/pack_sources.h"
#include "apps/warnings.h"
#include "worldmodel/echo_world.h"
#include "worldmodel/evac_config.h"
#include "worldmodel/trained_for.h"

namespace evac {
namespace {

namespace fs = std::filesystem;

const InitialState kRecorded{"recording", 0};

const SuiteWorld& ModelOf(const Suite& suite) {
  const auto is_model = [](const SuiteWorld& world) { return world.evac.has_value(); };
  const auto found = std::ranges::find_if(suite.worlds, is_model);
  if (found == suite.worlds.end()) throw InvalidInput("{}: field worlds: wanted one of type evac", suite.path.string());
  const auto other = std::find_if(found + 1, suite.worlds.end(), is_model);
  if (other == suite.worlds.end()) return *found;
  throw InvalidInput("{}: field worlds: found {} and {}, wanted one of type evac", suite.path.string(), found->name, other->name);
}

/// Pictures are compared, of replays: what asks about outcomes or for another part would be passed over in silence.
void RefuseOptionsThatMeanNothing(const FidelityArguments& given) {
  const FidelityArguments none;
  const std::vector<std::string> replays = {"open"};
  const std::pair<const char*, bool> options[] = {
      {"--classifier", given.classifier != none.classifier},
      {"--reality", given.reality != none.reality},
      {"--parts", given.parts != none.parts && given.parts != replays},
      {"--counterfactual-states", given.counterfactual_states != none.counterfactual_states},
      {"--horizon-states", given.horizon_states != none.horizon_states},
      {"--horizon-chunks", given.horizon_chunks != none.horizon_chunks}};
  for (const auto& [option, is_given] : options) {
    if (is_given)
      throw InvalidInput("{}: means nothing for a suite with a recording: its actions are replayed in the model and held against "
                         "its pictures, and nobody says how it ended; leave it out", option);
  }
}

/// So would what says when a policy's episode ends, or which of them a world has.
void RefuseFieldsThatMeanNothing(const Suite& suite) {
  const std::vector<std::uint64_t> one_seed = {1};
  std::vector<std::pair<std::string, bool>> fields = {
      {"still", suite.recorded_task.still.has_value()},
      {"task", suite.recorded_task.name.has_value()},
      {"workspace_m", suite.recorded_task.workspace_m.has_value()},
      {"seeds", !suite.seeds.empty() && suite.seeds != one_seed}};
  for (const SuiteWorld& world : suite.worlds)
    fields.push_back({"initial_states of world " + world.name, world.initial_states > 0});
  for (const auto& [field, is_given] : fields) {
    if (is_given)
      throw InvalidInput(
          "{}: field {}: means nothing for `evac fidelity` of recordings: each is replayed once, in the model and "
          "beside its own pictures, to its last action or to max_chunks; leave it out",
          suite.path.string(), field);
  }
}

/// Which arms are its actions: those that the network learned from, where its weights say so.
ArmsKind ArmsReadBy(const TrainedFor& trained) {
  if (trained.arms_read == "told") return ArmsKind::kTold;
  return trained.arms_read == "measured" ? ArmsKind::kMeasured : ArmsKind::kAuto;
}

/// Those that can be read as the network was trained, the first `suite.recorded_states` of them where the suite says so;
/// of the others that were looked at, how many and why is said.
std::vector<Recording> ReadAll(const Suite& suite, const SuiteWorld& model, const nn::ModelConfig& config) {
  const fs::path& folder = *suite.recording;
  const std::vector<fs::path> folders = FindRecordings(folder);
  SayPassedOver(folder);
  const TrainedFor trained = TrainedFor::Read(model.evac->weights);
  SourceOptions how{.period_s = model.evac->period_s,
                    .cameras = trained.cameras,
                    .views = static_cast<std::size_t>(config.views),
                    .arms = ArmsReadBy(trained)};
  how.least_frames = static_cast<std::size_t>(config.chunk) + 1;
  how.cameras = ChooseViews(folders, how);
  std::vector<Recording> recordings;
  std::vector<LeftOut> left_out;
  for (const fs::path& one : folders) {
    if (suite.recorded_states > 0 && std::ssize(recordings) == suite.recorded_states) break;
    Looked looked = LookAt(one, how);
    if (!looked.source) {
      left_out.push_back(std::move(looked.left_out));
      continue;
    }
    Recording recording = ReadForPacking(one, how);
    try {
      trained.CheckArms(recording.arm_names, one.string());
      recordings.push_back(std::move(recording));
    } catch (const Error& error) {
      left_out.push_back({one, "other_robot", error.what()});
    }
  }
  for (std::size_t i = 0; i < std::min<std::size_t>(left_out.size(), 5); ++i)
    fmt::print(stderr, "evac: warning: {}\n", left_out[i].sentence);
  if (!left_out.empty()) fmt::print(stderr, "evac: warning: {}\n", CountByKind(left_out));
  if (recordings.empty()) throw InvalidInput("{}: none of {} recordings can be replayed", folder.string(), folders.size());
  if (std::ssize(recordings) < suite.recorded_states)
    throw InvalidInput(
        "{}: field initial_states.count: found {}, wanted at most {}: so many recordings of {} can be replayed",
        suite.path.string(), suite.recorded_states, recordings.size(), folder.string());
  return recordings;
}

/// Where the arms were told to be where that is recorded, else where they were; to the suite's limit.
std::vector<Arms> ActionsOf(const Recording& recording, const Suite& suite) {
  const std::vector<Arms> track = ToldTrack(recording);
  std::vector<Arms> actions = {track.begin() + 1, track.end()};
  const auto chunks = static_cast<std::size_t>(suite.recorded_task.max_chunks);  // 0: all of them
  const std::size_t most = chunks * static_cast<std::size_t>(suite.chunk_size);
  if (most > 0 && actions.size() > most) actions.resize(most);
  return actions;
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
  RefuseOptionsThatMeanNothing(arguments);
  RefuseFieldsThatMeanNothing(given);
  const SuiteWorld& model = ModelOf(given);
  const nn::ModelConfig config = ReadEvacConfig(model.evac->config);
  const std::vector<Recording> recordings = ReadAll(given, model, config);
  const Suite suite = WithTasks(given, recordings);
  SuiteWorld recorded;
  recorded.name = "recorded";
  recorded.type = "echo";
  recorded.is_real = true;
  std::vector<Replay> replays;
  for (std::size_t i = 0; i < recordings.size(); ++i)
    replays.push_back({{suite.tasks[i].id, kRecorded.id, "recorded", "actions", 1}, &suite.tasks[i], kRecorded,
                       ActionsOf(recordings[i], suite)});

  const fs::path out = arguments.out;
  ReplayRun run{suite, out / "open", "recordings", suite.tasks, {recorded, model}};
  run.make = [&](const SuiteWorld& world) -> std::unique_ptr<World> {
    if (world.type != "echo") return nullptr;
    return std::make_unique<EchoWorld>(recordings, world.name);
  };
  const Store store = RunReplays(run, replays);

  FidelityInput input;
  input.parts = {EpisodesOf("open", store, replays)};
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
  std::erase_if(replays, [&](const Replay& replay) { return found.Clip({replay.pair, model.name}).empty(); });
  input.seconds_per_chunk = SecondsPerChunk(model, suite, store, replays, static_cast<int>(config.chunk));
  const bool is_compared = !input.horizon.empty();
  FinishFidelity(out, std::move(input));
  return is_compared ? ExitCode::kOk : ExitCode::kInconclusive;
}

}  // namespace evac
