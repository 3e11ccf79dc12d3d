#pragma once

#include <cstdint>
#include <set>
#include <string>
#include <vector>

#include "core/statistics/rate_difference.h"
#include "core/statistics/rates.h"
#include "reports/outcome.h"

namespace evac {

struct RateCell;

/// Two policies on one task in one world, held against each other.
struct PolicyContest {
  std::string world, task;
  std::string first, second;       ///< the one with the higher rate first
  bool is_paired = false;          ///< by (state, seed); else as two samples
  std::string test;                ///< "exact McNemar", "Boschloo", "Newcombe"
  PairedOutcomes pairs;            ///< the shared ones
  std::int64_t shared_states = 0;  ///< initial states with a pair
  Repeated shared;                 ///< the pairs, where paired, and how many independent ones the test is of
  Repeated first_episodes, second_episodes;  ///< the same of those that count, where not paired
  bool first_leads = false;                  ///< in what was tested: the flips, or the effective rates
  double p = 1;                              ///< of "they succeed equally often", two-sided
  double p_holm = 1;                         ///< over all contests of the world, of all its tasks
};

/// What letters rest on.
struct LetterTests {
  std::int64_t pairs = 0;  ///< in the largest family of a world; 0: nobody to differ from
  std::set<std::string> unpaired_tests = {};  ///< of those that were compared as two samples: "Boschloo", "Newcombe"
  std::vector<PolicyContest> contests = {};   ///< by world, then task
};

/// Gives each cell its letters: within a task and a world, policies share one exactly if their difference is not
/// significant (compact letter display, Piepho 2004). Exact McNemar over the (state, seed) pairs where both count; where
/// fewer than 80 % are shared, BoschlooOrNewcombe over all that count, as `evac compare` does. Both on the effective
/// number where initial states repeat. Holm over all pairs of policies that a world shows, over all its tasks.
/// @param alpha  in (0, 1): of the whole family
LetterTests GiveLetters(const std::vector<JudgedEpisode>& episodes, double alpha, std::vector<RateCell>& cells);

}  // namespace evac
