#pragma once

#include <gtest/gtest.h>
#include <signal.h>

#include <filesystem>
#include <functional>
#include <map>
#include <string>
#include <vector>

#include "core/error.h"
#include "core/store.h"
#include "tests/support/child.h"
#include "tests/system/process_support.h"

/// What a run has while another process writes it: a kill is to come between its first row and its last.
namespace evac::system_test {

/// How many episodes are stored; none before the first one's files are there.
inline std::size_t Stored(const std::filesystem::path& run) try {
  if (!std::filesystem::exists(run / "thumbs")) return 0;
  return Store::Open(run, Store::Mode::kReadOnly).Episodes().size();
} catch (const Error&) {
  return 0;
}

/// Starts a program and kills it as soon as that is so.
inline void KillOnce(const std::function<bool()>& is_so, const std::vector<std::string>& words,
                     const std::filesystem::path& log) {
  Child child(words, log);
  EXPECT_TRUE(WaitUntil(is_so, 600)) << "it never came so far";
  child.End(SIGKILL);
}

/// Of each stored episode's video when it was written: one that is made anew is written later.
inline std::map<std::string, std::filesystem::file_time_type> VideoTimes(const std::filesystem::path& run) {
  std::map<std::string, std::filesystem::file_time_type> times;
  for (const Episode& episode : Store::Open(run, Store::Mode::kReadOnly).Episodes())
    if (!episode.video.empty()) times[episode.video] = std::filesystem::last_write_time(run / episode.video);
  return times;
}

/// Those of these videos that are another file now.
inline std::map<std::string, std::filesystem::file_time_type> MadeAnew(
    std::map<std::string, std::filesystem::file_time_type> then, const std::filesystem::path& run) {
  const auto now = VideoTimes(run);
  const auto is_same = [&](const auto& video) {
    const auto found = now.find(video.first);
    return found != now.end() && found->second == video.second;
  };
  std::erase_if(then, is_same);
  return then;
}

}  // namespace evac::system_test
