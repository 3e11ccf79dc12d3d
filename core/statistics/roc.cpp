#include "core/statistics/roc.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <numeric>
#include <vector>

#include "core/error.h"

namespace evac {

Number AreaUnderRoc(std::span<const double> scores, std::span<const int> outcomes) {
  if (scores.size() != outcomes.size())
    throw InvalidInput("area under ROC: {} scores and {} outcomes", scores.size(), outcomes.size());
  for (std::size_t i = 0; i < scores.size(); ++i) {
    if (!std::isfinite(scores[i]) || (outcomes[i] != 0 && outcomes[i] != 1))
      throw InvalidInput("area under ROC: item {} has score {} and outcome {}, wanted a number and 0 or 1", i,
                         scores[i], outcomes[i]);
  }
  std::vector<std::size_t> order(scores.size());
  std::iota(order.begin(), order.end(), 0);
  std::sort(order.begin(), order.end(), [&](std::size_t a, std::size_t b) { return scores[a] < scores[b]; });
  double successes = 0, rank_sum = 0;  // of the successes, with the mean rank where scores tie
  for (std::size_t begin = 0, end = 0; begin < order.size(); begin = end) {
    while (end < order.size() && scores[order[end]] == scores[order[begin]]) ++end;
    const double rank = 0.5 * static_cast<double>(begin + 1 + end);
    for (std::size_t i = begin; i < end; ++i) {
      successes += outcomes[order[i]];
      rank_sum += outcomes[order[i]] * rank;
    }
  }
  const double failures = static_cast<double>(scores.size()) - successes;
  if (successes == 0 || failures == 0) return Undefined{"all outcomes are alike"};
  return (rank_sum - successes * (successes + 1) / 2) / (successes * failures);
}

}  // namespace evac
