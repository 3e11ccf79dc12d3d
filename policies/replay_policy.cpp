#include "policies/replay_policy.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <utility>

#include "core/error.h"

namespace evac {

ReplayPolicy::ReplayPolicy(Recording recording, int chunk_size)
    : recording_(std::move(recording)), chunk_size_(static_cast<std::size_t>(chunk_size)) {
  if (recording_.arms.size() < 2)
    throw InvalidInput("recording {}: {} steps, wanted at least 2", recording_.id, recording_.arms.size());
  if (chunk_size < 1) throw InvalidInput("replay: chunk size {}, wanted at least 1", chunk_size);
}

void ReplayPolicy::Reset(SceneId scene, const Task& task, std::uint64_t) {
  if (task.arms != recording_.arm_names) {
    throw InvalidInput("recording {}: its arms are {}, task {} has {}", recording_.id,
                       fmt::join(recording_.arm_names, ", "), task.id, fmt::join(task.arms, ", "));
  }
  if (std::abs(task.period_s - recording_.period_s) > 1e-6 * recording_.period_s) {
    throw InvalidInput("recording {}: its period is {} s, task {} has {} s", recording_.id, recording_.period_s,
                       task.id, task.period_s);
  }
  next_row_[scene] = 1;
}

std::vector<Acted> ReplayPolicy::Act(std::span<const SceneObservation> batch) {
  std::vector<Acted> answers;
  for (const SceneObservation& asked : batch) answers.push_back(Next(asked.scene));
  return answers;
}

Acted ReplayPolicy::Next(SceneId scene) {
  std::size_t& row = next_row_.at(scene);
  const auto& rows = recording_.told.empty() ? recording_.arms : recording_.told;
  if (row >= rows.size())
    return Failure{StopReason::kPolicyError,
                   fmt::format("recording {} is over: it has {} steps", recording_.id, rows.size())};
  const std::size_t end = std::min(rows.size(), row + chunk_size_);
  ActionChunk chunk{
      .targets = {rows.begin() + static_cast<std::ptrdiff_t>(row), rows.begin() + static_cast<std::ptrdiff_t>(end)},
      .ends_recording = end == rows.size()};
  row = end;
  return chunk;
}

}  // namespace evac
