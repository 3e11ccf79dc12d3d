#pragma once

#include <gtest/gtest.h>

#include <filesystem>
#include <map>
#include <string>
#include <vector>

#include "tests/support/command.h"

/// What tests of the real binaries share.
namespace evac::system_test {

inline const std::string kFaults = EVAC_SOURCE_DIR "/tests/system/faults.yaml";
inline const std::string kSmall = EVAC_SOURCE_DIR "/tests/system/small.yaml";

/// `evac run SUITE --out RUN --set …`.
inline std::vector<std::string> RunWords(const std::string& suite, const std::filesystem::path& run,
                                         const std::vector<std::string>& assignments = {}) {
  std::vector<std::string> words = {Binary("evac"), "run", suite, "--out", run.string()};
  for (const std::string& assignment : assignments) words.insert(words.end(), {"--set", assignment});
  return words;
}

/// Every episode with its reasons and its video's hash. Fails the test if it cannot be told: two empty texts are equal.
inline std::string List(const std::filesystem::path& run) {
  const CommandResult listed = RunCommand({Binary("evac"), "ls", run.string(), "--json"});
  EXPECT_EQ(listed.exit_code, 0) << listed.err;
  return listed.out;
}

}  // namespace evac::system_test
