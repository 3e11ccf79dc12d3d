#pragma once

#include <cmath>
#include <cstdint>
#include <optional>
#include <string>
#include <utility>

namespace evac {

/// A value, or the reason why there is none. Nothing undefined is ever printed as a number.
///   Defined<double> r = Undefined{"all sim rates are equal"};
///   if (r) Print(*r); else Print(r.reason());
struct Undefined {
  std::string reason;
};

template <typename T>
class Defined {
 public:
  Defined(T value) : value_(std::move(value)) {}                          // NOLINT: a value is a Defined
  Defined(Undefined undefined) : reason_(std::move(undefined.reason)) {}  // NOLINT: so is the lack of one

  explicit operator bool() const { return value_.has_value(); }
  /// Only where it is defined.
  const T& operator*() const { return value_.value(); }
  const T* operator->() const { return &value_.value(); }
  /// Empty where it is defined.
  const std::string& reason() const { return reason_; }

 private:
  std::optional<T> value_;
  std::string reason_;
};

using Number = Defined<double>;

/// `value`, or that it is no finite number (an overflow: inputs near 1e308).
inline Number Finite(double value) {
  if (!std::isfinite(value)) return Undefined{"the inputs are too large for a floating-point result"};
  return value;
}

/// Closed: low <= high.
struct Interval {
  double low = 0, high = 1;
};

/// A statistic as it is reported: never without how many observations it rests on and how its interval was made.
struct Estimate {
  Number value = Undefined{"not computed"};
  Defined<Interval> interval = Undefined{"not computed"};
  std::string method;  ///< of the interval: "Wilson", "Fisher z", "paired state bootstrap, percentile, B=2000, seed 0"
  double confidence = 0.95;  ///< of the interval, two-sided, in (0, 1)
  std::int64_t n = 0;        ///< observations: trials of a rate, points of a correlation
};

}  // namespace evac
