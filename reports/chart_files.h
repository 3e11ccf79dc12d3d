#pragma once

#include <string>
#include <vector>

#include "reports/drawing.h"
#include "reports/report_data.h"

namespace evac {

/// One chart of the page as a file of its own.
struct ChartFile {
  std::string name;  ///< "rates-take_bottle", without ending; letters, digits, '-', '_' only, none twice
  std::string svg;   ///< see AsSvgFile
};

/// A chart that is to become a file. @param name  becomes the file's, what does not fit replaced by '_'
struct NamedDrawing {
  std::string name, title;
  Drawing drawing;
};
/// Names that would be the same get a number.
std::vector<ChartFile> AsFiles(const std::vector<NamedDrawing>& drawings);

/// Whether ChartFilesOf a run could have made it. @param name  without ending
bool IsChartFile(const std::string& name, const std::string& svg);

/// Every chart of the page: rates per task, bias per world, worlds compared, states and stages per policy and task,
/// checkpoints. In the order of the page.
std::vector<ChartFile> ChartFilesOf(const ReportData& report);

}  // namespace evac
