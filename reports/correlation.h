#pragma once

#include <optional>
#include <string>
#include <vector>

#include "core/statistics/association.h"
#include "core/statistics/paired_bootstrap.h"
#include "core/statistics/rate_agreement.h"

/// Does a world tell which policies are better? Points (one policy on one task, its rate in both worlds) to Pearson,
/// Spearman and MMRV, each with its interval or the reason why it has none. Read this file first of
/// pairs_csv.h (points from a file), run_correlation.h (points from a run) and correlation_output.h (JSON, text).
namespace evac {

struct CorrelationPoint {
  std::string group;  ///< points are compared within their group only
  std::string task, policy;
  double real_sr = 0;              ///< success rate in the reference world
  double sim_sr = 0;               ///< success rate in the world under test
  std::optional<Count> real, sim;  ///< what the rates were counted from, where that is known
};

struct CorrelationOptions {
  MmrvConvention convention;
  BootstrapOptions bootstrap;  ///< used where initial states are known
};

struct CorrelationGroup {
  std::string group;
  std::vector<CorrelationPoint> points;
  std::vector<std::string> left_out;  ///< "take_bottle, hold@: no pair of episodes has a verdict in both worlds"

  Estimate pearson, spearman, mmrv;
  Defined<Interval> pearson_bca = Undefined{"not bootstrapped"};  ///< beside the percentile interval in `pearson`
  Defined<Interval> spearman_bca = Undefined{"not bootstrapped"};
  Defined<Interval> mmrv_bca = Undefined{"not bootstrapped"};
  std::int64_t undefined_replicates = 0;  ///< of Pearson's bootstrap, dropped; 0 where Pearson is undefined
  MmrvResult ranks;                       ///< mmrv over the range of the real rates, ties
  Number kendall_tau_b = Undefined{"no points"};
  RateAgreement distance;
  CorrelationOptions options;
};

/// Two points make every correlation ±1 or undefined, and one policy has no rank: such numbers would say nothing.
inline constexpr std::size_t kMinCorrelationPoints = 3, kMinRankPoints = 2;

/// Points of which only the rates are known, group by group in the order of first appearance. Intervals: Fisher's z
/// for Pearson, Bonett-Wright for Spearman, none for MMRV.
std::vector<CorrelationGroup> CorrelatePoints(const std::vector<CorrelationPoint>& points,
                                              const CorrelationOptions& options = {});

/// One task's points with their outcomes in each initial state: points[i] has outcomes.points[i].
struct TaskPoints {
  std::vector<CorrelationPoint> points;
  TaskOutcomes outcomes;
};
/// Points whose initial states are known, as one group. Intervals: paired state bootstrap.
CorrelationGroup CorrelateOutcomes(const std::string& group, const std::vector<TaskPoints>& tasks,
                                   const CorrelationOptions& options = {});

}  // namespace evac
