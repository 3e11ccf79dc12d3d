#include "apps/warnings.h"

#include <fmt/format.h>

#include <algorithm>
#include <cstdio>

#include "core/file.h"
#include "core/recording_folders.h"
#include "core/version.h"

namespace evac {

void PrintWarnings(const std::vector<std::string>& warnings) {
  constexpr std::size_t kMost = 20;
  for (std::size_t i = 0; i < std::min(warnings.size(), kMost); ++i)
    fmt::print(stderr, "evac: warning: {}\n", warnings[i]);
  if (warnings.size() > kMost) fmt::print(stderr, "evac: warning: and {} more like these\n", warnings.size() - kMost);
}

void SayIfAnotherVersionBegan(const std::string& what, const std::string& began) {
  if (began == EVAC_VERSION) return;
  fmt::print(stderr, "evac: note: {} was begun by {}; evac {} goes on with it\n", what,
             began.empty() ? "an evac that did not write down its version" : "evac " + began, EVAC_VERSION);
}

void KeepWhoBegan(const std::filesystem::path& file, bool is_begun, const std::string& what) {
  if (!is_begun) return WriteFileAtomically(file, EVAC_VERSION "\n");
  std::string began = std::filesystem::exists(file) ? ReadFile(file) : "";
  std::erase(began, '\n');
  SayIfAnotherVersionBegan(what, began);
}

void SayPassedOver(const std::filesystem::path& recordings) {
  std::vector<std::string> warnings;
  for (const std::filesystem::path& folder : PassedOver(recordings))
    warnings.push_back(fmt::format("{}: no recording lies in it, and none is looked for below it", folder.string()));
  PrintWarnings(warnings);
}

}  // namespace evac
