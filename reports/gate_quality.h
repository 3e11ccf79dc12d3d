#pragma once

#include "reports/gate_evidence.h"

namespace evac {

/// A success rate as gates hold it: clustered Wilson, but no surer than where all outcomes of as many states are alike,
/// each of which counts once. One that is not would make all trials count, as repeats do not look alike any more: a floor
/// that all successes do not reach would be reached by failing once.
Estimate RateOfStates(const std::vector<Count>& states, double confidence);

/// The rules without a baseline: ci_lower, correlation, judge_kappa, error_share. Fills in what `Examine` began.
void ExamineQuality(const GateRule& rule, const RunSummary& run, const GateSides& sides, Evidence& evidence);

}  // namespace evac
