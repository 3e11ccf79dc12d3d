#pragma once

#include <cstdint>
#include <vector>

#include "core/statistics/estimate.h"
#include "core/statistics/rate_difference.h"
#include "core/statistics/rates.h"

/// The real success rate from few real trials and many imagined ones: prediction-powered inference
/// (Angelopoulos et al. 2023; docs/statistics.md).
/// Y: real outcomes, G: the world model's on the *same* initial states (n of them), H: the world model's on N more.
namespace evac {

/// The n states tried in both worlds.
struct BothWorlds {
  std::int64_t both = 0, only_real = 0, only_model = 0, neither = 0;  ///< by who succeeded
  std::int64_t n() const { return both + only_real + only_model + neither; }
  std::int64_t discordant() const { return only_real + only_model; }
};

/// How much the world model is believed.
enum class PpiWeight {
  kRealOnly,  ///< lambda = 0: the real trials alone ("classical")
  kFull,      ///< lambda = 1 (PPI, Angelopoulos et al. 2023)
  kTuned,     ///< lambda = clip(cov(Y, G) / ((1 + n / N) var(G and H)), 0, 1) (PPI++, 2024)
};

/// lambda mean(H) + mean(Y - lambda G). An *estimate*: its normal interval is here to be compared with other programs',
/// and under-covers badly at the sizes of robot labs (docs/statistics.md): show PpiMover or PpiBetting.
struct PpiEstimate {
  Number tuned_lambda = Undefined{"not tuned"};  ///< before clipping; undefined where no model outcome varies
  double lambda = 0;
  Number value = Undefined{"no real trials"};
  Number se = Undefined{"no real trials"};
  Defined<Interval> normal = Undefined{"no real trials"};   ///< value ± z se, not clipped; width 0 if nothing varies
  Defined<Interval> allowed = Undefined{"no real trials"};  ///< the same, clipped; undefined below 40 real trials or 5
                                                            ///< discordant pairs and where it would have no width:
                                                            ///< where it may not be shown
};
/// @param more  H. Without any, lambda is 0 except for kFull, which is undefined.
/// @throws InvalidInput for impossible counts and unless 0 < confidence < 1.
PpiEstimate PpiMean(const BothWorlds& paired, const Count& more, PpiWeight weight, double confidence = 0.95);

/// The interval of record: lambda = 1, MOVER of Wilson's on H and Tango's on Y - G, ends clipped to [0, 1]; the value
/// is not. @throws as PpiMean.
Estimate PpiMover(const BothWorlds& paired, const Count& more, double confidence = 0.95);

/// Outcomes that repeat initial states: the pairs of each, and the further ones of each that was not tried for real.
struct PpiStates {
  std::vector<BothWorlds> paired;
  std::vector<Count> more;
  BothWorlds Paired() const;  ///< of all states together
  Count More() const { return SumOf(more); }
};
/// As PpiMean of all together, but for what they tell: se and intervals are over initial states (errors of Y - lambda G
/// and of H summed within each before they are squared, G / (G - 1) times, never below those of independent outcomes), and
/// `allowed` asks for 40 states tried for real and 5 in which the worlds differ. One outcome a state: as PpiMean.
PpiEstimate PpiMeanByState(const PpiStates& states, PpiWeight weight, double confidence = 0.95);
/// As PpiMover, with Wilson's and Tango's intervals on effective numbers; the value is of all.
Estimate PpiMoverByState(const PpiStates& states, double confidence = 0.95);

/// One real trial and the world model's answer in the same state.
struct BothOutcomes {
  bool real = false, model = false;
};

struct PpiBettingOptions {
  double confidence = 0.95;
  std::uint64_t seed = 0;  ///< of the shuffle of pairs and of further outcomes
};
/// Covers at every n: a betting interval of Z_t = Y_t + lambda_t (H_t - G_t), H_t the mean of pair t's share of the
/// further outcomes and lambda_t in [0, 1] tuned on the pairs before t, so that every Z_t has mean p. Clipped to [0,
/// 1]. Its value is PPI++'s. Few further outcomes (less than one per pair) leave lambda 0 for the pairs without.
/// @throws as PpiMean.
Estimate PpiBetting(const std::vector<BothOutcomes>& paired, const std::vector<bool>& more,
                    const PpiBettingOptions& options = {});

/// The table of such pairs.
BothWorlds TableOf(const std::vector<BothOutcomes>& paired);

}  // namespace evac
