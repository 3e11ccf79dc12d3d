#include <fmt/format.h>

#include <algorithm>
#include <sstream>

#include "apps/networks/fidelity.h"
#include "core/file.h"
#include "core/version.h"
#include "harness/merge.h"
#include "harness/suite_hash.h"

namespace evac {
namespace {

constexpr const char* kFile = "reality.sha256";
constexpr std::size_t kHash = 64;
const std::string kPolicy = "policy ";

std::string NameOf(const std::string& name, const std::string& checkpoint) { return name + "@" + checkpoint; }

std::string Line(const std::string& hash, const std::string& what) { return hash + "  " + what + "\n"; }

/// @throws InvalidInput naming the line that is none of Line's.
FidelitySubject ReadSubject(const std::filesystem::path& file) {
  FidelitySubject subject;
  std::istringstream lines(ReadFile(file));
  int number = 0;
  for (std::string line; std::getline(lines, line);) {
    ++number;
    const std::string hash = line.substr(0, kHash), what = line.size() > kHash + 2 ? line.substr(kHash + 2) : "";
    if (line != hash + "  " + what || what.empty())
      throw InvalidInput("{}:{}: found '{:.80}', wanted a SHA-256 and what it is of: made by another evac?", file.string(),
                         number, line);
    if (what == "reality")
      subject.reality = hash;
    else if (what == "model")
      subject.model = hash;
    else if (what.starts_with(kPolicy))
      subject.policies[what.substr(kPolicy.size())] = hash;
  }
  return subject;
}

}  // namespace

FidelitySubject SubjectOf(const Suite& suite) {
  FidelitySubject subject{suite.reality_hash, WorldsOf(suite).model.evac->hash, {}};
  for (const SuitePolicy& policy : suite.policies)
    subject.policies[NameOf(policy.name, policy.checkpoint)] = PolicyHash(policy);
  return subject;
}

void StateSubject(const std::filesystem::path& out, const FidelitySubject& subject) {
  std::string text = Line(subject.reality, "reality") + Line(subject.model, "model");
  for (const auto& [name, hash] : subject.policies) text += Line(hash, kPolicy + name);
  MakeFolders(out);
  WriteFileAtomically(out / kFile, text);
}

SharedSubject SharedWith(const std::filesystem::path& earlier, const FidelitySubject& subject) {
  const FidelitySubject found = ReadSubject(earlier / kFile);
  if (found.reality != subject.reality)
    throw InvalidInput(
        "--reality {}: is about another reality ({:.12}…, this suite's is {:.12}…): wanted the same suite but for its "
        "world model, its policies and how many initial states it has",
        earlier.string(), found.reality, subject.reality);
  SharedSubject shared;
  for (const auto& [name, hash] : subject.policies) {
    const auto there = found.policies.find(name);
    if (there == found.policies.end()) continue;
    if (there->second == hash)
      shared.policies.insert(name);
    else
      fmt::print(stderr, "evac: warning: --reality {}: {} was another policy there (its command or files): not taken over\n",
                 earlier.string(), name);
  }
  if (shared.policies.empty())
    throw InvalidInput("--reality {}: has none of this suite's policies as they are now: there is nothing to take over",
                       earlier.string());
  shared.model = found.model == subject.model;
  return shared;
}

void TakeReality(const std::filesystem::path& earlier_run, const std::set<EpisodeKey>& wanted, Store& store) {
  if (!std::filesystem::exists(earlier_run)) return;
  const Store earlier = Store::Open(earlier_run, Store::Mode::kReadOnly);
  if (earlier.run().evac_version != EVAC_VERSION)
    throw InvalidInput("--reality: {} was made by evac {}, this is {}: its episodes may not be what this one would see",
                       earlier_run.string(), earlier.run().evac_version, EVAC_VERSION);
  std::set<std::string> theirs;
  for (const EpisodeKey& key : wanted) theirs.insert(NameOf(key.pair.policy, key.pair.checkpoint));
  for (const PolicyInfo& policy : earlier.Policies()) {
    if (theirs.contains(NameOf(policy.name, policy.checkpoint))) store.AddPolicy(policy);
  }
  const int taken = TakeEpisodes(
      earlier, [&](const EpisodeKey& key) { return wanted.contains(key); }, store);
  if (taken > 0) fmt::print(stderr, "{}: {} episodes taken over\n", earlier_run.string(), taken);
}

}  // namespace evac
