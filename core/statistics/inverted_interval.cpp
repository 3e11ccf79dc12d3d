#include "core/statistics/inverted_interval.h"

#include <cmath>

namespace evac {
namespace {

/// Bisection over log alpha; the interval shrinks as alpha grows.
template <typename IsBeyond>
double SmallestAlpha(const IntervalAt& interval, IsBeyond is_beyond) {
  const auto holds = [&](double alpha) {
    const Defined<Interval> at = interval(1 - 2 * alpha);
    return at && is_beyond(*at);
  };
  double yes = 0.4999, no = 1e-9;
  if (!holds(yes)) return 1;
  if (holds(no)) return no;
  for (int halving = 0; halving < 40; ++halving) {
    const double middle = std::sqrt(yes * no);
    (holds(middle) ? yes : no) = middle;
  }
  return yes;
}

}  // namespace

double PBelow(const IntervalAt& interval, double threshold) {
  return SmallestAlpha(interval, [threshold](const Interval& at) { return at.high < threshold; });
}

double PAbove(const IntervalAt& interval, double threshold) {
  return SmallestAlpha(interval, [threshold](const Interval& at) { return at.low > threshold; });
}

}  // namespace evac
