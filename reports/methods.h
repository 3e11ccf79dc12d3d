#pragma once

#include <string>

#include "reports/report_data.h"

namespace evac {

/// A paragraph for a paper: what was run, counted and tested, naming exactly the tests behind this report and no
/// others. Plain text, ready to paste.
std::string MethodsParagraph(const ReportData& report);

}  // namespace evac
