#include "core/statistics/mmrv.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

namespace evac {
namespace {

struct Point {
  double real, sim;
};

bool Violates(const Point& i, const Point& j, MmrvTies ties) {
  switch (ties) {
    case MmrvTies::kCode:
      return (i.sim > j.sim) != (i.real > j.real);
    case MmrvTies::kSign:
      return (i.sim < j.sim && i.real > j.real) || (i.sim > j.sim && i.real < j.real);
    case MmrvTies::kLeq:
      return (i.sim <= j.sim) != (i.real <= j.real);
    case MmrvTies::kLess:
      return (i.sim < j.sim) != (i.real < j.real);
  }
  return false;
}

double Cost(const Point& i, const Point& j, const MmrvConvention& convention) {
  if (!Violates(i, j, convention.ties)) return 0;
  return convention.gap == MmrvGap::kReal ? std::abs(i.real - j.real) : std::abs(i.sim - j.sim);
}

void CountTies(const RatePairs& pairs, MmrvResult& result) {
  for (std::size_t i = 0; i < pairs.real.size(); ++i) {
    for (std::size_t j = i + 1; j < pairs.real.size(); ++j) {
      const bool real = pairs.real[i] == pairs.real[j], sim = pairs.sim[i] == pairs.sim[j];
      result.ties_real += real;
      result.ties_sim += sim;
      result.ties += real || sim;
    }
  }
}

Number OverRange(const Number& mmrv, const std::vector<double>& real) {
  if (!mmrv) return Undefined{mmrv.reason()};
  const auto [low, high] = std::ranges::minmax(real);
  if (low == high) return Undefined{"all real rates are equal"};
  return Finite(*mmrv / (high - low));
}

}  // namespace

const char* Name(MmrvGap gap) { return gap == MmrvGap::kReal ? "real_gap" : "sim_gap"; }

const char* Name(MmrvTies ties) {
  switch (ties) {
    case MmrvTies::kCode:
      return "code";
    case MmrvTies::kSign:
      return "sign";
    case MmrvTies::kLeq:
      return "leq";
    case MmrvTies::kLess:
      return "less";
  }
  return "unknown";
}

std::string Name(const MmrvConvention& convention) {
  return fmt::format("{}, ties {}", Name(convention.gap), Name(convention.ties));
}

MmrvResult Mmrv(const RatePairs& pairs, const MmrvConvention& convention) {
  CheckPairs(pairs.real, pairs.sim);
  MmrvResult result;
  if (pairs.real.empty()) return result;
  const std::size_t n = pairs.real.size();
  long double total = 0;
  for (std::size_t i = 0; i < n; ++i) {
    double worst = 0;
    for (std::size_t j = 0; j < n; ++j) {
      worst = std::max(worst, Cost({pairs.real[i], pairs.sim[i]}, {pairs.real[j], pairs.sim[j]}, convention));
    }
    result.per_policy.push_back(worst);
    total += worst;
  }
  result.mmrv = Finite(static_cast<double>(total / static_cast<long double>(n)));
  result.over_range = OverRange(result.mmrv, pairs.real);
  CountTies(pairs, result);
  return result;
}

}  // namespace evac
