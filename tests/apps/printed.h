#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <string>
#include <vector>

#include "apps/commands.h"

namespace evac {

/// What a command prints when called with these words, the first being its name; its exceptions come through.
inline std::string Printed(void (*add)(CLI::App&, ExitCode&), std::vector<std::string> words) {
  CLI::App app;
  ExitCode exit_code = ExitCode::kInternal;
  add(app, exit_code);
  std::reverse(words.begin(), words.end());  // as CLI11 wants them
  testing::internal::CaptureStdout();
  try {
    app.parse(words);
  } catch (...) {
    testing::internal::GetCapturedStdout();
    throw;
  }
  EXPECT_EQ(exit_code, ExitCode::kOk);
  return testing::internal::GetCapturedStdout();
}

}  // namespace evac
