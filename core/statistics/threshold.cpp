#include "core/statistics/threshold.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdlib>
#include <limits>

#include "core/error.h"

namespace evac {
namespace {

constexpr int kLowest = 5, kHighest = 95;  // hundredths

void Check(std::span<const double> probabilities, std::span<const int> outcomes) {
  if (probabilities.size() != outcomes.size())
    throw InvalidInput("threshold: {} probabilities and {} outcomes", probabilities.size(), outcomes.size());
  for (std::size_t i = 0; i < probabilities.size(); ++i) {
    const bool is_probability = probabilities[i] >= 0 && probabilities[i] <= 1;
    if (!is_probability || (outcomes[i] != 0 && outcomes[i] != 1))
      throw InvalidInput("threshold: item {} has probability {} and outcome {}, wanted one in [0, 1] and 0 or 1", i,
                         probabilities[i], outcomes[i]);
  }
}

}  // namespace

Confusion ConfusionAt(std::span<const double> probabilities, std::span<const int> outcomes, double threshold) {
  Check(probabilities, outcomes);
  Confusion confusion;
  for (std::size_t i = 0; i < probabilities.size(); ++i) {
    const bool called = probabilities[i] >= threshold, is = outcomes[i] == 1;
    ++(called ? is ? confusion.both_success : confusion.only_judge_success
       : is   ? confusion.only_human_success
              : confusion.both_failure);
  }
  return confusion;
}

Number BalancedThreshold(std::span<const double> probabilities, std::span<const int> outcomes) {
  Check(probabilities, outcomes);
  // How many of each outcome reach as many of the thresholds; then, from the highest on, how many reach each.
  std::array<std::array<std::int64_t, kHighest + 2>, 2> reaching{};
  for (std::size_t i = 0; i < probabilities.size(); ++i) {
    int threshold = std::min(static_cast<int>(std::lround(100 * probabilities[i])), kHighest);
    while (threshold >= kLowest && probabilities[i] < threshold / 100.0) --threshold;
    ++reaching[static_cast<std::size_t>(outcomes[i])][static_cast<std::size_t>(std::max(threshold, kLowest - 1))];
  }
  for (auto& of_outcome : reaching) {
    for (std::size_t threshold = kHighest; threshold >= kLowest; --threshold) of_outcome[threshold - 1] += of_outcome[threshold];
  }
  const std::int64_t failures = reaching[0][kLowest - 1], successes = reaching[1][kLowest - 1];
  if (failures == 0 || successes == 0) return Undefined{"all outcomes are alike"};
  std::int64_t least = std::numeric_limits<std::int64_t>::max();
  int best = 50;
  for (int step = 0; step <= 50 - kLowest; ++step) {
    for (const int threshold : {50 - step, 50 + step}) {
      const auto at = static_cast<std::size_t>(threshold);
      // The difference of the two shares, times both counts: whole, so that ties are ties.
      const std::int64_t imbalance = std::abs(reaching[0][at] * successes - (successes - reaching[1][at]) * failures);
      if (imbalance >= least) continue;
      least = imbalance;
      best = threshold;
    }
  }
  return best / 100.0;
}

}  // namespace evac
