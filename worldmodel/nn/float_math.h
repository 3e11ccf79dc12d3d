#pragma once

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdint>

/// Functions of one float that a compiler can turn into vector code.
namespace evac::nn::kernels {

/// e^x to 2e-7, for x between the bounds; beyond them it stays that of the bound. What is no number stays none (hence
/// the order of the arguments).
inline float ExponentialWithin(float least, float most, float x) {
  const float bounded = std::min(std::max(x, least), most);
  const float shifted = bounded * 1.44269504F + 12582912.0F;  // rounds to a whole number in the low bits
  const float whole = shifted - 12582912.0F;
  const float rest = (bounded - whole * 0.693359375F) + whole * 2.12194440e-4F;
  float power = 1.9875691500e-4F;
  power = power * rest + 1.3981999507e-3F;
  power = power * rest + 8.3334519073e-3F;
  power = power * rest + 4.1665795894e-2F;
  power = power * rest + 1.6666665459e-1F;
  power = power * rest + 5.0000001201e-1F;
  power = power * rest * rest + rest + 1.0F;
  return power * std::bit_cast<float>((static_cast<std::int32_t>(whole) + 127) << 23);
}

/// From -87 to 88. Below it is 0 for all that is done with it; above it stays that of 88, so that 1 / (1 + e^x) is 0 to
/// 1e-38.
inline float Exponential(float x) { return ExponentialWithin(-87.0F, 88.0F, x); }

/// From -80 to 60, for activations: 1 / (1 + e^x) is 0 to 1e-26. A compiler may go on with a bound for every number and
/// choose afterwards; where floats end (-87, 88) what it goes on with is denormal, and each such number costs an Intel
/// processor a hundred cycles (docs/performance.md).
inline float MildExponential(float x) { return ExponentialWithin(-80.0F, 60.0F, x); }

/// Error function to 1.5e-7 (Abramowitz and Stegun 7.1.26).
inline float ErrorFunction(float x) {
  const float size = std::fabs(x);
  const float t = 1.0F / (1.0F + 0.3275911F * size);
  float polynomial = 1.061405429F;
  polynomial = polynomial * t - 1.453152027F;
  polynomial = polynomial * t + 1.421413741F;
  polynomial = polynomial * t - 0.284496736F;
  polynomial = polynomial * t + 0.254829592F;
  const float value = 1.0F - polynomial * t * MildExponential(-size * size);
  return x < 0 ? -value : value;
}

}  // namespace evac::nn::kernels
