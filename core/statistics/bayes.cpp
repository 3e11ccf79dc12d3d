#include "core/statistics/bayes.h"

#include <algorithm>
#include <boost/math/quadrature/tanh_sinh.hpp>
#include <cmath>

#include "core/error.h"
#include "core/statistics/special.h"

namespace evac {
namespace {

BetaPrior Posterior(const Count& count, const BetaPrior& prior) {
  CheckCount(count);
  if (!(prior.a > 0 && prior.b > 0 && std::isfinite(prior.a) && std::isfinite(prior.b))) {
    throw InvalidInput("statistics: a prior Beta({}, {}), wanted both above 0", prior.a, prior.b);
  }
  return {prior.a + static_cast<double>(count.successes),
          prior.b + static_cast<double>(count.trials - count.successes)};
}

/// P(X > Y) for whole x.a: sum_{i < x.a} B(y.a + i, x.b + y.b) / ((x.b + i) B(1 + i, x.b) B(y.a, y.b)).
double FiniteSum(const BetaPrior& x, const BetaPrior& y) {
  double sum = 0;
  for (double i = 0; i < x.a; ++i) {
    sum += std::exp(LogBeta(y.a + i, x.b + y.b) - std::log(x.b + i) - LogBeta(1 + i, x.b) - LogBeta(y.a, y.b));
  }
  return std::clamp(sum, 0.0, 1.0);
}

/// The mean of y's distribution function over x, by x's own probabilities: bounded, and its ends are what tanh-sinh is
/// made for, whatever the parameters.
double Quadrature(const BetaPrior& x, const BetaPrior& y) {
  boost::math::quadrature::tanh_sinh<double> integrator;
  const auto integrand = [&](double u) { return BetaCdf(y.a, y.b, BetaQuantile(u, x.a, x.b)); };
  return std::clamp(integrator.integrate(integrand, 0.0, 1.0, 1e-11), 0.0, 1.0);
}

bool IsSummable(double a) { return a == std::floor(a) && a <= 1000; }

}  // namespace

double ProbabilityGreater(const Count& first, const Count& second, const BetaPrior& prior) {
  const BetaPrior x = Posterior(first, prior), y = Posterior(second, prior);
  if (IsSummable(x.a)) return FiniteSum(x, y);
  if (IsSummable(y.a)) return 1 - FiniteSum(y, x);
  return Quadrature(x, y);
}

}  // namespace evac
