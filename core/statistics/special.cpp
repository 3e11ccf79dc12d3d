#include "core/statistics/special.h"

#include <boost/math/distributions/binomial.hpp>
#include <boost/math/distributions/chi_squared.hpp>
#include <boost/math/distributions/normal.hpp>
#include <boost/math/distributions/students_t.hpp>
#include <boost/math/special_functions/beta.hpp>
#include <boost/math/special_functions/gamma.hpp>
#include <cmath>

#include "core/error.h"

namespace evac {
namespace {

void Require(bool holds, const char* name, double found, const char* wanted) {
  if (!holds) throw InvalidInput("statistics: {} is {}, wanted {}", name, found, wanted);
}

/// The distribution function rises through `is_below` to 1; found to the last bit in log x, so that tiny ones are
/// exact.
template <typename IsBelow>
double BisectLog(IsBelow is_below) {
  double low = -745, high = 0;  // log of the smallest double … of 1
  for (int halving = 0; halving < 200; ++halving) {
    const double middle = (low + high) / 2;
    (is_below(std::exp(middle)) ? low : high) = middle;
  }
  return std::exp((low + high) / 2);
}

/// What Boost's root finder gives up on: shapes so lopsided that the quantile is next to 0 or 1.
double SlowBetaQuantile(double p, double a, double b) {
  if (boost::math::ibeta(a, b, 0.5) >= p) return BisectLog([&](double x) { return boost::math::ibeta(a, b, x) < p; });
  return 1 - BisectLog([&](double rest) { return boost::math::ibetac(b, a, rest) > p; });
}

}  // namespace

double NormalCdf(double x) {
  Require(!std::isnan(x), "x", x, "a number");
  return std::erfc(-x / std::sqrt(2.0)) / 2;
}

double NormalQuantile(double p) {
  Require(p > 0 && p < 1, "probability", p, "0 < p < 1");
  return boost::math::quantile(boost::math::normal(), p);
}

double TwoSidedZ(double confidence) {
  Require(confidence > 0 && confidence < 1, "confidence", confidence, "0 < confidence < 1");
  return boost::math::quantile(boost::math::complement(boost::math::normal(), (1 - confidence) / 2));
}

double BetaCdf(double a, double b, double x) {
  Require(a > 0 && std::isfinite(a), "a", a, "above 0");
  Require(b > 0 && std::isfinite(b), "b", b, "above 0");
  Require(x >= 0 && x <= 1, "x", x, "0 <= x <= 1");
  return boost::math::ibeta(a, b, x);
}

double BetaQuantile(double p, double a, double b) {
  Require(a > 0 && std::isfinite(a), "a", a, "above 0");
  Require(b > 0 && std::isfinite(b), "b", b, "above 0");
  Require(p >= 0 && p <= 1, "probability", p, "0 <= p <= 1");
  try {
    return boost::math::ibeta_inv(a, b, p);
  } catch (const boost::math::evaluation_error&) {
    return SlowBetaQuantile(p, a, b);
  }
}

double ChiSquareTail(double x, double degrees) {
  Require(x >= 0, "x", x, "x >= 0");
  Require(degrees > 0, "degrees of freedom", degrees, "above 0");
  return boost::math::cdf(boost::math::complement(boost::math::chi_squared(degrees), x));
}

double StudentTwoSided(double t, double degrees) {
  Require(!std::isnan(t), "t", t, "a number");
  Require(degrees > 0, "degrees of freedom", degrees, "above 0");
  return 2 * boost::math::cdf(boost::math::complement(boost::math::students_t(degrees), std::abs(t)));
}

double TwoSidedT(double confidence, double degrees) {
  Require(confidence > 0 && confidence < 1, "confidence", confidence, "0 < confidence < 1");
  Require(degrees > 0 && std::isfinite(degrees), "degrees", degrees, "above 0");
  return boost::math::quantile(
      boost::math::complement(boost::math::students_t(degrees), (1 - confidence) / 2));
}

double FairBinomialCdf(std::int64_t k, std::int64_t n) {
  Require(n >= 0, "n", static_cast<double>(n), "n >= 0");
  Require(k >= 0 && k <= n, "k", static_cast<double>(k), "0 <= k <= n");
  if (k == n) return 1;
  return boost::math::cdf(boost::math::binomial(static_cast<double>(n), 0.5), static_cast<double>(k));
}

double BinomialPmf(std::int64_t k, std::int64_t n, double p) {
  Require(n >= 0, "n", static_cast<double>(n), "n >= 0");
  Require(k >= 0 && k <= n, "k", static_cast<double>(k), "0 <= k <= n");
  Require(p >= 0 && p <= 1, "probability", p, "0 <= p <= 1");
  return boost::math::pdf(boost::math::binomial(static_cast<double>(n), p), static_cast<double>(k));
}

double LogChoose(std::int64_t n, std::int64_t k) {
  Require(n >= 0, "n", static_cast<double>(n), "n >= 0");
  Require(k >= 0 && k <= n, "k", static_cast<double>(k), "0 <= k <= n");
  const auto log_factorial = [](std::int64_t m) { return boost::math::lgamma(static_cast<double>(m) + 1); };
  return log_factorial(n) - log_factorial(k) - log_factorial(n - k);
}

double LogBeta(double a, double b) {
  Require(a > 0 && std::isfinite(a), "a", a, "above 0");
  Require(b > 0 && std::isfinite(b), "b", b, "above 0");
  return boost::math::lgamma(a) + boost::math::lgamma(b) - boost::math::lgamma(a + b);
}

}  // namespace evac
