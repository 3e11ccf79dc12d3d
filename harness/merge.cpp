#include "harness/merge.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <map>
#include <set>
#include <tuple>
#include <utility>

#include "core/error.h"
#include "core/file.h"
#include "core/hash.h"
#include "core/store.h"

namespace evac {
namespace {

namespace fs = std::filesystem;

std::vector<Store> OpenAll(const std::vector<fs::path>& shards) {
  std::vector<Store> stores;
  for (const fs::path& shard : shards) {
    stores.push_back(Store::Open(shard, Store::Mode::kReadOnly));
    const RunInfo first = stores.front().run(), run = stores.back().run();
    if (run.suite_hash == first.suite_hash) continue;
    throw InvalidInput("{} and {} are runs of different suites (suite hashes {:.12}… and {:.12}…)",
                       shards.front().string(), shard.string(), first.suite_hash, run.suite_hash);
  }
  return stores;
}

/// All that makes an episode what it is, in one text.
std::string Fingerprint(const Store& store, Episode episode) {
  store.LoadSteps(episode);
  std::string text =
      fmt::format("{} {} {} {}", episode.chunks, Name(episode.stop), episode.stop_reason, episode.video_sha256);
  for (const Arms& arms : episode.commands) {
    for (const ArmState& arm : arms) {
      const Eigen::Matrix4d pose = arm.base_from_gripper.matrix();
      text += Sha256Hex({reinterpret_cast<const char*>(pose.data()), sizeof(double) * 16}) +
              fmt::format("{} ", arm.closure);
    }
  }
  return text;
}

/// Which shard each episode is taken from.
struct Choice {
  std::map<EpisodeKey, std::size_t> shard;
  int duplicates = 0;
};

Choice Choose(const std::vector<Store>& stores, const std::vector<fs::path>& shards) {
  Choice choice;
  std::map<EpisodeKey, Episode> chosen;
  std::vector<std::string> disagreements;
  for (std::size_t s = 0; s < stores.size(); ++s) {
    for (const Episode& episode : stores[s].Episodes()) {
      const auto [found, is_new] = chosen.try_emplace(episode.key, episode);
      if (is_new) {
        choice.shard[episode.key] = s;
        continue;
      }
      ++choice.duplicates;
      const bool known_failed = IsFailure(found->second.stop), this_failed = IsFailure(episode.stop);
      if (known_failed && !this_failed) {
        found->second = episode;
        choice.shard[episode.key] = s;
      }
      if (known_failed || this_failed) continue;
      const std::size_t before = choice.shard[episode.key];
      if (Fingerprint(stores[before], found->second) != Fingerprint(stores[s], episode))
        disagreements.push_back(
            fmt::format("{} in {} and {}", episode.key.Id(), shards[before].string(), shards[s].string()));
    }
  }
  if (disagreements.empty()) return choice;
  throw InvalidInput("{} episodes are not the same in all shards that hold them; nothing was merged:\n  {}",
                     disagreements.size(), fmt::join(disagreements, "\n  "));
}

void CopyDeclarations(const Store& from, Store& to) {
  for (const Task& task : from.Tasks()) to.AddTask(task);
  for (const WorldInfo& world : from.Worlds()) to.AddWorld(world);
  for (const PolicyInfo& policy : from.Policies()) to.AddPolicy(policy);
  for (const PairKey& pair : from.InitialScenes())
    to.AddInitialScene(pair, from.LoadInitialScene(pair.task, pair.initial_state).value());
  for (const auto& [policy, counters] : from.CountersByPolicy()) to.Count(policy, counters);
}

FinishedVideo CopyVideo(const Episode& episode, const fs::path& from, const Store& to) {
  const fs::path source = from / episode.video, copy = to.VideoPath(episode.key);
  const std::string bytes = ReadFile(source);
  if (Sha256Hex(bytes) != episode.video_sha256)
    throw InvalidInput("{}: is not the video that the run stored (its SHA-256 is another)", source.string());
  WriteFileAtomically(copy, bytes);
  return {.path = copy, .sha256 = episode.video_sha256, .frames = static_cast<int>(episode.observations.size())};
}

EpisodeRecord CopyFiles(Episode episode, const Store& from, const Store& to) {
  from.LoadSteps(episode);
  EpisodeRecord record;
  record.privileged = from.LoadPrivileged(episode.key.Id());
  if (!episode.video.empty()) record.video = CopyVideo(episode, from.folder(), to);
  if (!episode.thumbnail.empty()) record.thumbnail_jpeg = ReadFile(from.folder() / episode.thumbnail);
  record.episode = std::move(episode);
  return record;
}

/// A transaction for some hundred episodes: each waits for the disk.
void CopyEpisodes(const std::vector<Episode>& episodes, const Store& from, Store& to) {
  constexpr std::size_t kBatch = 256;
  std::vector<EpisodeRecord> batch;
  for (const Episode& episode : episodes) {
    batch.push_back(CopyFiles(episode, from, to));
    if (batch.size() < kBatch) continue;
    to.AddAll(batch);
    batch.clear();
  }
  to.AddAll(batch);
}

/// What the shards say of the episodes taken from them, in their order; what two say alike is said once.
void CopyVerdicts(const Store& from, const std::set<std::string>& taken, Store& to) {
  std::vector<Verdict> verdicts = from.Verdicts();
  std::erase_if(verdicts, [&](const Verdict& verdict) { return !taken.contains(verdict.episode_id); });
  to.AddVerdicts(verdicts);
}

/// Imported trials, those of the first shard that has them.
void CopyRealTrials(const Store& from, Store& to) {
  std::set<std::tuple<std::string, std::string, std::string, std::string, std::int64_t>> known;
  const auto key = [](const RealTrial& t) {
    return std::tuple(t.task, t.initial_state, t.policy, t.checkpoint, t.trial);
  };
  for (const RealTrial& trial : to.RealTrials()) known.insert(key(trial));
  std::vector<RealTrial> fresh;
  for (const RealTrial& trial : from.RealTrials()) {
    if (!known.insert(key(trial)).second) continue;
    fresh.push_back(trial);
    if (trial.video.empty()) continue;
    MakeFolders((to.folder() / trial.video).parent_path());
    WriteFileAtomically(to.folder() / trial.video, ReadFile(from.folder() / trial.video));
  }
  to.AddRealTrials(fresh);
}

/// Where those episodes began. A scene is kept for a task and an initial state, under the name of whichever episode of them
/// comes first, which need not be one of these.
void TakeInitialScenes(const Store& from, const std::vector<Episode>& episodes, Store& to) {
  std::set<std::pair<std::string, std::string>> begun;
  for (const Episode& episode : episodes) begun.insert({episode.key.pair.task, episode.key.pair.initial_state});
  for (const PairKey& pair : from.InitialScenes()) {
    if (begun.contains({pair.task, pair.initial_state}))
      to.AddInitialScene(pair, from.LoadInitialScene(pair.task, pair.initial_state).value());
  }
}

}  // namespace

MergeSummary MergeRuns(const std::vector<fs::path>& shards, const fs::path& out) {
  if (shards.empty()) throw InvalidInput("merge: found no shard, wanted at least one run's folder");
  if (fs::exists(out)) throw InvalidInput("{}: is there already, wanted a new folder for the merged run", out.string());
  const std::vector<Store> stores = OpenAll(shards);
  const Choice choice = Choose(stores, shards);
  const fs::path part = out.string() + ".tmp";
  fs::remove_all(part);
  {
    Store merged = Store::CreateOrContinue(part, stores.front().run());
    for (std::size_t s = 0; s < stores.size(); ++s) {
      CopyDeclarations(stores[s], merged);
      std::vector<Episode> episodes = stores[s].Episodes();
      std::erase_if(episodes, [&](const Episode& episode) { return choice.shard.at(episode.key) != s; });
      std::set<std::string> taken;
      for (const Episode& episode : episodes) taken.insert(episode.key.Id());
      CopyEpisodes(episodes, stores[s], merged);
      CopyVerdicts(stores[s], taken, merged);
      CopyRealTrials(stores[s], merged);
    }
  }
  fs::rename(part, out);
  return {.episodes = static_cast<int>(choice.shard.size()), .duplicates = choice.duplicates};
}

int TakeEpisodes(const Store& from, const std::function<bool(const EpisodeKey&)>& wanted, Store& to) {
  std::vector<Episode> episodes = from.Episodes();
  std::erase_if(episodes, [&](const Episode& episode) { return IsFailure(episode.stop) || !wanted(episode.key); });
  TakeInitialScenes(from, episodes, to);
  std::erase_if(episodes, [&](const Episode& episode) { return to.Has(episode.key); });
  std::set<std::string> taken;
  for (const Episode& episode : episodes) taken.insert(episode.key.Id());
  CopyEpisodes(episodes, from, to);
  CopyVerdicts(from, taken, to);
  return static_cast<int>(episodes.size());
}

}  // namespace evac
