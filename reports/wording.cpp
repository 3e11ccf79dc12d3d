#include "reports/wording.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

namespace evac {
namespace {

constexpr double kRounding = 1e-9;  // per cent: so near to 0 or 100 an end is only by its arithmetic

/// One rounding for all that is said of a difference. No -0.
double WholePoints(double difference) { return std::round(100 * difference) + 0.0; }

}  // namespace

std::string PercentDigits(double share) {
  const double percent = 100 * share;
  const bool near_none = percent > kRounding && percent <= 0.5;
  const bool near_all = percent < 100 - kRounding && percent >= 99.5;
  if (near_none || near_all) return fmt::format("{:.1f}", std::clamp(percent, 0.1, 99.9));
  return fmt::format("{:.0f}", percent);
}

std::string Percent(double share) { return PercentDigits(share) + " %"; }

std::string PercentWithInterval(const Estimate& rate) {
  if (!rate.value) return "undefined: " + rate.value.reason();
  if (!rate.interval) return fmt::format("{} (interval undefined: {})", Percent(*rate.value), rate.interval.reason());
  return fmt::format("{} [{}, {}]", Percent(*rate.value), PercentDigits(rate.interval->low),
                     PercentDigits(rate.interval->high));
}

std::string PointsWithInterval(const Estimate& difference) {
  const auto points = [](double share) { return fmt::format("{:.0f}", WholePoints(share)); };
  if (!difference.value) return "undefined: " + difference.value.reason();
  const double value = WholePoints(*difference.value);
  const std::string text =
      value == 0 ? "0 points" : fmt::format("{:+.0f} {}", value, std::abs(value) == 1 ? "point" : "points");
  if (!difference.interval) return text + " (interval undefined: " + difference.interval.reason() + ")";
  return fmt::format("{} [{}, {}]", text, points(difference.interval->low), points(difference.interval->high));
}

std::string SignedPoints(double difference) { return fmt::format("{:+.0f}", WholePoints(difference)); }

std::string GivenPoints(double share) { return fmt::format("{:g} points", 100 * share); }

std::string GivenPercent(double share) { return fmt::format("{:g} %", 100 * share); }

std::string NumberWithInterval(const Estimate& estimate) {
  if (!estimate.value) return "undefined: " + estimate.value.reason();
  if (!estimate.interval)
    return fmt::format("{} (interval undefined: {})", Plain(*estimate.value), estimate.interval.reason());
  return fmt::format("{} [{}, {}]", Plain(*estimate.value), Plain(estimate.interval->low),
                     Plain(estimate.interval->high));
}

std::string Plain(double value) {
  const std::string text = fmt::format("{:.2f}", value);
  if ((text == "1.00" || text == "-1.00") && std::abs(value) < 1)
    return fmt::format("{:.3f}", std::clamp(value, -0.999, 0.999));
  return text == "-0.00" ? "0.00" : text;
}

std::string PValue(double p) {
  if (p < 0.001) return "p < 0.001";
  return p < 0.01 ? fmt::format("p = {:.3f}", p) : fmt::format("p = {:.2f}", p);
}

std::string OnPairs(const std::string& method, const Repeated& pairs) {
  if (pairs.effective >= pairs.all) return method;
  return fmt::format("{} on {}", method, Counted(pairs.effective, "effective pair"));
}

std::string OnEpisodes(const std::string& method, const Repeated& first, const Repeated& second) {
  if (first.effective >= first.all && second.effective >= second.all) return method;
  return fmt::format("{} on {} and {} effective episodes", method, first.effective, second.effective);
}

std::string Counted(std::int64_t count, const std::string& singular, const std::string& plural) {
  if (count == 1) return "1 " + singular;
  return fmt::format("{} {}", count, plural.empty() ? singular + "s" : plural);
}

}  // namespace evac
