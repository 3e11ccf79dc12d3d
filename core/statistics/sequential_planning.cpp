#include "core/statistics/sequential_planning.h"

#include <algorithm>
#include <cmath>

#include "core/error.h"
#include "core/statistics/sequential.h"
#include "core/statistics/special.h"

namespace evac {
namespace {

void Check(const FlipRates& rates, const Promise& promise) {
  const auto [first, second] = rates;
  if (!(first >= 0 && second >= 0 && first + second <= 1 + 1e-12)) {
    throw InvalidInput("statistics: flips of {} and {} of the pairs, wanted shares of together at most 1", first,
                       second);
  }
  const auto is_share = [](double x) { return x > 0 && x < 1; };
  if (is_share(promise.alpha) && is_share(promise.power)) return;
  throw InvalidInput("statistics: alpha is {} and power {}, wanted both between 0 and 1", promise.alpha, promise.power);
}

/// What n pairs show whose flips lean this many standard errors further to the second than the rates say.
PairedOutcomes Leaning(std::int64_t n, const FlipRates& rates, double errors) {
  const double pairs = static_cast<double>(n), d = rates.only_first - rates.only_second,
               sum = rates.only_first + rates.only_second;
  const double half = errors * std::sqrt(pairs * std::max(0.0, sum - d * d)) / 2;
  const auto whole = [n](double flips) { return std::clamp<std::int64_t>(std::llround(flips), 0, n); };
  const std::int64_t first = whole(pairs * rates.only_first - half);
  return {{first, std::min(whole(pairs * rates.only_second + half), n - first)}, n};
}

/// The smallest size that decides, by doubling and halving.
template <typename Decides>
SampleSize Smallest(std::int64_t most, Decides decides) {
  std::int64_t no = 0, yes = 1;
  while (!decides(yes)) {
    if (yes == most) return {.exact = Undefined{fmt::format("more than {}", most)}, .n = 0};
    no = yes;
    yes = std::min(most, yes * 2);
  }
  while (yes - no > 1) {
    const std::int64_t middle = no + (yes - no) / 2;
    (decides(middle) ? yes : no) = middle;
  }
  return {.exact = static_cast<double>(yes), .n = yes};
}

}  // namespace

SampleSize PairsForFlipsBet(const FlipRates& rates, const Promise& promise, std::int64_t most) {
  Check(rates, promise);
  if (rates.only_first == rates.only_second) return {.exact = Undefined{"both flips are equally frequent"}, .n = 0};
  const double side = rates.only_first > rates.only_second ? 1 : -1;
  return Smallest(most, [&](std::int64_t n) {
    const auto [first, second] = Leaning(n, rates, side * NormalQuantile(promise.power)).flips;
    return side * static_cast<double>(first - second) > 0 && FlipsEValue(first, second) >= 1 / promise.alpha;
  });
}

SampleSize PairsForSequentialNonInferiority(const FlipRates& rates, double margin, const Promise& promise,
                                            std::int64_t most) {
  Check(rates, promise);
  if (!(margin > 0 && margin < 1)) throw InvalidInput("statistics: margin is {}, wanted 0 < margin < 1", margin);
  if (rates.only_second - rates.only_first >= margin)
    return {.exact = Undefined{"the rates are further apart than the margin"}, .n = 0};
  const double away = NormalQuantile(promise.power);
  return Smallest(most, [&](std::int64_t n) {
    const Estimate difference = SequentialPairedDifference(Leaning(n, rates, away), 1 - promise.alpha);
    return difference.interval->low > -margin;
  });
}

}  // namespace evac
