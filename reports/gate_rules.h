#pragma once

#include <optional>
#include <string>
#include <vector>

#include "core/config.h"

/// The rules of a gate: one YAML file (docs/gate.md). What they decide: gate.h.
namespace evac {

enum class GateTest {
  kPairedMcnemar,   ///< fails when exact McNemar shows the candidate worse; passes when it is shown to be not worse by
                    ///< margin
  kBoschloo,        ///< the same on different initial states
  kSavi,            ///< the same as a bet that may be looked at after every episode
  kNonInferiority,  ///< passes and fails by the interval of the difference against -margin
  kCiLower,         ///< the candidate's own rate against at_least
  kCorrelation,     ///< of the world's rates with the real world's, against at_least (mmrv: at_most)
  kJudgeKappa,      ///< agreement of the judge with another, against at_least
  kErrorShare,      ///< episodes that could not go on, counted, against at_most
};
/// "paired_mcnemar", "boschloo", "savi", "noninferiority", "ci_lower", "correlation", "judge_kappa", "error_share".
const char* Name(GateTest test);

enum class OnInconclusive { kWarn, kFail };

struct GateRule {
  std::string name;  ///< "bottle.sim"; unique in the file
  GateTest test = GateTest::kPairedMcnemar;
  std::string metric;           ///< success_rate, pearson, spearman, mmrv, kappa, error_share
  std::string task;             ///< empty: all tasks together
  std::string world;            ///< empty: the run's only one
  std::string policy;           ///< "name@checkpoint"; empty: the run's only one, for the last three tests all of them;
                                ///< always empty for correlation
  std::string baseline_policy;  ///< empty: the same name if the baseline has it, else its only one
  std::string against = "human";  ///< judge_kappa: the other judge, none of those that `judge` names
  bool is_paired = true;          ///< noninferiority; the other tests say it themselves
  double alpha = 0.05;            ///< risk of a false "fail" (after the correction) and of a false "pass", in (0, 0.5)
  double margin = 0.1;            ///< how much worse is not worse, in (0, 1)
  std::optional<double> at_least, at_most;
  int min_states = 0;          ///< fewer (task, initial state) that count, whatever the seeds: inconclusive; of
                               ///< error_share all that were tried count
  double max_error_share = 1;  ///< more errors among the episodes: inconclusive; error_share has at_most for it
  OnInconclusive on_inconclusive = OnInconclusive::kWarn;

  /// Whether it holds the candidate against a baseline, and whether state by state.
  bool Compares() const;
  bool ComparesPairs() const;
};

enum class GateCorrection { kHolm, kNone };

struct GateRules {
  std::string name;  ///< of the gate: decisions are kept under it
  std::string judge = "oracle";
  GateCorrection correction = GateCorrection::kHolm;  ///< of the failing p-values over the rules
  std::vector<GateRule> rules;
  std::string hash;  ///< SHA-256 of what the file means, its name too where it says none, whatever layout and comments
};

/// @throws InvalidInput naming file, line, field, what was found and what was wanted.
GateRules ReadGateRules(const Config& page);

}  // namespace evac
