#pragma once

#include <cstdint>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "reports/report_data.h"

/// What a dashboard shows beside the reports themselves: its first page, with all runs and their history.
namespace evac {

/// One run, counted for the list.
struct DashboardRun {
  std::string name;     ///< as it was given
  std::string problem;  ///< why it cannot be read; empty where it can
  std::string stamp;    ///< of the store that it was counted from (dashboard_run.h)
  std::string suite_hash;
  std::int64_t episodes = 0, judged = 0, errors = 0;
  std::string reference;            ///< the real world's name; empty if there is none
  std::vector<std::string> worlds;  ///< all that are declared
  std::vector<RateCell> rates;      ///< over all tasks: `task` is empty
  std::string verdict;              ///< the answer to "is the candidate worse?", first item
};

DashboardRun DashboardRunOf(const std::string& name, const ReportData& report);

/// The list of runs, and for every policy its success rate from run to run, in the order given.
std::string DashboardIndex(const std::vector<DashboardRun>& runs, const std::string& program);
/// The same for programs: {"runs": [{"name", "episodes", …, "rates": [{"policy", "world", estimate}]}]}.
nlohmann::ordered_json DashboardHistory(const std::vector<DashboardRun>& runs);

}  // namespace evac
