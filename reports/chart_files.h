#pragma once

#include <string>
#include <vector>

#include "reports/report_data.h"

namespace evac {

/// One chart of the page as a file of its own.
struct ChartFile {
  std::string name;  ///< "rates-take_bottle", without ending; letters, digits, '-', '_' only, none twice
  std::string svg;   ///< see AsSvgFile
};

/// Every chart of the page: rates per task, bias per world, worlds compared, states and stages per policy and task,
/// checkpoints. In the order of the page.
std::vector<ChartFile> ChartFilesOf(const ReportData& report);

}  // namespace evac
