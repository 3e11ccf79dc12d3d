#include "core/statistics/association.h"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "core/statistics/rate_pairs.h"
#include "core/statistics/special.h"

namespace evac {
namespace {

using Sum = long double;  // 64 bits of mantissa and exponents to 1e4932: squares of any double fit

/// Points exactly on a line come out within this of |r| = 1; rates that are not on a line never come so near.
constexpr double kOnALine = 1e-15;

Undefined TooFewOrConstant(std::span<const double> x, std::span<const double> y) {
  if (x.size() < 2) return Undefined{x.empty() ? "no points" : "only one point"};
  const auto is_constant = [](std::span<const double> values) {
    return std::ranges::min(values) == std::ranges::max(values);
  };
  if (is_constant(x) && is_constant(y)) return Undefined{"all values of both sequences are equal"};
  if (is_constant(x)) return Undefined{"all values of the first sequence are equal"};
  if (is_constant(y)) return Undefined{"all values of the second sequence are equal"};
  return Undefined{};
}

Sum Mean(std::span<const double> values) {
  return std::accumulate(values.begin(), values.end(), Sum{0}) / static_cast<Sum>(values.size());
}

double ProductMoment(std::span<const double> x, std::span<const double> y) {
  const Sum mean_x = Mean(x), mean_y = Mean(y);
  Sum xy = 0, xx = 0, yy = 0;
  for (std::size_t i = 0; i < x.size(); ++i) {
    const Sum dx = x[i] - mean_x, dy = y[i] - mean_y;
    xy += dx * dy;
    xx += dx * dx;
    yy += dy * dy;
  }
  const Sum r = std::clamp(xy / (std::sqrt(xx) * std::sqrt(yy)), Sum{-1}, Sum{1});
  return static_cast<double>(1 - std::abs(r) <= kOnALine ? std::copysign(Sum{1}, r) : r);
}

/// tanh(atanh(r) ± z se).
Defined<Interval> FisherInterval(double r, double se, double confidence) {
  const double z = TwoSidedZ(confidence), centre = std::atanh(r);
  return Interval{std::tanh(centre - z * se), std::tanh(centre + z * se)};
}

/// Why Fisher's transform gives no interval, or nothing.
Undefined NoFisherInterval(const Estimate& r) {
  if (!r.value) return Undefined{r.value.reason()};
  if (r.n <= 3) return Undefined{"fewer than 4 points"};
  if (std::abs(*r.value) == 1) return Undefined{"the points lie exactly on a line or in one order"};
  return Undefined{};
}

Estimate Correlation(std::span<const double> x, std::span<const double> y, double confidence) {
  CheckPairs(x, y);
  Estimate result;
  result.confidence = confidence;
  result.n = static_cast<std::int64_t>(x.size());
  const Undefined undefined = TooFewOrConstant(x, y);
  result.value = undefined.reason.empty() ? Finite(ProductMoment(x, y)) : Number(undefined);
  return result;
}

}  // namespace

Estimate Pearson(std::span<const double> x, std::span<const double> y, double confidence) {
  Estimate result = Correlation(x, y, confidence);
  result.method = "Fisher z";
  const Undefined undefined = NoFisherInterval(result);
  result.interval = undefined;
  if (undefined.reason.empty()) {
    const double se = 1 / std::sqrt(static_cast<double>(result.n) - 3);
    result.interval = FisherInterval(*result.value, se, confidence);
  }
  return result;
}

Estimate Spearman(std::span<const double> x, std::span<const double> y, double confidence) {
  CheckPairs(x, y);
  Estimate result = Correlation(AverageRanks(x), AverageRanks(y), confidence);
  result.method = "Bonett-Wright";
  const Undefined undefined = NoFisherInterval(result);
  result.interval = undefined;
  if (undefined.reason.empty()) {
    const double r = *result.value;
    const double se = std::sqrt((1 + r * r / 2) / (static_cast<double>(result.n) - 3));
    result.interval = FisherInterval(r, se, confidence);
  }
  return result;
}

Number PearsonPValue(const Estimate& pearson) {
  if (!pearson.value) return Undefined{pearson.value.reason()};
  if (pearson.n <= 2) return Undefined{"fewer than 3 points"};
  const double r = *pearson.value, degrees = static_cast<double>(pearson.n) - 2;
  if (std::abs(r) == 1) return Undefined{"the points lie exactly on a line"};
  return StudentTwoSided(r * std::sqrt(degrees / ((1 - r) * (1 + r))), degrees);
}

Kendall KendallTauB(std::span<const double> x, std::span<const double> y) {
  CheckPairs(x, y);
  Kendall result;
  for (std::size_t i = 0; i < x.size(); ++i) {
    for (std::size_t j = i + 1; j < x.size(); ++j) {
      const int order_x = (x[i] > x[j]) - (x[i] < x[j]), order_y = (y[i] > y[j]) - (y[i] < y[j]);
      result.concordant += order_x * order_y > 0;
      result.discordant += order_x * order_y < 0;
      result.ties_x += order_x == 0;
      result.ties_y += order_y == 0;
    }
  }
  const Undefined undefined = TooFewOrConstant(x, y);
  result.tau_b = undefined;
  if (!undefined.reason.empty()) return result;
  const double n = static_cast<double>(x.size()), pairs = n * (n - 1) / 2;
  const double untied_x = pairs - static_cast<double>(result.ties_x),
               untied_y = pairs - static_cast<double>(result.ties_y);
  result.tau_b =
      static_cast<double>(result.concordant - result.discordant) / (std::sqrt(untied_x) * std::sqrt(untied_y));
  return result;
}

std::vector<double> AverageRanks(std::span<const double> values) {
  std::vector<std::size_t> order(values.size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  std::ranges::sort(order, {}, [&](std::size_t i) { return values[i]; });
  std::vector<double> ranks(values.size());
  for (std::size_t first = 0, last = 0; first < order.size(); first = last) {
    while (last < order.size() && values[order[last]] == values[order[first]]) ++last;
    const double shared_rank = (static_cast<double>(first + 1) + static_cast<double>(last)) / 2;
    for (std::size_t i = first; i < last; ++i) ranks[order[i]] = shared_rank;
  }
  return ranks;
}

}  // namespace evac
