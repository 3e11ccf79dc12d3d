#include <fmt/format.h>

#include <algorithm>

#include "apps/golden/golden_checks.h"
#include "core/error.h"

namespace evac::golden {
namespace {

struct Tally {
  int passed = 0, failed = 0, skipped = 0;
};

void CheckFile(const std::filesystem::path& path, Workshop& workshop, bool each, Tally& tally) {
  const std::string name = path.filename().string();
  Comparison comparison;
  try {
    const GoldenFile file(path);
    const std::optional<Check> check = CheckFor(file);
    if (!check) {
      ++tally.skipped;
      fmt::print("SKIP  {}: of no known kind\n", name);
      return;
    }
    const bool trains = file.Has("loss");
    c10::AutoGradMode gradients(trains);
    (*check)(file, workshop, comparison);
  } catch (const std::exception& error) {
    ++tally.failed;
    fmt::print("FAIL  {}: {}\n", name, error.what());
    return;
  }
  ++(comparison.Passed() ? tally.passed : tally.failed);
  fmt::print("{}  {}: {} tensors, max error {:.2e}, rms {:.2e}\n", comparison.Passed() ? "pass" : "FAIL", name,
             comparison.count(), comparison.worst(), comparison.rms());
  for (const std::string& failure : each ? comparison.Each() : comparison.failures()) fmt::print("      {}\n", failure);
}

int Run(const std::filesystem::path& folder, bool each) {
  std::vector<std::filesystem::path> paths;
  for (const auto& entry : std::filesystem::directory_iterator(folder)) {
    if (entry.path().extension() == ".safetensors") paths.push_back(entry.path());
  }
  if (paths.empty()) throw InvalidInput("{}: no .safetensors files", folder.string());
  std::sort(paths.begin(), paths.end());
  Workshop workshop(folder);
  Tally tally;
  for (const std::filesystem::path& path : paths) {
    CheckFile(path, workshop, each, tally);
    std::fflush(stdout);
  }
  fmt::print("{} passed, {} failed, {} skipped\n", tally.passed, tally.failed, tally.skipped);
  return static_cast<int>(tally.failed + tally.skipped == 0 ? ExitCode::kOk : ExitCode::kNo);
}

}  // namespace
}  // namespace evac::golden

/// evac_golden_check DIR [--each]: compares every golden file of a folder with what we compute, as the reference does,
/// quirks included; a line per file, with --each one per tensor too.
int main(int count, char** arguments) {
  try {
    const bool each = count == 3 && std::string_view(arguments[2]) == "--each";
    if (count != 2 && !each) throw evac::InvalidInput("usage: evac_golden_check DIR [--each]");
    return evac::golden::Run(arguments[1], each);
  } catch (const std::exception& error) {
    fmt::print(stderr, "evac_golden_check: {}\n", error.what());
    return static_cast<int>(evac::ExitCode::kInvalidInput);
  }
}
