#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "core/statistics/estimate.h"
#include "core/statistics/rate_difference.h"
#include "core/statistics/rates.h"

/// Tests and intervals that stay valid however often one looks (docs/statistics.md). An e-value is the money of a bet
/// against "no difference", from 1: under that hypothesis it reaches 1 / alpha with probability at most alpha, ever.
namespace evac {

enum class RateOrder {
  kFirstBelow,  ///< alternative: the first rate is below the second
  kFirstAbove,
  kEither,  ///< mean of the two bets
};

/// Two policies on different initial states, one episode each per step (Turner & Grünwald 2023, Sec. 2): bets with
/// plug-in estimates from Beta(1, 2) and Beta(2, 1), ordered as the alternative says, against the mean of the two.
class TwoRatesBet {
 public:
  explicit TwoRatesBet(RateOrder alternative) : alternative_(alternative) {}
  void Add(bool first, bool second);
  double e_value() const;

 private:
  RateOrder alternative_;
  double steps_ = 0, first_ = 0, second_ = 0;  ///< pairs and successes so far
  double below_ = 1, above_ = 1;               ///< the two one-sided e-values
};

/// Two policies on the same initial states: only flips count, and under "equal" each is a fair coin. Mixture of bets
/// Beta(1/2, 1/2) on the coin: E = 2^(b + c) B(1/2 + b, 1/2 + c) / B(1/2, 1/2). Two-sided. Exact whatever the
/// dependence within a pair, which TwoRatesBet does not allow.
class FlipsBet {
 public:
  /// Pairs that agree change nothing.
  void Add(bool first, bool second);
  double e_value() const;
  std::int64_t only_first() const { return only_first_; }
  std::int64_t only_second() const { return only_second_; }

 private:
  std::int64_t only_first_ = 0, only_second_ = 0;
};
/// The same, for b and c flips at once; at most the largest finite number.
double FlipsEValue(std::int64_t only_first, std::int64_t only_second);

/// A test as it went, one entry per step.
struct SequentialTest {
  std::vector<double> e_values;
  std::vector<double> p_values;              ///< 1 / largest e-value so far, at most 1: valid at every step
  std::optional<std::int64_t> first_reject;  ///< the first step (from 1) with p <= alpha
};
/// @throws InvalidInput if the lengths differ or unless 0 < alpha < 1.
SequentialTest TwoRatesSequential(const std::vector<bool>& first, const std::vector<bool>& second,
                                  RateOrder alternative, double alpha = 0.05);

/// The rates that a Beta(a, b) mixture of bets has not yet refuted: {p: B(a + k, b + n - k) / B(a, b) < p^k
/// (1 - p)^(n - k) / alpha}. Covers at every n at once (Robbins 1970).
struct MixturePrior {
  double a = 0.5, b = 0.5;
};
/// @throws InvalidInput for impossible counts, a prior not above 0, or unless 0 < confidence < 1.
Estimate ConfidenceSequence(const Count& count, double confidence = 0.95, const MixturePrior& prior = {});

/// first - second on the same initial states, one pair of each: both kinds of flips within sequences that share what
/// `confidence` leaves. Covers at every n at once.
Estimate SequentialPairedDifference(const PairedOutcomes& outcomes, double confidence = 0.95);

}  // namespace evac
