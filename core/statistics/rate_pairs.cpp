#include "core/statistics/rate_pairs.h"

#include <cmath>

#include "core/error.h"

namespace evac {

void CheckPairs(std::span<const double> x, std::span<const double> y) {
  if (x.size() != y.size()) {
    throw InvalidInput("statistics: sequences of {} and {} values, wanted the same length", x.size(), y.size());
  }
  for (std::size_t i = 0; i < x.size(); ++i) {
    if (!std::isfinite(x[i]) || !std::isfinite(y[i])) {
      throw InvalidInput("statistics: pair {} is ({}, {}), wanted finite numbers", i, x[i], y[i]);
    }
  }
}

}  // namespace evac
