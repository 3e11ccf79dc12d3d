#include "apps/recorded_suite.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <string_view>

#include "apps/network_parts.h"
#include "apps/warnings.h"
#include "core/collection.h"
#include "core/error.h"
#include "core/geometry.h"
#include "core/recording_folders.h"
#include "core/seed.h"
#include "harness/suite_hash.h"

namespace evac {
namespace {

namespace fs = std::filesystem;

constexpr std::size_t kMostSaid = 5;

Recording ReadAt(const Suite& suite, const fs::path& folder) {
  Recording recording = HasNetwork(suite) ? ReadAsTrained(suite, folder) : ReadRecording(folder);
  DemandRecordingUnchanged(suite, folder);  // what is stored bears the suite's hash
  return recording;
}

Task TaskOf(const Suite& suite, const Recording& recording) {
  Task task = TaskFromRecording(recording);
  const RecordedTask& said = suite.recorded_task;
  if (said.name) task.id = *said.name;
  const int steps = task.max_chunks;  // it counts them so, whatever the suite's chunks
  task.max_chunks = said.max_chunks > 0 ? said.max_chunks : (steps + suite.chunk_size - 1) / suite.chunk_size;
  if (steps < suite.chunk_size) task.workspace_m = Task{}.workspace_m;  // a beginning says nothing of where the arms will go
  if (said.workspace_m) task.workspace_m = *said.workspace_m;
  if (said.instruction) task.instruction = *said.instruction;
  if (said.rubric) task.rubric = *said.rubric;
  if (said.still) task.still = *said.still;
  return task;
}

void FillInOne(Suite& suite) {
  if (suite.recorded_states > 1)
    throw InvalidInput("{}: field initial_states.count: found {}, wanted 1: {} is one recording", suite.path.string(),
                       suite.recorded_states, suite.recording->string());
  suite.tasks = {TaskOf(suite, ReadAt(suite, *suite.recording))};
  suite.initial_states = {{"recording", 0}};
  suite.recordings = {{"recording", *suite.recording}};
}

/// Why a camera of the recording is not the one that policies are told of, which is the first's; empty: it is. A camera
/// on a gripper is compared as it sits there: where the hand begins does not matter.
std::string WhatDiffers(const Camera& camera, const Camera& told, const std::string& first) {
  const double right = (camera.cx_px - told.cx_px) / told.width_px, down = (camera.cy_px - told.cy_px) / told.height_px;
  if (std::max(std::abs(right), std::abs(down)) > kSameFocal)
    return fmt::format("has its principal point {:.3f} picture widths and {:.3f} heights from where it was in {}",
                       std::abs(right), std::abs(down), first);
  return CalibrationDifference(told, camera, "in " + first);
}

/// Why the recording cannot begin episodes of the task, which is of the recording `first`; empty: it can.
std::string WhatDiffers(const Recording& recording, const Task& task, const std::string& first) {
  if (recording.arm_names != task.arms) return "other arms than those of " + first;
  if (std::abs(recording.period_s - task.period_s) > 1e-9)
    return fmt::format("steps of {:.4g} s, not {:.4g} s as those of {}", recording.period_s, task.period_s, first);
  const auto same = [](const Camera& a, const Camera& b) {
    return a.name == b.name && a.width_px == b.width_px && a.height_px == b.height_px;
  };
  if (!std::ranges::equal(recording.cameras, task.cameras, same))
    return "other cameras than those of " + first + ", or of another size";
  for (std::size_t i = 0; i < task.cameras.size(); ++i) {
    if (const std::string why = WhatDiffers(recording.cameras[i], task.cameras[i], first); !why.empty())
      return fmt::format("camera {} {}, whose calibration policies are told", task.cameras[i].name, why);
  }
  return "";
}

/// Takes recording after recording into the suite.
class RecordedStates {
 public:
  explicit RecordedStates(Suite& suite) : suite_(suite) {}

