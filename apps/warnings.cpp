#include "apps/warnings.h"

#include <fmt/format.h>

#include <algorithm>
#include <cstdio>

namespace evac {

void PrintWarnings(const std::vector<std::string>& warnings) {
  constexpr std::size_t kMost = 20;
  for (std::size_t i = 0; i < std::min(warnings.size(), kMost); ++i)
    fmt::print(stderr, "evac: warning: {}\n", warnings[i]);
  if (warnings.size() > kMost) fmt::print(stderr, "evac: warning: and {} more like these\n", warnings.size() - kMost);
}

}  // namespace evac
