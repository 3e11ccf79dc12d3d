#pragma once

#include <cstddef>
#include <optional>
#include <string>
#include <string_view>

/// What a dashboard may be asked for. Everything else is not there (404).
namespace evac {

enum class DashboardView {
  kIndex,    ///< /
  kEvents,   ///< /events: server-sent updates
  kHistory,  ///< /history.json
  kPage,     ///< /runs/3/
  kJson,     ///< /runs/3/report.json
  kFile,     ///< /runs/3/files/videos/…mp4 and /runs/3/files/thumbs/…jpg
};

struct DashboardPath {
  DashboardView view = DashboardView::kIndex;
  std::size_t run = 0;  ///< of those the dashboard was started with, from 0
  std::string file;     ///< of kFile: below the run's folder, '/' between folders
};

/// @param path  decoded, with its leading '/', without query. Any bytes.
/// A file's path has no empty, "." or ".." folder, no backslash and no control character, begins with videos/ or
/// thumbs/ and ends with .mp4 or .jpg: whoever opens it must still check where links lead (dashboard.cpp does).
std::optional<DashboardPath> ParseDashboardPath(std::string_view path);

/// Whether a Host header names this machine's loopback, with or without a port: other names may be another site's, made
/// to point here. @param told  the loopback address that the dashboard was told to listen at: a name of it as well.
bool IsLoopbackHost(std::string_view host, std::string_view told = "127.0.0.1");

}  // namespace evac
