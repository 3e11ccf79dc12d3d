#pragma once

#include <string>
#include <vector>

#include "apps/networks/fidelity.h"

namespace evac {

/// When replays of a closed loop's actions end (ReplayRun::rule).
inline constexpr const char* kToTheLastAction = "to the last action";
/// The tasks as they are replayed so: no stop rule, and no limit that the actions of an episode could reach. The rule would
/// end a replay in a world model, where arms are commanded and not observed, a chunk before it ends the one in reality. What
/// is said here follows from the suite alone: a run's tasks are the same in every call.
std::vector<Task> ToTheLastAction(std::vector<Task> tasks, const Suite& suite);

/// Actions that succeeded, changed so that they must fail, and the tasks they are replayed in.
struct Counterfactual {
  std::string name;         ///< shifted, never_closes, object_away
  std::vector<Task> tasks;  ///< object_away: with the object taken away
  std::vector<Replay> replays;
};

/// `shifted`: 6 cm beside, in a direction that task and state decide; `never_closes`: the hand stays open; `object_away`:
/// nothing is there. What becomes of them in reality is found out, not assumed.
/// @param successes  replays of real episodes that succeeded
/// @param per_task   of them at most so many, drawn at random whoever's they are
std::vector<Counterfactual> Counterfactuals(std::vector<Replay> successes, const std::vector<Task>& tasks, int per_task);

struct LongRollout {
  int per_task = 3;
  std::size_t frames = 480;
};
/// Recorded actions there and back again, until they are so long.
std::vector<Replay> LongRollouts(std::vector<Replay> replays, const LongRollout& how);

}  // namespace evac
