#include "apps/collect_episode.h"

#include <algorithm>
#include <limits>
#include <numeric>
#include <string_view>

#include "core/check.h"
#include "core/error.h"
#include "core/file.h"
#include "core/geometry.h"
#include "harness/still.h"
#include "judges/attempt.h"

namespace evac {
namespace {

/// Adds one frame. @returns its observation, images and all.
Observation Append(WorldStep step, Arms told, CollectedRun& run) {
  run.recorded.arms.push_back(step.observation.arms);
  run.recorded.told.push_back(std::move(told));
  run.recorded.pictures.push_back(step.observation.images);
  run.track.push_back(std::move(step.privileged));
  return std::move(step.observation);
}

/// @throws InternalError for a policy that fails or asks for what no world should do: it is ours.
ActionChunk Ask(Policy& policy, const Task& task, const Observation& observation) {
  const SceneObservation asked{0, &observation};
  Acted acted = std::move(policy.Act({&asked, 1}).front());
  if (const auto* failure = std::get_if<Failure>(&acted))
    throw InternalError("policy {}: {}", policy.Name(), failure->message);
  ActionChunk chunk = std::get<ActionChunk>(std::move(acted));
  if (const auto wrong = WhatIsWrong(chunk, task, static_cast<int>(chunk.targets.size())))
    throw InternalError("policy {}: {}", policy.Name(), *wrong);
  return chunk;
}

/// How the physics failed; nothing if it did not. @throws InternalError if the world itself failed: no episode's outcome.
const Failure* DivergedIn(const Advanced& advanced) {
  const auto* failure = std::get_if<Failure>(&advanced);
  if (failure && failure->stop != StopReason::kDiverged) throw InternalError("world real: {}", failure->message);
  return failure;
}

const Eigen::Isometry3d& PoseOf(const std::string& body, const PrivilegedFrame& frame) {
  for (const PrivilegedFrame::Body& found : frame.bodies) {
    if (found.name == body) return found.base_from_body;
  }
  throw InvalidInput("recipe: there is no body '{}' in the scene", body);
}

/// Where the hands truly are.
Arms TrueArms(const Task& task, const PrivilegedFrame& frame) {
  Arms arms;
  for (const std::string& arm : task.arms)
    arms.push_back({PoseOf(arm == "left" ? "left_gripper" : "gripper", frame), 0.0});
  return arms;
}

EpisodeTruth TruthOf(const CollectJob& job, const Task& task, const CollectedRun& run, int scale) {
  EpisodeTruth truth;
  for (const Camera& camera : task.cameras) truth.cameras.push_back(camera.name);
  constexpr float kUnknown = std::numeric_limits<float>::quiet_NaN();
  for (const PrivilegedFrame& frame : run.track) {
    for (const Camera& camera : task.cameras) {
      const auto at_px = ObjectIn(job, camera, frame);
      truth.object_px.push_back(at_px ? static_cast<float>(at_px->x() * scale) : kUnknown);
      truth.object_px.push_back(at_px ? static_cast<float>(at_px->y() * scale) : kUnknown);
    }
  }
  return truth;
}

}  // namespace

const Task& TaskOf(const CollectJob& job) { return job.behaviour->without_object ? job.task->without : job.task->task; }

std::optional<Eigen::Vector2d> ObjectIn(const CollectJob& job, const Camera& camera, const PrivilegedFrame& frame) {
  const Eigen::Vector3d middle_m = PoseOf(job.task->object, frame) * job.task->middle_m;
  return Project(camera, BaseFromCamera(camera, TrueArms(TaskOf(job), frame)).inverse() * middle_m);
}

EpisodeRepeater::EpisodeRepeater(const Recipe& recipe)
    : world_({.name = "real", .profile = recipe.profile, .threads = 1, .film = false}) {}

std::optional<UnseenRun> EpisodeRepeater::Do(const CollectJob& job, const std::vector<Arms>& told) {
  const Task& task = TaskOf(job);
  const ActionChunk all{{told.begin() + 1, told.end()}, false, 0};
  if (WhatIsWrong(all, task, static_cast<int>(all.targets.size()))) return std::nullopt;
  UnseenRun run;
  run.track.push_back(
      std::move(world_.Reset(0, task, {job.row.initial_state, job.row.state_seed}, job.row.world_seed).privileged));
  const SceneChunk driven{0, &all};
  Advanced advanced = std::move(world_.Advance({&driven, 1}).front());
  if (DivergedIn(advanced)) return std::nullopt;
  for (WorldStep& step : std::get<std::vector<WorldStep>>(advanced)) run.track.push_back(std::move(step.privileged));
  run.success = Look({task, job.task->object, run.track, told}).fate == Fate::kSuccess;
  return run;
}

EpisodeCollector::EpisodeCollector(const Recipe& recipe, std::filesystem::path out)
    : recipe_(recipe), out_(std::move(out)), world_({.name = "real", .profile = recipe.profile, .threads = 1}) {}

CollectedRun EpisodeCollector::Run(const CollectJob& job) try {
  if (!job.behaviour->unaware) return Act(job, TaskOf(job));
  const CollectedRun there = Act(job, job.task->task);
  return there.failure.empty() ? Repeat(job, TaskOf(job), there) : there;
} catch (const Error& error) {
  if (std::string_view(error.kind()) != Name(StopReason::kDiverged)) throw;
  CollectedRun never_began;  // what was placed does not come to rest
  never_began.stop = Name(StopReason::kDiverged);
  never_began.failure = error.what();
  return never_began;
}

Observation EpisodeCollector::Begin(const CollectJob& job, const Task& task, CollectedRun& run) {
  run.recorded.period_s = task.period_s;
  run.recorded.cameras = task.cameras;
  run.stop = Name(StopReason::kMaxChunks);
  WorldStep first = world_.Reset(0, task, {job.row.initial_state, job.row.state_seed}, job.row.world_seed);
  Arms start = first.observation.arms;
  return Append(std::move(first), std::move(start), run);
}

std::optional<std::vector<Observation>> EpisodeCollector::Execute(const ActionChunk& chunk, CollectedRun& run) {
  const SceneChunk driven{0, &chunk};
  Advanced advanced = std::move(world_.Advance({&driven, 1}).front());
  if (const Failure* failure = DivergedIn(advanced)) {
    run.stop = Name(failure->stop);
    run.failure = failure->message;
    return std::nullopt;
  }
  std::vector<Observation> observed;
  auto& steps = std::get<std::vector<WorldStep>>(advanced);
  for (std::size_t k = 0; k < steps.size(); ++k) observed.push_back(Append(std::move(steps[k]), chunk.targets[k], run));
  return observed;
}

CollectedRun EpisodeCollector::Act(const CollectJob& job, const Task& task) {
  const std::unique_ptr<Policy> policy = MakePolicy(job, recipe_.chunk_size);
  CollectedRun run;
  policy->Reset(0, task, job.row.policy_seed);
  Observation observation = Begin(job, task, run);
  StillMeter still(task.still);
  std::vector<Arms> observed;
  for (int chunks = 0; chunks < recipe_.max_chunks; ++chunks) {
    const ActionChunk chunk = Ask(*policy, task, observation);
    if (still.Rest(run.recorded.told.back(), chunk.targets, observed)) {
      run.stop = Name(StopReason::kStill);
      break;
    }
    observed = {observation.arms};
    auto seen = Execute(chunk, run);
    if (!seen) break;
    for (const Observation& one : *seen) observed.push_back(one.arms);
    observation = std::move(seen->back());
  }
  return run;
}

CollectedRun EpisodeCollector::Repeat(const CollectJob& job, const Task& task, const CollectedRun& before) {
  CollectedRun run;
  Begin(job, task, run);
  const std::vector<Arms>& told = before.recorded.told;  // the first row is where the arms were
  const auto chunk_size = static_cast<std::size_t>(recipe_.chunk_size);
  for (std::size_t row = 1; row < told.size(); row += chunk_size) {
    const auto begin = told.begin() + static_cast<std::ptrdiff_t>(row);
    if (!Execute({{begin, begin + static_cast<std::ptrdiff_t>(std::min(chunk_size, told.size() - row))}, false, 0}, run)) return run;
  }
  run.stop = before.stop;
  return run;
}

CollectedEpisode EpisodeCollector::Collect(const CollectJob& job) {
  const CollectedRun run = Run(job);
  const Task& task = TaskOf(job);
  CollectedEpisode row = job.row;
  row.stop = run.stop;
  const TreePlace place = PlaceOf(out_, row);
  if (run.failure.empty()) {
    const WhatHappened happened = Look({task, job.task->object, run.track, run.recorded.told});
    EpisodeTruth truth = TruthOf(job, task, run, recipe_.video.scale);
    truth.contact = happened.contact;
    row.success = happened.fate == Fate::kSuccess;
    row.fate = Name(happened.fate);
    row.reason = happened.reason;
    row.frames = static_cast<int>(run.track.size());
    row.contact_frames = std::accumulate(truth.contact.begin(), truth.contact.end(), 0);
    WriteRecording(place, run.recorded, recipe_.video);
    WriteTruth(TruthPath(place), truth);
  } else {
    row.fate = run.stop;
    row.reason = run.failure;
  }
  MakeFolders(RowPath(place).parent_path());
  WriteFileAtomically(RowPath(place), CollectedJson(row) + "\n");
  return row;
}

TreePlace PlaceOf(const std::filesystem::path& out, const CollectedEpisode& row) {
  return {out, row.task, row.episode};
}

}  // namespace evac
