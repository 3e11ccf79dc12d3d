#include "core/statistics/two_samples.h"

#include <algorithm>

#include "core/statistics/inverted_interval.h"
#include "core/statistics/rate_difference.h"
#include "core/statistics/two_by_two.h"

namespace evac {

TwoSampleTest BoschlooOrNewcombe(std::span<const Count> first, std::span<const Count> second) {
  const Count one = EffectiveCount(first), two = EffectiveCount(second);
  if (one.trials + two.trials <= kMostExactTrials) {
    const ExactTest exact = BoschlooExact(one, two);
    return {"Boschloo", exact.two_sided, exact.greater, exact.less};
  }
  const IntervalAt difference = [&](double confidence) {
    return NewcombeOfRates(ClusteredWilsonInterval(first, confidence), ClusteredWilsonInterval(second, confidence))
        .interval;
  };
  const double greater = PAbove(difference, 0), less = PBelow(difference, 0);
  return {"Newcombe", std::min(1.0, 2 * std::min(greater, less)), greater, less};
}

}  // namespace evac
