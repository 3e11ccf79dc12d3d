#include "core/statistics/mcnemar.h"

#include <algorithm>
#include <cmath>

#include "core/error.h"
#include "core/statistics/special.h"

namespace evac {

McNemar McNemarExact(const Flips& flips) {
  const std::int64_t b = flips.only_first, c = flips.only_second, n = b + c, least = std::min(b, c);
  if (least < 0) throw InvalidInput("statistics: {} and {} discordant pairs, wanted none below 0", b, c);
  McNemar test;
  if (n == 0) return test;

  const double at_most = FairBinomialCdf(least, n);
  const double below = least > 0 ? FairBinomialCdf(least - 1, n) : 0;
  test.p_exact = std::min(1.0, 2 * at_most);
  test.p_mid = b == c ? 1 : below + at_most;  // 2 P(<) + P(=)

  const double difference = std::abs(static_cast<double>(b - c)), discordant = static_cast<double>(n);
  const double chi2 = difference * difference / discordant;
  test.chi2 = chi2;
  test.p_chi2 = ChiSquareTail(chi2, 1);
  test.chi2_corrected = (difference - 1) * (difference - 1) / discordant;
  return test;
}

}  // namespace evac
