#include "reports/dashboard_run.h"

#include <fmt/format.h>

#include <algorithm>

#include "core/error.h"
#include "core/store.h"
#include "reports/html.h"
#include "reports/page.h"
#include "reports/page_parts.h"
#include "reports/report_json.h"

namespace evac {
namespace fs = std::filesystem;
namespace {

std::string ProblemPage(const std::string& problem, const PageOptions& page) {
  return PageHead("No report", PageScripts::kLive) + LiveBody(page) + "<main><p>" + Escaped(problem) +
         "</p><p class=\"live\" role=\"status\"></p></main>\n<script>" + PageScript(PageScripts::kLive) +
         "</script></body></html>\n";
}

}  // namespace

std::string StampOf(const fs::path& run) {
  std::string stamp;
  for (const char* name : {"evac.sqlite", "evac.sqlite-wal"}) {
    std::error_code error;
    const auto size = fs::file_size(run / name, error);
    const auto time = fs::last_write_time(run / name, error);
    stamp += error || size == 0 ? "none " : fmt::format("{}@{} ", size, time.time_since_epoch().count());
  }
  return stamp;
}

WatchedRun::WatchedRun(fs::path folder, std::size_t index, SummaryOptions options, std::string program)
    : folder_(std::move(folder)), index_(index), options_(std::move(options)), program_(std::move(program)) {}

WatchedRun::Content WatchedRun::Now() {
  const std::lock_guard lock(mutex_);
  const std::string stamp = StampOf(folder_);  // before reading: what is written meanwhile is news next time
  if (stamp != stamp_) {
    content_ = Count(stamp);
    content_.summary.stamp = stamp;
    stamp_ = stamp;
  }
  return content_;
}

WatchedRun::Content WatchedRun::Count(const std::string& stamp) const {
  const PageOptions page{"files", program_, "../../events", index_, stamp};
  try {
    const ReportData report = ReportDataOf(Summarise(ReadRun(Store::Open(folder_, Store::Mode::kReadOnly)), options_));
    return {ReportPage(report, page), ReportJson(report, program_), DashboardRunOf(folder_.string(), report)};
  } catch (const Error& error) {  // not begun yet, or being made: said where it would stand
    Content content;
    content.summary.name = folder_.string();
    content.summary.problem = error.what();
    content.page = ProblemPage(error.what(), page);
    content.json = nlohmann::ordered_json{{"problem", error.what()}}.dump(
                       -1, ' ', false, nlohmann::ordered_json::error_handler_t::replace) +
                   "\n";
    return content;
  }
}

std::optional<fs::path> WatchedRun::FileOf(const std::string& file) const {
  std::error_code error;
  const fs::path root = fs::canonical(folder_, error);
  if (error) return std::nullopt;
  const fs::path real = fs::canonical(root / file, error);
  if (error || !fs::is_regular_file(real, error)) return std::nullopt;
  const auto [in_root, in_real] = std::mismatch(root.begin(), root.end(), real.begin(), real.end());
  if (in_root != root.end()) return std::nullopt;
  return real;
}

}  // namespace evac
