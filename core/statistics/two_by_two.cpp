#include "core/statistics/two_by_two.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "core/error.h"
#include "core/statistics/hypergeometric.h"

namespace evac {
namespace {

constexpr std::int64_t kMostTrials = 5000;

__extension__ using Wide = __int128;  // d² s (N - s) of 5000 trials needs 75 bits

struct Table {
  std::int64_t x1 = 0, x2 = 0, n1 = 0, n2 = 0;
  Margins margins() const { return {n1, n2, x1 + x2}; }
};

Table Checked(const Count& first, const Count& second) {
  CheckCount(first);
  CheckCount(second);
  if (first.trials + second.trials > kMostTrials) {
    throw InvalidInput("statistics: an exact test of {} and {} trials, wanted at most {} together", first.trials,
                       second.trials, kMostTrials);
  }
  return {first.successes, second.successes, first.trials, second.trials};
}

/// A set of tables with n1 and n2 trials, as the log of its weight by total of successes: P(set) = sum_s exp(weight_s)
/// p^s (1 - p)^(N - s).
class Region {
 public:
  /// @param contains  (x1, x2) → whether the table belongs to the set.
  template <typename Contains>
  Region(const Table& table, Contains contains) : total_(table.n1 + table.n2) {
    for (std::int64_t s = 0; s <= total_; ++s) {
      const Margins margins{table.n1, table.n2, s};
      const std::vector<long double> pmf = HypergeometricPmf(margins);
      long double share = 0;
      for (std::size_t i = 0; i < pmf.size(); ++i) {
        const std::int64_t x1 = LeastOf(margins) + static_cast<std::int64_t>(i);
        if (contains(x1, s - x1)) share += pmf[i];
      }
      log_weight_.push_back(std::log(share) + LogWays(s));
    }
  }

  /// The largest probability of the set under any common rate: a fine grid in arcsin sqrt(p), where every bump of the
  /// polynomial has about the same width, then each summit by golden section.
  double WorstCase() const {
    const int steps = 400 + static_cast<int>(40 * std::sqrt(static_cast<double>(total_)));
    std::vector<long double> height;
    for (int i = 0; i <= steps; ++i) height.push_back(At(Angle(i, steps)));
    long double best = std::ranges::max(height);
    if (best > 1 - 1e-15L) return 1;  // all tables: a plateau has no summit
    for (int i = 0; i <= steps; ++i) {
      const int left = std::max(i - 1, 0), right = std::min(i + 1, steps);
      const bool is_summit = height[i] >= height[left] && height[i] >= height[right];
      if (is_summit && height[i] > 0.99L * best) best = std::max(best, Summit(Angle(left, steps), Angle(right, steps)));
    }
    return static_cast<double>(std::min(best, 1.0L));
  }

 private:
  static long double Angle(int i, int steps) {
    return std::numbers::pi_v<long double> / 2 * static_cast<long double>(i) / static_cast<long double>(steps);
  }
  long double LogWays(std::int64_t s) const {
    const auto log_factorial = [](std::int64_t m) { return std::lgamma(static_cast<long double>(m) + 1); };
    return log_factorial(total_) - log_factorial(s) - log_factorial(total_ - s);
  }
  long double At(long double angle) const {
    const long double success = 2 * std::log(std::sin(angle)), failure = 2 * std::log(std::cos(angle));
    long double sum = 0;
    for (std::int64_t s = 0; s <= total_; ++s) {
      const long double weight = log_weight_[static_cast<std::size_t>(s)];
      if (std::isinf(weight)) continue;
      // 0 log 0 = 0 at the ends, where the rate is exactly 0 or 1
      const long double log_p = (s == 0 ? 0 : static_cast<long double>(s) * success) +
                                (s == total_ ? 0 : static_cast<long double>(total_ - s) * failure);
      sum += std::exp(weight + log_p);
    }
    return sum;
  }
  long double Summit(long double low, long double high) const {
    const long double golden = (std::sqrt(5.0L) - 1) / 2;
    long double best = 0;
    for (int step = 0; step < 60; ++step) {
      const long double a = high - golden * (high - low), b = low + golden * (high - low);
      const long double at_a = At(a), at_b = At(b);
      best = std::max({best, at_a, at_b});
      (at_a < at_b ? low : high) = at_a < at_b ? a : b;
    }
    return best;
  }

