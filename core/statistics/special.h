#pragma once

#include <cstdint>

/// The special functions statistics needs, named for what they mean. Double precision, about 1e-14 relative.
/// All throw InvalidInput outside their domain.
namespace evac {

/// P(Z <= x), Z standard normal.
double NormalCdf(double x);
/// The x with P(Z <= x) = p. @param p in (0, 1).
double NormalQuantile(double p);
/// z of a two-sided interval: Phi^-1(1 - (1 - confidence) / 2); 1.9599… for .95. @param confidence in (0, 1).
double TwoSidedZ(double confidence);

/// Regularised incomplete beta: P(X <= x), X ~ Beta(a, b). @param a, b > 0. @param x in [0, 1].
double BetaCdf(double a, double b, double x);
/// The x with BetaCdf(a, b, x) = p. @param p in [0, 1].
double BetaQuantile(double p, double a, double b);

/// P(X > x), X chi-square with `degrees` degrees of freedom. @param x >= 0. @param degrees > 0.
double ChiSquareTail(double x, double degrees);
/// P(|T| > |t|), T Student with `degrees` degrees of freedom. @param degrees > 0.
double StudentTwoSided(double t, double degrees);
/// The t with P(|T| <= t) = confidence, of a two-sided interval. @param confidence in (0, 1). @param degrees > 0.
double TwoSidedT(double confidence, double degrees);
/// P(X <= k), X ~ Bin(n, 1/2). @param k in [0, n].
double FairBinomialCdf(std::int64_t k, std::int64_t n);
/// P(X = k), X ~ Bin(n, p). @param k in [0, n]. @param p in [0, 1].
double BinomialPmf(std::int64_t k, std::int64_t n, double p);

/// log of n choose k. @param k in [0, n].
double LogChoose(std::int64_t n, std::int64_t k);
/// log B(a, b) = log Gamma(a) + log Gamma(b) - log Gamma(a + b). @param a, b > 0.
double LogBeta(double a, double b);

}  // namespace evac
