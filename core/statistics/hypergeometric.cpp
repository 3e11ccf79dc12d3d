#include "core/statistics/hypergeometric.h"

#include <algorithm>
#include <boost/multiprecision/cpp_int.hpp>
#include <numeric>

namespace evac {
namespace {

using Whole = boost::multiprecision::cpp_int;

Whole Choose(std::int64_t n, std::int64_t k) {
  Whole result = 1;
  for (std::int64_t i = 1; i <= std::min(k, n - k); ++i) result = result * (n - std::min(k, n - k) + i) / i;
  return result;
}

/// How many ways lead to x successes in the first group.
Whole Ways(const Margins& margins, std::int64_t x) {
  return Choose(margins.n1, x) * Choose(margins.n2, margins.successes - x);
}

Whole Ways(const HypergeometricTail& tail) {
  const std::int64_t first = tail.lower ? LeastOf(tail.margins) : tail.x;
  const std::int64_t last = tail.lower ? tail.x : MostOf(tail.margins);
  Whole sum = 0;
  for (std::int64_t x = first; x <= last; ++x) sum += Ways(tail.margins, x);
  return sum;
}

Whole AllWays(const Margins& margins) { return Choose(margins.n1 + margins.n2, margins.successes); }

}  // namespace

std::int64_t LeastOf(const Margins& margins) { return std::max<std::int64_t>(0, margins.successes - margins.n2); }
std::int64_t MostOf(const Margins& margins) { return std::min(margins.n1, margins.successes); }

std::vector<long double> HypergeometricPmf(const Margins& margins) {
  const std::int64_t least = LeastOf(margins), most = MostOf(margins);
  std::vector<long double> pmf(static_cast<std::size_t>(most - least) + 1);
  // Each from its neighbour, outwards from the mode: nothing overflows, what underflows is 0.
  const std::int64_t total = margins.n1 + margins.n2;
  const std::int64_t mode = std::clamp((margins.successes + 1) * (margins.n1 + 1) / (total + 2), least, most);
  const auto up = [&](std::int64_t x) {  // P(x + 1) / P(x)
    return static_cast<long double>(margins.n1 - x) * static_cast<long double>(margins.successes - x) /
           (static_cast<long double>(x + 1) * static_cast<long double>(margins.n2 - margins.successes + x + 1));
  };
  const auto at = [&](std::int64_t x) -> long double& { return pmf[static_cast<std::size_t>(x - least)]; };
  at(mode) = 1;
  for (std::int64_t x = mode; x < most; ++x) at(x + 1) = at(x) * up(x);
  for (std::int64_t x = mode; x > least; --x) at(x - 1) = at(x) / up(x - 1);
  const long double sum = std::accumulate(pmf.begin(), pmf.end(), 0.0L);
  for (long double& p : pmf) p /= sum;
  return pmf;
}

bool TailIsAtMost(const HypergeometricTail& a, const HypergeometricTail& b) {
  return Ways(a) * AllWays(b.margins) <= Ways(b) * AllWays(a.margins);
}

bool IsAtMostAsProbable(const Margins& margins, std::int64_t x, std::int64_t y) {
  return Ways(margins, x) <= Ways(margins, y);
}

}  // namespace evac
