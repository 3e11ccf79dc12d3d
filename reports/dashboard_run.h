#pragma once

#include <cstddef>
#include <filesystem>
#include <mutex>
#include <optional>
#include <string>

#include "reports/dashboard_pages.h"

namespace evac {

/// Changes whenever somebody writes a store: sizes and times of its files. Cheap enough to be looked at all the time. An
/// empty log is as good as none: reading leaves one behind.
std::string StampOf(const std::filesystem::path& run);

/// What a dashboard keeps of one run: its pages, counted anew when its store has changed and somebody asks.
/// Thread-safe.
class WatchedRun {
 public:
  struct Content {
    std::string page, json;  ///< the report; the reason where it cannot be made
    DashboardRun summary;
  };

  WatchedRun(std::filesystem::path folder, std::size_t index, SummaryOptions options, std::string program);

  const std::filesystem::path& folder() const { return folder_; }
  /// As the store is now; a copy, so that it can be sent while another is made.
  Content Now();
  /// The file's real path if it lies inside the run's folder, links followed, and is a file; else nothing.
  std::optional<std::filesystem::path> FileOf(const std::string& file) const;

 private:
  Content Count(const std::string& stamp) const;

  const std::filesystem::path folder_;
  const std::size_t index_;
  const SummaryOptions options_;
  const std::string program_;
  std::mutex mutex_;
  std::string stamp_;  ///< of what `content_` was made from
  Content content_;
};

}  // namespace evac
