#pragma once

#include <string>

#include "reports/gate_decision.h"

namespace evac {

/// What `evac gate` prints: sizes first, a paragraph per rule with its counter-examples (at most 10, then how many
/// more), the outcome last.
std::string GateText(const GateDecision& decision);

}  // namespace evac
