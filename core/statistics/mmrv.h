#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "core/statistics/estimate.h"
#include "core/statistics/rate_pairs.h"

namespace evac {

/// What a violation of the pair (i, j) costs.
enum class MmrvGap {
  kReal,  ///< |R_i - R_j|: the definition; what wrongly preferring one policy costs on the real robot
  kSim,   ///< |S_i - S_j|: what SIMPLER's README computes by calling its function with swapped arguments
};

/// When the pair (i, j) is a violation. They differ only where rates are tied
/// (docs/decisions/0010-mmrv-conventions.md).
enum class MmrvTies {
  kCode,  ///< (S_i > S_j) != (R_i > R_j): SIMPLER's code. A tie in one world violates for one of (i, j), (j, i)
  kSign,  ///< (S_i - S_j)(R_i - R_j) < 0: the signs differ; a tie has no sign and never violates
  kLeq,   ///< (S_i <= S_j) != (R_i <= R_j). Equal to kCode for all numbers, since a <= b is !(a > b); kept by name
  kLess,  ///< (S_i < S_j) != (R_i < R_j): the formula printed in SIMPLER's paper; kCode seen from the other side
};

struct MmrvConvention {
  MmrvGap gap = MmrvGap::kReal;
  MmrvTies ties = MmrvTies::kCode;
};

/// "real_gap", "sim_gap"; "code", "sign", "leq", "less".
const char* Name(MmrvGap gap);
const char* Name(MmrvTies ties);
/// "real_gap, ties code".
std::string Name(const MmrvConvention& convention);

/// Mean maximum rank violation (Li et al. 2024, SIMPLER): mean over i of the largest cost of a violated pair (i, j).
/// 0 is best: nowhere does the tested world rank two policies wrongly. In units of the rates.
struct MmrvResult {
  Number mmrv = Undefined{"no policies"};        ///< one policy gives 0 by the formula: reports refuse that
  Number over_range = Undefined{"no policies"};  ///< mmrv / (max R - min R): comparable between tasks
  std::vector<double> per_policy;                ///< max_j of each i, in the order of the points
  std::int64_t ties_real = 0, ties_sim = 0;      ///< pairs i < j with equal rates
  std::int64_t ties = 0;                         ///< pairs tied in at least one of the two
};

/// @throws InvalidInput if the lengths differ or a value is not finite.
MmrvResult Mmrv(const RatePairs& pairs, const MmrvConvention& convention = {});

}  // namespace evac
