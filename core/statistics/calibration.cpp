#include "core/statistics/calibration.h"

#include <algorithm>
#include <cmath>

#include "core/error.h"
#include "core/statistics/special.h"

namespace evac {
namespace {

void Check(std::span<const double> probabilities, std::span<const int> outcomes, const CalibrationOptions& options) {
  if (probabilities.size() != outcomes.size()) {
    throw InvalidInput("statistics: {} probabilities of {} outcomes, wanted the same number", probabilities.size(),
                       outcomes.size());
  }
  if (options.bins < 1) throw InvalidInput("statistics: {} bins, wanted at least 1", options.bins);
  if (!(options.epsilon >= 0 && options.epsilon < 0.5)) {
    throw InvalidInput("statistics: epsilon is {}, wanted 0 <= epsilon < 0.5", options.epsilon);
  }
  for (const double p : probabilities) {
    if (!(p >= 0 && p <= 1)) throw InvalidInput("statistics: probability is {}, wanted 0 <= probability <= 1", p);
  }
  for (const int outcome : outcomes) {
    if (outcome != 0 && outcome != 1) throw InvalidInput("statistics: an outcome of {}, wanted 0 or 1", outcome);
  }
}

/// Brier's standard error over states, never below that of independent items, and the states that have items.
struct Spread {
  double se = 0;
  int states = 0;
};
Spread SpreadOf(const StatedByState& states, double brier, double n) {
  double items = 0, sums = 0;  // of squared deviations: item by item, and summed within each state
  int with_items = 0;
  for (const auto& [state, stated] : states) {
    double sum = 0;
    for (const StatedProbability& item : stated) {
      const double off = item.probability - (item.is_success ? 1 : 0), deviation = off * off - brier;
      items += deviation * deviation;
      sum += deviation;
    }
    sums += sum * sum;
    with_items += !stated.empty();
  }
  const double groups = with_items;
  return {std::sqrt(std::max(groups / (groups - 1) * sums, n / (n - 1) * items)) / n, with_items};
}

}  // namespace

Calibration CalibrationOf(std::span<const double> probabilities, std::span<const int> outcomes,
                          const CalibrationOptions& options) {
  Check(probabilities, outcomes, options);
  Calibration result;
  result.brier.n = std::ssize(probabilities);
  result.brier.value = Undefined{"no items"};
  result.brier.interval = Undefined{"no items"};
  if (probabilities.empty()) return result;
  const double n = static_cast<double>(probabilities.size());
  std::vector<double> excess(static_cast<std::size_t>(options.bins), 0);  // of stated probability over outcomes, by bin
  double brier = 0, log_loss = 0;
  for (std::size_t i = 0; i < probabilities.size(); ++i) {
    const double p = probabilities[i], outcome = outcomes[i];
    const double clipped = std::clamp(p, options.epsilon, 1 - options.epsilon);
    const int bin = std::min(static_cast<int>(std::floor(p * options.bins)), options.bins - 1);
    excess[static_cast<std::size_t>(bin)] += p - outcome;
    brier += (p - outcome) * (p - outcome) / n;
    log_loss -= std::log(outcomes[i] == 1 ? clipped : 1 - clipped) / n;
  }
  double ece = 0;
  for (const double difference : excess) ece += std::abs(difference) / n;
  result.brier.value = brier;
  result.brier.interval = Undefined{"which items are of one initial state is not known"};
  result.ece = ece;
  result.log_loss = Finite(log_loss);
  return result;
}

Calibration CalibrationByState(const StatedByState& states, double confidence) {
  TwoSidedZ(confidence);  // complains
  std::vector<double> probabilities;
  std::vector<int> outcomes;
  for (const auto& [state, stated] : states) {
    for (const StatedProbability& item : stated) {
      probabilities.push_back(item.probability);
      outcomes.push_back(item.is_success ? 1 : 0);
    }
  }
  Calibration result = CalibrationOf(probabilities, outcomes);
  result.brier.method = "Student's t by initial state";
  result.brier.confidence = confidence;
  if (probabilities.empty()) return result;
  const double brier = *result.brier.value;
  const Spread spread = SpreadOf(states, brier, static_cast<double>(probabilities.size()));
  if (spread.states < 2) {
    result.brier.interval = Undefined{"all items are of one initial state"};
    return result;
  }
  if (spread.se < 1e-12) {
    result.brier.interval = Undefined{"the estimated spread is 0"};
    return result;
  }
  const double half = TwoSidedT(confidence, spread.states - 1) * spread.se;
  result.brier.interval = Interval{std::max(0.0, brier - half), std::min(1.0, brier + half)};
  return result;
}

}  // namespace evac
