#include "worldmodel/echo_world.h"

#include <fmt/ranges.h>

#include <algorithm>
#include <set>

#include "core/error.h"

namespace evac {
namespace {

void CheckMatches(const Task& task, const Recording& recording) {
  if (task.arms != recording.arm_names) {
    throw InvalidInput("task {}: arms {}, wanted those of the recording {}: {}", task.id, fmt::join(task.arms, ", "),
                       recording.id, fmt::join(recording.arm_names, ", "));
  }
  if (task.cameras.size() != recording.cameras.size()) {
    throw InvalidInput("task {}: {} cameras, wanted those of the recording {}: {}", task.id, task.cameras.size(),
                       recording.id, recording.cameras.size());
  }
  for (std::size_t i = 0; i < task.cameras.size(); ++i) {
    const Camera &asked = task.cameras[i], &recorded = recording.cameras[i];
    if (asked.name == recorded.name && asked.width_px == recorded.width_px && asked.height_px == recorded.height_px)
      continue;
    throw InvalidInput("task {}: camera {} of {}x{}, the recording {} has {} of {}x{}", task.id, asked.name,
                       asked.width_px, asked.height_px, recording.id, recorded.name, recorded.width_px,
                       recorded.height_px);
  }
}

/// Called like their tasks; one alone is every task's.
RecordedStart OfTasks(std::vector<Recording> recordings) {
  std::set<std::string> ids;
  for (const Recording& recording : recordings) {
    if (!ids.insert(recording.id).second)
      throw InvalidInput("two recordings are called {}: wanted folders of different names", recording.id);
  }
  return [recordings = std::move(recordings)](const Task& task, const InitialState&) {
    if (recordings.size() == 1) return recordings.front();
    const auto found = std::ranges::find(recordings, task.id, &Recording::id);
    if (found == recordings.end()) throw InvalidInput("task {}: no recording is called so", task.id);
    return *found;
  };
}

WorldStep Step(RecordedFrames& frames, const Arms& arms) {
  return {{.images = frames.Next(), .arms = arms, .arms_are_commanded = true}, {}};
}

Advanced Echo(RecordedFrames& frames, const ActionChunk& chunk) {
  std::vector<WorldStep> steps;
  try {
    for (const Arms& target : chunk.targets) steps.push_back(Step(frames, target));
  } catch (const Error& error) {
    return Failure{StopReason::kWorldError, error.what()};
  }
  return steps;
}

}  // namespace

EchoWorld::EchoWorld(RecordedStart find, std::string name) : find_(std::move(find)), name_(std::move(name)) {}

EchoWorld::EchoWorld(Recording recording, std::string name)
    : EchoWorld([only = std::move(recording)](const Task&, const InitialState&) { return only; }, std::move(name)) {}

EchoWorld::EchoWorld(std::vector<Recording> recordings, std::string name)
    : EchoWorld(OfTasks(std::move(recordings)), std::move(name)) {}

WorldStep EchoWorld::Reset(SceneId scene, const Task& task, const InitialState& initial, std::uint64_t) {
  const Recording recording = find_(task, initial);
  CheckMatches(task, recording);
  RecordedFrames& frames = scenes_.insert_or_assign(scene, RecordedFrames(recording)).first->second;
  return Step(frames, recording.arms.front());
}

std::vector<Advanced> EchoWorld::Advance(std::span<const SceneChunk> batch) {
  std::vector<Advanced> answers;
  answers.reserve(batch.size());
  for (const SceneChunk& asked : batch) {
    const auto scene = scenes_.find(asked.scene);
    if (scene == scenes_.end()) throw InternalError("world {}: scene {} was never reset", name_, asked.scene);
    answers.push_back(Echo(scene->second, *asked.chunk));
  }
  return answers;
}

}  // namespace evac
