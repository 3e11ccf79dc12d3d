#include <fmt/core.h>

#include <algorithm>
#include <cstdio>

#include "core/error.h"
#include "tests/core/statistics/golden_cases.h"
#include "tests/core/statistics/golden_functions.h"

namespace evac {
namespace {

/// @returns whether every case of the file was answered as expected.
bool CheckFile(const char* file) {
  const std::vector<std::string> known = GoldenNames();
  int passed = 0, failed = 0, skipped = 0;
  for (const GoldenCase& golden : ReadGoldenCases(file)) {
    if (!std::ranges::binary_search(known, golden.fn)) {
      fmt::print("SKIP {}: no function is called {}\n", golden.id, golden.fn);
      ++skipped;
    } else if (const std::optional<std::string> difference = FirstDifference(golden)) {
      fmt::print("FAIL {} ({}): {}\n", golden.id, golden.fn, *difference);
      ++failed;
    } else {
      ++passed;
    }
  }
  fmt::print("{} passed, {} failed, {} skipped\n", passed, failed, skipped);
  return failed == 0 && skipped == 0;
}

}  // namespace
}  // namespace evac

/// Exit code 0: all passed; 1: some failed or were skipped; 2: the file is not one of golden cases.
int main(int argc, char** argv) {
  if (argc != 2 || argv[1][0] == '-') {
    fmt::print(stderr,
               "Usage: stat_golden_check FILE.json\n"
               "Compares core/statistics with the golden cases of FILE (schema stat_golden/1): prints each miss, then\n"
               "\"N passed, N failed, N skipped\". A case whose fn is not known is skipped.\n");
    return 2;
  }
  try {
    return evac::CheckFile(argv[1]) ? 0 : 1;
  } catch (const std::exception& error) {
    fmt::print(stderr, "stat_golden_check: {}\n", error.what());
    return 2;
  }
}
