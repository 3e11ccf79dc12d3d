#pragma once

#include <functional>

#include "core/statistics/estimate.h"

/// Tests by an interval: what it leaves out is rejected.
namespace evac {

/// An interval at any confidence, two-sided.
using IntervalAt = std::function<Defined<Interval>(double confidence)>;
/// One-sided p of "the value is at least `threshold`": the smallest alpha at which the interval of confidence 1 - 2
/// alpha ends below it; 1 where none of alpha < .5 does, and never below 1e-9.
double PBelow(const IntervalAt& interval, double threshold);
/// The same of "at most".
double PAbove(const IntervalAt& interval, double threshold);

}  // namespace evac
