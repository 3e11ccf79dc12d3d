#pragma once

#include <map>
#include <span>
#include <vector>

#include "core/statistics/confusion.h"
#include "core/statistics/estimate.h"

/// How far a judge's stated probabilities of success can be believed: docs/statistics.md.
namespace evac {

struct Calibration {
  Estimate brier;                      ///< mean (p - outcome)²
  Number ece = Undefined{"no items"};  ///< expected calibration error over equal bins of p, [i / bins, (i + 1) / bins)
  Number log_loss = Undefined{"no items"};  ///< with p clipped to [epsilon, 1 - epsilon]
};
struct CalibrationOptions {
  int bins = 10;
  double epsilon = 1e-6;
};
/// Without an interval: which items are of one initial state is not known.
/// @param probabilities in [0, 1]. @param outcomes 1 success, 0 failure, of the same length.
/// @throws InvalidInput for anything else.
Calibration CalibrationOf(std::span<const double> probabilities, std::span<const int> outcomes,
                          const CalibrationOptions& options = {});

/// What a judge stated of an item, and what became of it.
struct StatedProbability {
  double probability = 0;  ///< of success, in [0, 1]
  bool is_success = false;
};
using StatedByState = std::map<StateKey, std::vector<StatedProbability>>;
/// The same of all, and Brier's interval over other initial states, made as kappa's is (StatisticsByState), within 0 … 1;
/// none where all losses are equal, and short of what it promises where few are large (docs/statistics.md).
/// ECE has none: of few items it is above 0 even where the probabilities are right, so no interval about it holds the true
/// one.
Calibration CalibrationByState(const StatedByState& states, double confidence = 0.95);

}  // namespace evac
