#pragma once

#include <cstdint>
#include <string>
#include <vector>

/// What the intervals and tests promise, tried out on made-up data whose truth is known. One call is one table of
/// docs/statistics.md; `stat_coverage` prints them all.
namespace evac::coverage {

struct SimulationOptions {
  int replicates = 2000;
  std::uint64_t seed = 1;
};

/// How often a method's interval held the truth.
struct Coverage {
  std::string method;
  double share = 0;  ///< of the replicates with an interval
  double mean_width = 0;
  int without = 0;  ///< replicates in which the method gave no interval
};
struct Row {
  std::string setting;  ///< "p .9, agreement .9"
  int n = 0;
  std::vector<Coverage> methods;
};

/// One rate: Wilson, Clopper-Pearson, Jeffreys; n = 10 … 100, p = .5 … .95.
std::vector<Row> Rates(const SimulationOptions& options);
/// Two rates on the same states: Tango, Bonett-Price; on different states: Newcombe.
std::vector<Row> Differences(const SimulationOptions& options);
/// Kappa of a judge who errs alike in clips of one initial state: by state and as if all clips were independent; n states.
std::vector<Row> Kappas(const SimulationOptions& options);
/// Sensitivity of the same judge, by state and as if all clips were independent, and its Brier's score by state.
std::vector<Row> SensitivitiesAndBriers(const SimulationOptions& options);
/// The real rate from n real trials and 10 n further imagined ones: Wilson on the real ones alone, PPI++'s normal
/// interval, MOVER, betting.
std::vector<Row> FewReal(const SimulationOptions& options);
/// Pearson's r over 6 policies, with outcomes of n initial states: the paired state bootstrap, percentile and BCa,
/// against the r of the true rates, and against the r that rates of n states have on average.
std::vector<Row> Bootstrap(const SimulationOptions& options);

/// How often a test of two equal policies ever raised a false alarm when it was looked at after every step.
struct FalseAlarms {
  std::string test, setting;
  double share = 0;
};
std::vector<FalseAlarms> Peeking(const SimulationOptions& options);

}  // namespace evac::coverage
