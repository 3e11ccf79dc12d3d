#pragma once

#include "reports/gate_evidence.h"

namespace evac {

/// The rules without a baseline: ci_lower, correlation, judge_kappa, error_share. Fills in what `Examine` began.
void ExamineQuality(const GateRule& rule, const RunSummary& run, const GateSides& sides, Evidence& evidence);

}  // namespace evac