  std::int64_t total_;
  std::vector<long double> log_weight_;
};

/// sign(z) z² n1 n2 / N of the pooled z, as the fraction numerator / denominator with denominator > 0.
struct SquaredZ {
  Wide numerator = 0, denominator = 1;
};
SquaredZ SquaredZOf(const Table& table) {
  const std::int64_t s = table.x1 + table.x2, rest = table.n1 + table.n2 - s;
  const Wide d = Wide{table.x1} * table.n2 - Wide{table.x2} * table.n1;
  if (s == 0 || rest == 0) return {};
  return {d < 0 ? -d * d : d * d, Wide{s} * rest};
}
bool IsAtLeast(const SquaredZ& a, const SquaredZ& b) {
  return a.numerator * b.denominator >= b.numerator * a.denominator;
}
SquaredZ Negative(const SquaredZ& z) { return {-z.numerator, z.denominator}; }
SquaredZ Absolute(const SquaredZ& z) { return z.numerator < 0 ? Negative(z) : z; }

long double TailProbability(const HypergeometricTail& tail) {
  const std::vector<long double> pmf = HypergeometricPmf(tail.margins);
  const auto at = pmf.begin() + (tail.x - LeastOf(tail.margins));
  long double sum = 0;  // from the far end inwards: small terms first
  if (tail.lower) {
    for (auto p = pmf.begin(); p <= at; ++p) sum += *p;
  } else {
    for (auto p = pmf.end(); p-- > at;) sum += *p;
  }
  return std::min(sum, 1.0L);
}

/// Boschloo's p on one side: the worst case of "Fisher's p on that side is at most this table's".
double BoschlooOneSided(const Table& table, bool lower) {
  const HypergeometricTail observed{table.margins(), table.x1, lower};
  const long double limit = TailProbability(observed);
  std::vector<long double> tails;  // of the total at hand, by x1
  const auto is_as_extreme = [&](std::int64_t x1, std::int64_t x2) {
    const Margins margins{table.n1, table.n2, x1 + x2};
    const std::int64_t least = LeastOf(margins);
    if (x1 == least) {
      tails = HypergeometricPmf(margins);
      if (lower) {
        for (std::size_t i = 1; i < tails.size(); ++i) tails[i] += tails[i - 1];
      } else {
        for (std::size_t i = tails.size(); i-- > 1;) tails[i - 1] += tails[i];
      }
    }
    const long double p = std::min(tails[static_cast<std::size_t>(x1 - least)], 1.0L);
    if (std::abs(p - limit) > kClearlyDifferent * limit) return p < limit;
    return TailIsAtMost({margins, x1, lower}, observed);
  };
  return Region(table, is_as_extreme).WorstCase();
}

}  // namespace

ExactTest FisherExact(const Count& first, const Count& second) {
  const Table table = Checked(first, second);
  if (table.n1 == 0 || table.n2 == 0) return {};
  const Margins margins = table.margins();
  const std::vector<long double> pmf = HypergeometricPmf(margins);
  const std::int64_t least = LeastOf(margins);
  const long double observed = pmf[static_cast<std::size_t>(table.x1 - least)];
  long double two_sided = 0;
  for (std::size_t i = 0; i < pmf.size(); ++i) {
    const bool is_clear = std::abs(pmf[i] - observed) > kClearlyDifferent * observed;
    const std::int64_t x = least + static_cast<std::int64_t>(i);
    if (is_clear ? pmf[i] < observed : IsAtMostAsProbable(margins, x, table.x1)) two_sided += pmf[i];
  }
  return {.two_sided = static_cast<double>(std::min(two_sided, 1.0L)),
          .greater = static_cast<double>(TailProbability({margins, table.x1, false})),
          .less = static_cast<double>(TailProbability({margins, table.x1, true}))};
}

ExactTest BarnardExact(const Count& first, const Count& second) {
  const Table table = Checked(first, second);
  if (table.n1 == 0 || table.n2 == 0) return {};
  const SquaredZ observed = SquaredZOf(table);
  const auto z = [&](std::int64_t x1, std::int64_t x2) { return SquaredZOf({x1, x2, table.n1, table.n2}); };
  const auto worst = [&](auto contains) { return Region(table, contains).WorstCase(); };
  return {.two_sided = worst([&](auto x1, auto x2) { return IsAtLeast(Absolute(z(x1, x2)), Absolute(observed)); }),
          .greater = worst([&](auto x1, auto x2) { return IsAtLeast(z(x1, x2), observed); }),
          .less = worst([&](auto x1, auto x2) { return IsAtLeast(Negative(z(x1, x2)), Negative(observed)); })};
}

ExactTest BoschlooExact(const Count& first, const Count& second) {
  const Table table = Checked(first, second);
  if (table.n1 == 0 || table.n2 == 0) return {};
  ExactTest test;
  test.greater = BoschlooOneSided(table, false);
  test.less = BoschlooOneSided(table, true);
  test.two_sided = std::min(1.0, 2 * std::min(test.greater, test.less));
  return test;
}

double PooledZ(const Count& first, const Count& second) {
  CheckCount(first);
  CheckCount(second);
  const double n1 = static_cast<double>(first.trials), n2 = static_cast<double>(second.trials), n = n1 + n2;
  const double s = static_cast<double>(first.successes + second.successes);
  if (n1 == 0 || n2 == 0 || s == 0 || s == n) return 0;
  const double p = s / n;
  const double difference = static_cast<double>(first.successes) / n1 - static_cast<double>(second.successes) / n2;
  return difference / std::sqrt(p * (1 - p) * (1 / n1 + 1 / n2));
}

}  // namespace evac
