#pragma once

#include <string>

#include "reports/summary.h"

namespace evac {

struct PageOptions {
  std::string run_folder;  ///< from the page's folder to the run's, '/' between folders; empty where they are the same
  std::string program;     ///< "evac 0.1.0": who wrote the page
};

/// The report as one HTML file: it opens from disk, needs no network, reads without script, and is the same bytes for
/// the same run. Videos and thumbnails are linked relatively, all else is inside.
std::string ReportPage(const RunSummary& summary, const PageOptions& options);

}  // namespace evac
