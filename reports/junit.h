#pragma once

#include <string>
#include <vector>

#include "reports/gate_decision.h"
#include "reports/summary.h"

namespace evac {

/// The run for CI services that read JUnit's XML (docs/formats/junit_xml.md; docs/formats/junit.xsd is its schema).
///
/// With gates: a suite is a task ("all tasks" for rules over all of them), a case is a rule; `failure` holds the
/// numbers and the counter-examples, inconclusive is `skipped` with what would decide. Without: a suite is a task, a
/// case is a policy in a world; `error` if episodes could not go on, `skipped` where none counts. `system-out` has the
/// rate. `time` is 0: no clock is read.
std::string JunitXml(const RunSummary& summary, const std::vector<ShownGate>& gates);

}  // namespace evac
