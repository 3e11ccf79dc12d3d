#include "core/types.h"

#include <array>
#include <utility>

#include "core/error.h"

namespace evac {
namespace {

constexpr std::array<std::pair<StopReason, const char*>, 7> kStopReasons = {{
    {StopReason::kStill, "still"},
    {StopReason::kMaxChunks, "max_chunks"},
    {StopReason::kRecordingEnd, "recording_end"},
    {StopReason::kPolicyError, "policy_error"},
    {StopReason::kPolicyTimeout, "policy_timeout"},
    {StopReason::kWorldError, "world_error"},
    {StopReason::kDiverged, "diverged"},
}};

constexpr std::array<std::pair<Label, const char*>, 4> kLabels = {{
    {Label::kSuccess, "success"},
    {Label::kFailure, "failure"},
    {Label::kCannotTell, "cannot_tell"},
    {Label::kInvalid, "invalid"},
}};

template <typename Table, typename Value>
const char* NameIn(const Table& table, Value value) {
  for (const auto& [entry, name] : table) {
    if (entry == value) return name;
  }
  throw InternalError("a value without a name: {}", static_cast<int>(value));
}

template <typename Table>
auto ValueIn(const Table& table, const std::string& wanted, const char* what) {
  for (const auto& [entry, name] : table) {
    if (wanted == name) return entry;
  }
  throw InvalidInput("'{}' is no {}", wanted, what);
}

}  // namespace

const char* Name(StopReason reason) { return NameIn(kStopReasons, reason); }
StopReason StopReasonFromName(const std::string& name) { return ValueIn(kStopReasons, name, "stop reason"); }

bool IsFailure(StopReason reason) {
  return reason != StopReason::kStill && reason != StopReason::kMaxChunks && reason != StopReason::kRecordingEnd;
}

const char* Name(Label label) { return NameIn(kLabels, label); }
Label LabelFromName(const std::string& name) { return ValueIn(kLabels, name, "verdict label"); }

std::string EpisodeKey::Id() const {
  return fmt::format("{}/{}/{}@{}/{}-s{}", world, pair.task, pair.policy, pair.checkpoint, pair.initial_state, pair.seed);
}

}  // namespace evac
