#include <fmt/format.h>

#include "apps/networks/fidelity.h"
#include "core/file.h"
#include "core/version.h"
#include "harness/merge.h"

namespace evac {
namespace {

constexpr const char* kFile = "reality.sha256";

}  // namespace

void StateReality(const std::filesystem::path& out, const Suite& suite) {
  MakeFolders(out);
  WriteFileAtomically(out / kFile, suite.reality_hash + "\n");
}

void RequireSameReality(const std::filesystem::path& earlier, const Suite& suite) {
  const std::string found = ReadFile(earlier / kFile), wanted = suite.reality_hash + "\n";
  if (found == wanted) return;
  throw InvalidInput(
      "--reality {}: is about another reality ({:.12}…, this suite's is {:.12}…): wanted the same suite but for its "
      "world model and how many initial states it has",
      earlier.string(), found, wanted);
}

void TakeReality(const std::filesystem::path& earlier_run, const std::set<EpisodeKey>& wanted, Store& store) {
  if (!std::filesystem::exists(earlier_run)) return;
  const Store earlier = Store::Open(earlier_run, Store::Mode::kReadOnly);
  if (earlier.run().evac_version != EVAC_VERSION)
    throw InvalidInput("--reality: {} was made by evac {}, this is {}: its episodes may not be what this one would see",
                       earlier_run.string(), earlier.run().evac_version, EVAC_VERSION);
  for (const PolicyInfo& policy : earlier.Policies()) store.AddPolicy(policy);
  const int taken = TakeEpisodes(
      earlier, [&](const EpisodeKey& key) { return wanted.contains(key); }, store);
  if (taken > 0) fmt::print(stderr, "{}: {} episodes taken over\n", earlier_run.string(), taken);
}

}  // namespace evac
