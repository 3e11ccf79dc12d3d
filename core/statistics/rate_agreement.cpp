#include "core/statistics/rate_agreement.h"

#include <algorithm>
#include <cmath>

namespace evac {
namespace {

using Sum = long double;  // squares of any double fit

Number Concordance(const RatePairs& pairs) {
  const Sum n = static_cast<Sum>(pairs.real.size());
  Sum mean_real = 0, mean_sim = 0;
  for (std::size_t i = 0; i < pairs.real.size(); ++i) {
    mean_real += pairs.real[i] / n;
    mean_sim += pairs.sim[i] / n;
  }
  Sum spread = 0, shared = 0;
  for (std::size_t i = 0; i < pairs.real.size(); ++i) {
    const Sum real = pairs.real[i] - mean_real, sim = pairs.sim[i] - mean_sim;
    spread += (real * real + sim * sim) / n;
    shared += real * sim / n;
  }
  const Sum shift = mean_sim - mean_real;
  return Finite(static_cast<double>(2 * shared / (spread + shift * shift)));
}

bool AllOneValue(const RatePairs& pairs) {
  const auto [low_real, high_real] = std::ranges::minmax(pairs.real);
  const auto [low_sim, high_sim] = std::ranges::minmax(pairs.sim);
  return low_real == high_real && low_sim == high_sim && low_real == low_sim;
}

}  // namespace

RateAgreement AgreementOf(const RatePairs& pairs) {
  CheckPairs(pairs.real, pairs.sim);
  RateAgreement result;
  if (pairs.real.empty()) return result;
  const Sum n = static_cast<Sum>(pairs.real.size());
  Sum bias = 0, absolute = 0, squares = 0, largest = 0;
  for (std::size_t i = 0; i < pairs.real.size(); ++i) {
    const Sum difference = Sum{pairs.sim[i]} - Sum{pairs.real[i]};
    bias += difference / n;
    absolute += std::abs(difference) / n;
    squares += difference * difference / n;
    largest = std::max(largest, std::abs(difference));
  }
  result.bias = Finite(static_cast<double>(bias));
  result.mae = Finite(static_cast<double>(absolute));
  result.rmse = Finite(static_cast<double>(std::sqrt(squares)));
  result.max_abs = Finite(static_cast<double>(largest));
  result.ccc = AllOneValue(pairs) ? Number(Undefined{"all rates of both worlds are one value"}) : Concordance(pairs);
  return result;
}

}  // namespace evac
