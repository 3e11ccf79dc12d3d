#pragma once

#include "core/statistics/estimate.h"
#include "core/statistics/rates.h"

namespace evac {

/// Beta(a, b) of a success rate before the data: {1, 1} is uniform, {1/2, 1/2} Jeffreys.
struct BetaPrior {
  double a = 1, b = 1;
};

/// P(the first rate is above the second), both with this prior, independent (docs/statistics.md). To be printed with
/// the prior; not for gates. A finite sum where a posterior's first parameter is whole and small, else quadrature.
/// @throws InvalidInput for impossible counts or a prior not above 0.
double ProbabilityGreater(const Count& first, const Count& second, const BetaPrior& prior = {});

}  // namespace evac
