#pragma once

#include <chrono>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "core/policy.h"
#include "policies/messages.h"
#include "policies/spec.h"

namespace evac {

/// One scene's episode as LcmPolicy sees it, and the one request that is under way in it.
struct LcmLane {
  using Clock = std::chrono::steady_clock;

  Task task;                      ///< as the policy sees it: with the cameras it declared
  std::vector<std::size_t> sent;  ///< which of the observation's images those are
  episode_start_t start;
  bool has_started = false;
  std::string server;  ///< who acknowledged the start
  observation_t header;
  std::vector<image_t> images;
  std::optional<Acted> answer = ActionChunk{};  ///< of the request under way; set: nobody waits
  bool gave_up = false;                         ///< the answer is policy_timeout
  int sendings = 0;
  int stale_replies = 0;  ///< to earlier requests, while this one waited
  double wait_s = 0;      ///< from the last sending to the next
  Clock::time_point send_at;
  Clock::time_point answerable_at;  ///< when it was first sent: its start is acknowledged by then
  double slept_s = 0;               ///< how long this process was stopped since then

  /// The request that comes next, not sent yet. @param jpeg_quality  nothing: raw images.
  /// @throws InternalError if the observation lacks an image.
  void Begin(const Observation& observation, std::optional<int> jpeg_quality, double repeat_after_s);
  /// The policy has acknowledged the start: the request itself goes out now.
  void Started(const std::string& by, double repeat_after_s);
  /// Since it was first sent, awake.
  double Waited_s() const;
};

/// Who begins what.
struct LcmEpisode {
  std::string client;
  std::int64_t number = 0;
  int lane = 0;
  std::uint64_t seed = 0;
};

/// @param policy  its declaration: only the cameras it wants are kept.
LcmLane MakeLcmLane(const LcmEpisode& episode, const Task& task, const PolicySpec& policy);

}  // namespace evac