  void Take(const fs::path& folder) {
    const std::optional<CollectedEpisode> row = RowOf(folder);
    CheckTask(folder, TaskNameOf(folder, row, *suite_.recording));
    const bool is_enough = suite_.recorded_states > 0 && std::ssize(suite_.initial_states) >= suite_.recorded_states;
    if (is_enough || (row && suite_.recordings.contains(row->initial_state))) return;  // or it began alike
    try {
      Add(folder, row, ReadAt(suite_, folder));
    } catch (const Error& error) {
      const std::string_view kind = error.kind();
      if (error.exit_code() != ExitCode::kInvalidInput || kind == kChangedError || kind == kSuiteError) throw;
      left_out_.push_back(error.what());
    }
  }

  void Finish() {
    for (std::size_t i = 0; i < std::min(left_out_.size(), kMostSaid); ++i)
      fmt::print(stderr, "evac: warning: left out: {}\n", left_out_[i]);
    if (!left_out_.empty())
      fmt::print(stderr, "evac: warning: {} recordings of {} left out\n", left_out_.size(), suite_.recording->string());
    const auto found = std::ssize(suite_.initial_states);
    if (found == 0) throw InvalidInput("{}: no recording can be begun from", suite_.recording->string());
    Limit("initial_states.count", suite_.recorded_states);
    for (const SuiteWorld& world : suite_.worlds) Limit("initial_states of world " + world.name, world.initial_states);
  }

 private:
  void CheckTask(const fs::path& folder, const std::string& task) {
    if (task_.empty()) task_ = task;
    if (task_ == task) return;
    throw InvalidInput("{}: field recording: found tasks {} and {} (in {}), wanted recordings of one task: a suite for each",
                       suite_.path.string(), task_, task, folder.string());
  }

  void Add(const fs::path& folder, const std::optional<CollectedEpisode>& row, const Recording& recording) {
    if (suite_.tasks.empty()) {
      suite_.tasks = {TaskOf(suite_, recording)};
      if (!suite_.recorded_task.name) suite_.tasks.front().id = task_;
      if (!suite_.recorded_task.instruction)
        suite_.tasks.front().instruction = fmt::format("Do what was recorded in {}.", task_);
    }
    Task& task = suite_.tasks.front();
    const std::string first = suite_.initial_states.empty() ? recording.id : suite_.initial_states.front().id;
    if (const std::string why = WhatDiffers(recording, task, first); !why.empty())
      throw InvalidInput("{}: {}", recording.source, why);
    const std::string state = row ? row->initial_state : recording.id;
    if (!suite_.recordings.emplace(state, folder).second)
      throw InvalidInput("{}: another recording is called {} too", recording.source, state);
    const Task own = TaskOf(suite_, recording);
    task.max_chunks = std::max(task.max_chunks, own.max_chunks);
    task.workspace_m.extend(own.workspace_m);
    suite_.initial_states.push_back({state, SeedFor(0, state)});
  }

  void Limit(const std::string& field, int wanted) const {
    const auto found = std::ssize(suite_.initial_states);
    if (wanted > found)
      throw InvalidInput("{}: field {}: found {}, wanted at most {}: so many recordings can be begun from",
                         suite_.path.string(), field, wanted, found);
  }

  Suite& suite_;
  std::string task_;
  std::vector<std::string> left_out_;
};

void FillInSeveral(Suite& suite) {
  suite.initial_states.clear();
  RecordedStates states(suite);
  for (const fs::path& folder : FindRecordings(*suite.recording)) states.Take(folder);
  SayPassedOver(*suite.recording);
  states.Finish();
}

}  // namespace

Recording RecordingOf(const Suite& suite, const InitialState& initial) {
  const auto found = suite.recordings.find(initial.id);
  if (found == suite.recordings.end())
    throw InvalidInput("{}: no recording is called {}", suite.path.string(), initial.id);
  return ReadAt(suite, found->second);
}

void FillInRecordedTask(Suite& suite) {
  if (!suite.recording || !suite.tasks.empty()) return;
  IsRecording(*suite.recording) ? FillInOne(suite) : FillInSeveral(suite);
  CheckVideoSizes(suite);
}

}  // namespace evac
