#pragma once

#include <cstdint>
#include <string>
#include <vector>

/// What the intervals and tests promise, tried out on made-up data whose truth is known. One call is one table of
/// docs/statistics.md or of docs/decisions/0012-interval-of-record.md; `stat_coverage` prints them all.
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

/// In what share of the replicates, by a rule as it was and as it is.
struct BeforeAndNow {
  double before = 0, now = 0;
};

/// How often the gate's rule "MMRV at most .1", alpha .05, passed two policies.
struct MmrvPasses {
  std::string setting;  ///< true rates: "0.9 0.5, 0.5 0.9", real and sim
  int states = 0;
  double truth = 0;  ///< MMRV of the true rates; above .1 a pass is false
  BeforeAndNow passes;
};
/// Before: the percentile interval alone; now: the one of record. 120 draws each.
std::vector<MmrvPasses> PassesOfMmrv(const SimulationOptions& options);

/// 90 % intervals of the difference of two policies whose pairs repeat initial states.
struct RepeatedDifference {
  std::string setting;  ///< states x repeats and the rates of flips: "20 x 4, 0 and 0.05", better and worse
  double rho = 0;       ///< the repeats of a state are copies with this probability
  double truth = 0;
  BeforeAndNow covered;  ///< the interval held the truth
  BeforeAndNow shown;    ///< "not worse by 10 points"
};
/// Before: Tango's interval of EffectivePairs; now: TangoOfClusters.
std::vector<RepeatedDifference> DifferencesOfRepeats(const SimulationOptions& options);

}  // namespace evac::coverage
