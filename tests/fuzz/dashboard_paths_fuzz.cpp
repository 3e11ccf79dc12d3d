#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <filesystem>
#include <string_view>

#include "reports/dashboard_paths.h"

/// Whatever is asked for: a path that is let through stays below its run's folder and names a video or a thumbnail.
namespace {

void Require(bool holds) {
  if (!holds) std::abort();
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const std::string_view text(reinterpret_cast<const char*>(data), size);
  evac::IsLoopbackHost(text);
  const auto path = evac::ParseDashboardPath(text);
  if (!path) return 0;
  Require(path->run < 1'000'000);
  Require((path->view == evac::DashboardView::kFile) == !path->file.empty());
  if (path->view != evac::DashboardView::kFile) return 0;
  const std::filesystem::path file(path->file);
  Require(file.is_relative() && file.lexically_normal() == file);
  Require(*file.begin() == "videos" || *file.begin() == "thumbs");
  Require(path->file.find('\0') == std::string::npos);
  return 0;
}
