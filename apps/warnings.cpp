#include "apps/warnings.h"

#include <fmt/format.h>

#include <algorithm>
#include <cstdio>

#include "core/version.h"

namespace evac {

void PrintWarnings(const std::vector<std::string>& warnings) {
  constexpr std::size_t kMost = 20;
  for (std::size_t i = 0; i < std::min(warnings.size(), kMost); ++i)
    fmt::print(stderr, "evac: warning: {}\n", warnings[i]);
  if (warnings.size() > kMost) fmt::print(stderr, "evac: warning: and {} more like these\n", warnings.size() - kMost);
}

void SayIfAnotherVersionBegan(const std::filesystem::path& out, const std::string& began) {
  if (began == EVAC_VERSION) return;
  fmt::print(stderr, "evac: note: {} was begun by {}; evac {} goes on with it\n", out.string(),
             began.empty() ? "an evac that did not write down its version" : "evac " + began, EVAC_VERSION);
}

}  // namespace evac
