#pragma once

#include <string>

#include "core/statistics/estimate.h"
#include "core/statistics/rates.h"

/// How numbers are written for people. Nothing undefined becomes a digit.
namespace evac {

/// "90 %", "0 %"; one decimal, from 0.1 to 99.9, where it would otherwise read 0 or 100 and is neither.
std::string Percent(double share);
/// The same without its unit, as the ends of intervals are written: "90", "99.9".
std::string PercentDigits(double share);
/// "90 % [70, 97]"; "undefined: no trials".
std::string PercentWithInterval(const Estimate& rate);
/// A difference of shares: "+30 points [10, 48]", "-3 points [-12, 5]"; "undefined: …".
std::string PointsWithInterval(const Estimate& difference);
/// Alone, rounded as there (halves away from 0): "+30", "-3", "+0"; no "-0".
std::string SignedPoints(double difference);
/// What somebody asked for, as it was given: "10 points", "12.5 points", "0.5 points".
std::string GivenPoints(double share);
/// The same of a share: "90 %", "12.5 %".
std::string GivenPercent(double share);
/// "0.91 [0.78, 0.97]"; "0.91 (interval undefined: …)"; "undefined: …".
std::string NumberWithInterval(const Estimate& estimate);
/// "0.91", "-0.05": two decimals, no "-0.00"; "0.999" and less, cut, where it would otherwise
/// read as a perfect 1.00.
std::string Plain(double value);
/// "p = 0.04", "p < 0.001".
std::string PValue(double p);
/// "exact McNemar"; "exact McNemar on 4 effective pairs" where repeats of initial states make them tell less.
std::string OnPairs(const std::string& method, const Repeated& pairs);
/// The same of two samples: "Boschloo", "Boschloo on 4 and 6 effective episodes".
std::string OnEpisodes(const std::string& method, const Repeated& first, const Repeated& second);
/// "1 episode", "3 episodes".
std::string Counted(std::int64_t count, const std::string& singular, const std::string& plural = "");

}  // namespace evac
