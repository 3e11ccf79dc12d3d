#pragma once

#include <string>
#include <vector>

#include "reports/gate_decision.h"
#include "reports/summary.h"

namespace evac {

/// A badge for a README, as SVG of its own (no font, no network): "evac | 71 % [56, 82]".
/// With gates it is the first rule that compares rates, of the worst outcome there is: green for pass, red for fail,
/// grey for inconclusive, and grey where the run has changed since. Without gates: the rate of the run's only policy in
/// its real world (or its only one), blue, because a rate alone is no verdict; with several policies, or several
/// worlds of which none is real, how many policies and episodes there are, grey.
std::string BadgeSvg(const RunSummary& summary, const std::vector<ShownGate>& gates);

}  // namespace evac
