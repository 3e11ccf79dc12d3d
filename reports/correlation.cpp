#include "reports/correlation.h"

#include <fmt/format.h>

#include <algorithm>
#include <map>

namespace evac {
namespace {

RatePairs RatesOf(const std::vector<CorrelationPoint>& points) {
  RatePairs rates;
  for (const CorrelationPoint& point : points) {
    rates.real.push_back(point.real_sr);
    rates.sim.push_back(point.sim_sr);
  }
  return rates;
}

std::string EqualRates(const char* world, const std::vector<double>& rates) {
  const auto [low, high] = std::ranges::minmax(rates);
  return low == high ? fmt::format("all {} rates are equal ({:.4g})", world, low) : "";
}

/// Why a correlation of these points would say nothing; empty if it would.
std::string WhyNoCorrelation(const RatePairs& rates) {
  const std::size_t n = rates.real.size();
  if (n == 0) return "no points";
  if (n < kMinCorrelationPoints)
    return fmt::format("{} point{}, wanted at least {}", n, n == 1 ? "" : "s", kMinCorrelationPoints);
  const std::string real = EqualRates("real", rates.real);
  return real.empty() ? EqualRates("sim", rates.sim) : real;
}

std::string WhyNoRanks(const RatePairs& rates) {
  const std::size_t n = rates.real.size();
  if (n == 0) return "no points";
  return n < kMinRankPoints ? fmt::format("{} point, wanted at least {}", n, kMinRankPoints) : "";
}

void Withhold(Estimate& estimate, const std::string& reason) {
  if (reason.empty()) return;
  estimate.value = Undefined{reason};
  estimate.interval = Undefined{reason};
}

/// Everything but the intervals that need initial states.
CorrelationGroup Correlate(const std::string& name, std::vector<CorrelationPoint> points,
                           const CorrelationOptions& options) {
  CorrelationGroup group;
  group.group = name;
  group.points = std::move(points);
  group.options = options;
  const RatePairs rates = RatesOf(group.points);
  const double confidence = options.bootstrap.confidence;
  group.pearson = Pearson(rates.real, rates.sim, confidence);
  group.spearman = Spearman(rates.real, rates.sim, confidence);
  group.kendall_tau_b = KendallTauB(rates.real, rates.sim).tau_b;
  group.ranks = Mmrv(rates, options.convention);
  group.distance = AgreementOf(rates);
  group.mmrv = {.value = group.ranks.mmrv,
                .interval = Undefined{"only the rates are known, not the initial states behind them"},
                .method = "none",
                .confidence = confidence,
                .n = static_cast<std::int64_t>(group.points.size())};
  return group;
}

/// Values that hold by arithmetic but say nothing are not reported.
void WithholdTheVacuous(CorrelationGroup& group) {
  const RatePairs rates = RatesOf(group.points);
  const std::string no_correlation = WhyNoCorrelation(rates), no_ranks = WhyNoRanks(rates);
  Withhold(group.pearson, no_correlation);
  Withhold(group.spearman, no_correlation);
  Withhold(group.mmrv, no_ranks);
  if (!no_correlation.empty()) group.kendall_tau_b = Undefined{no_correlation};
  if (!no_ranks.empty()) group.ranks.mmrv = group.ranks.over_range = Undefined{no_ranks};
}

void UseBootstrap(const Defined<BootstrapOf>& bootstrap, const std::string& method, Estimate& estimate,
                  Defined<Interval>& bca) {
  estimate.method = method;
  estimate.interval = bca = Undefined{bootstrap.reason()};
  if (!bootstrap) return;
  estimate.interval = bootstrap->of_record(estimate.confidence);
  bca = bootstrap->not_as_drawn.empty() ? bootstrap->intervals.bca : Undefined{bootstrap->not_as_drawn};
  if (estimate.interval && !bootstrap->not_as_drawn.empty())
    estimate.method += fmt::format(", {}: as far as outcomes that are all alike leave open", bootstrap->not_as_drawn);
}

}  // namespace

std::vector<CorrelationGroup> CorrelatePoints(const std::vector<CorrelationPoint>& points,
                                              const CorrelationOptions& options) {
  std::vector<std::vector<CorrelationPoint>> groups;
  std::map<std::string, std::size_t> places;
  for (const CorrelationPoint& point : points) {
    const auto [place, is_new] = places.emplace(point.group, groups.size());
    if (is_new) groups.emplace_back();
    groups[place->second].push_back(point);
  }
  std::vector<CorrelationGroup> result;
  for (std::vector<CorrelationPoint>& group : groups) {
    const std::string name = group[0].group;
    WithholdTheVacuous(result.emplace_back(Correlate(name, std::move(group), options)));
  }
  return result;
}

CorrelationGroup CorrelateOutcomes(const std::string& name, const std::vector<TaskPoints>& tasks,
                                   const CorrelationOptions& options) {
  std::vector<CorrelationPoint> points;
  std::vector<TaskOutcomes> outcomes;
  for (const TaskPoints& task : tasks) {
    for (CorrelationPoint point : task.points) {
      point.group = name;
      points.push_back(std::move(point));
    }
    outcomes.push_back(task.outcomes);
  }
  CorrelationGroup group = Correlate(name, std::move(points), options);
  const PairedBootstrap bootstrap = PairedStateBootstrap(outcomes, options.convention, options.bootstrap);
  UseBootstrap(bootstrap.pearson, bootstrap.method, group.pearson, group.pearson_bca);
  UseBootstrap(bootstrap.spearman, bootstrap.method, group.spearman, group.spearman_bca);
  UseBootstrap(bootstrap.mmrv, bootstrap.method, group.mmrv, group.mmrv_bca);
  WithholdTheVacuous(group);
  if (bootstrap.pearson && group.pearson.value) group.undefined_replicates = bootstrap.pearson->undefined;
  return group;
}

}  // namespace evac
