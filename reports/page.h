#pragma once

#include <functional>
#include <string>

#include "reports/report_data.h"

namespace evac {

struct PageOptions {
  std::string run_folder;   ///< from the page's folder to the run's, '/' between folders; empty where they are the same
  std::string program;      ///< "evac 0.1.0": who wrote the page
  std::string events = {};  ///< inside a dashboard: where it tells of news, relative to the page; else empty
  std::size_t run = 0;      ///< inside a dashboard: which of its runs this is
  std::string stamp = {};   ///< inside a dashboard: what it tells of the store that the page was counted from
  /// Bytes of a thumbnail of the run, JPEG, to be carried inside the page; empty bytes, or no function: it is linked.
  std::function<std::string(const std::string& file)> embedded = {};
};

/// The report as one HTML file: it opens from disk, needs no network, shows every chart without script, and is the same
/// bytes for the same run. Videos and thumbnails are linked relatively, all else is inside. Its own policy
/// (Content-Security-Policy) forbids every connection and every script but the one that it carries.
std::string ReportPage(const ReportData& report, const PageOptions& options);
/// The same of a run that has been counted only so far.
std::string ReportPage(const RunSummary& summary, const PageOptions& options);

}  // namespace evac
