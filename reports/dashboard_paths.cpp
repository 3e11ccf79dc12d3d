#include "reports/dashboard_paths.h"

#include <algorithm>
#include <charconv>

namespace evac {
namespace {

/// "12/rest" → 12, and what follows the '/'.
std::optional<std::size_t> TakeNumber(std::string_view& rest) {
  std::size_t number = 0;
  const auto [end, error] = std::from_chars(rest.data(), rest.data() + rest.size(), number);
  const auto length = static_cast<std::size_t>(end - rest.data());
  if (error != std::errc() || length > 6 || length == rest.size() || rest[length] != '/') return std::nullopt;
  rest.remove_prefix(length + 1);
  return number;
}

bool IsSafeFolder(std::string_view name) {
  if (name.empty() || name == "." || name == "..") return false;
  return std::ranges::none_of(name,
                              [](char c) { return c == '\\' || static_cast<unsigned char>(c) < 0x20 || c == 0x7F; });
}

bool IsServed(std::string_view file) {
  const bool is_video = file.starts_with("videos/") && file.ends_with(".mp4");
  const bool is_thumbnail = file.starts_with("thumbs/") && file.ends_with(".jpg");
  if (!is_video && !is_thumbnail) return false;
  while (true) {
    const std::size_t slash = file.find('/');
    if (!IsSafeFolder(file.substr(0, slash))) return false;
    if (slash == std::string_view::npos) return true;
    file.remove_prefix(slash + 1);
  }
}

}  // namespace

std::optional<DashboardPath> ParseDashboardPath(std::string_view path) {
  if (path == "/") return DashboardPath{};
  if (path == "/events") return DashboardPath{DashboardView::kEvents, 0, ""};
  if (path == "/history.json") return DashboardPath{DashboardView::kHistory, 0, ""};
  constexpr std::string_view kRuns = "/runs/", kFiles = "files/";
  if (!path.starts_with(kRuns)) return std::nullopt;
  path.remove_prefix(kRuns.size());
  const std::optional<std::size_t> run = TakeNumber(path);
  if (!run) return std::nullopt;
  if (path.empty()) return DashboardPath{DashboardView::kPage, *run, ""};
  if (path == "report.json") return DashboardPath{DashboardView::kJson, *run, ""};
  if (!path.starts_with(kFiles) || !IsServed(path.substr(kFiles.size()))) return std::nullopt;
  return DashboardPath{DashboardView::kFile, *run, std::string(path.substr(kFiles.size()))};
}

bool IsLoopbackHost(std::string_view host, std::string_view told) {
  std::string_view name = host;
  if (name.starts_with('[')) {
    name = name.substr(0, name.find(']') + 1);
  } else {
    name = name.substr(0, name.find(':'));
  }
  const std::string_view port = host.substr(name.size());
  const bool is_port =
      port.empty() || (port.size() > 1 && port.size() < 7 && port[0] == ':' &&
                       std::ranges::all_of(port.substr(1), [](char c) { return c >= '0' && c <= '9'; }));
  const bool is_ours = name == "127.0.0.1" || name == "localhost" || name == "[::1]";
  return is_port && (is_ours || (!name.empty() && name == told));
}

}  // namespace evac
