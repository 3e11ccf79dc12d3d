#pragma once

#include <cstdint>
#include <vector>

/// The 2 x 2 tables with given margins, compared exactly. What Fisher's and Boschloo's tests are made of.
namespace evac {

/// Sizes of the two groups and how many successes they have together.
struct Margins {
  std::int64_t n1 = 0, n2 = 0, successes = 0;
};

/// Successes of the first group that these margins allow: [least, most].
std::int64_t LeastOf(const Margins& margins);
std::int64_t MostOf(const Margins& margins);

/// P(first group has x successes), for x = least … most; sums to 1. About 1e-16 relative.
std::vector<long double> HypergeometricPmf(const Margins& margins);

/// A one-sided Fisher p: at most x (`lower`), or at least x, successes in the first group.
struct HypergeometricTail {
  Margins margins;
  std::int64_t x = 0;
  bool lower = true;
};

/// Whether a's probability is at most b's, in integers of any size. Slow: for what floating point cannot decide.
bool TailIsAtMost(const HypergeometricTail& a, const HypergeometricTail& b);
/// Whether P(x) <= P(y) under the same margins, in integers of any size.
bool IsAtMostAsProbable(const Margins& margins, std::int64_t x, std::int64_t y);

/// Floating point decides where the two differ by more than this share; beyond it they may be equal.
inline constexpr long double kClearlyDifferent = 1e-12L;

}  // namespace evac
