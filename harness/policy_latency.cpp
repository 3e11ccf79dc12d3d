#include "harness/policy_latency.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

namespace evac {

int PolicyLatency::Periods(double thinking_s, double period_s) const {
  if (kind == Kind::kOff) return 0;
  constexpr double kRounding = 1e-6;  // 0.3 s is three periods of 0.1 s
  return static_cast<int>(std::ceil((kind == Kind::kFixed ? fixed_s : thinking_s) / period_s - kRounding));
}

std::string PolicyLatency::Text() const {
  if (kind == Kind::kOff) return "off";
  return kind == Kind::kMeasured ? "measured" : fmt::format("{} s", fixed_s);
}

ActionChunk ExecutedPlan::Execute(const Arms& last, const ActionChunk& chunk, double period_s) {
  const auto periods = static_cast<std::size_t>(latency_.Periods(chunk.thinking_s, period_s));
  const std::size_t gone_on = std::min(periods, left_.size());
  ActionChunk executed;
  executed.targets.assign(left_.begin(), left_.begin() + static_cast<std::ptrdiff_t>(gone_on));
  executed.targets.resize(periods, executed.targets.empty() ? last : Arms(executed.targets.back()));

  const std::size_t size = chunk.targets.size();
  const std::size_t from = std::min(gone_on, size - 1),
                    to = std::min(size, from + static_cast<std::size_t>(chunk_size_));
  const auto at = [&](std::size_t k) { return chunk.targets.begin() + static_cast<std::ptrdiff_t>(k); };
  executed.targets.insert(executed.targets.end(), at(from), at(to));
  executed.ends_recording = chunk.ends_recording && to == size;
  executed.thinking_s = chunk.thinking_s;
  left_.assign(at(to), chunk.targets.end());
  return executed;
}

}  // namespace evac
