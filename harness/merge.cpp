#include "harness/merge.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <map>
#include <set>
#include <string_view>
#include <tuple>
#include <utility>

#include "core/error.h"
#include "core/file.h"
#include "core/hash.h"
#include "core/run_extent.h"
#include "core/store.h"
#include "core/store_calls.h"
#include "core/store_lock.h"

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

std::string TextOf(const Eigen::Isometry3d& pose) {
  const Eigen::Matrix4d& numbers = pose.matrix();
  return Sha256Hex({reinterpret_cast<const char*>(numbers.data()), sizeof(double) * 16});
}

std::string TextOf(const Arms& arms) {
  std::string text;
  for (const ArmState& arm : arms) text += TextOf(arm.base_from_gripper) + fmt::format("{} ", arm.closure);
  return text;
}

/// All that makes an episode what it is, in one text.
std::string Fingerprint(const Store& store, Episode episode) {
  store.LoadSteps(episode);
  std::string text =
      fmt::format("{} {} {} {}", episode.chunks, Name(episode.stop), episode.stop_reason, episode.video_sha256);
  for (const Arms& arms : episode.commands) text += TextOf(arms);
  // What was measured, and what judges of unfilmed episodes read.
  for (const Observation& observation : episode.observations) text += TextOf(observation.arms);
  for (const PrivilegedFrame& frame : store.LoadPrivileged(episode.key.Id())) {
    for (const PrivilegedFrame::Body& body : frame.bodies) text += body.name + TextOf(body.base_from_body);
    for (const PrivilegedFrame::Contact& contact : frame.contacts)
      text += fmt::format("{} {} {} ", contact.a, contact.b, contact.force_n);
  }
  return text;
}

/// What comes from which shard; the lists are by shard.
struct Choice {
  std::vector<std::vector<Episode>> episodes;      ///< that are taken from it
  std::vector<std::set<std::string>> judged = {};  ///< ids: those, and its copies that are the same as a taken one
  int duplicates = 0;
};

/// Reads each shard's list once: one that is still being written may be longer when it is copied.
Choice Choose(const std::vector<Store>& stores, const std::vector<fs::path>& shards) {
  struct Copy {
    std::size_t shard;
    Episode episode;
  };
  Choice choice{std::vector<std::vector<Episode>>(stores.size()), std::vector<std::set<std::string>>(stores.size())};
  std::map<EpisodeKey, Copy> chosen;
  std::vector<std::string> disagreements;
  for (std::size_t s = 0; s < stores.size(); ++s) {
    for (const Episode& episode : stores[s].Episodes()) {
      const auto [found, is_new] = chosen.try_emplace(episode.key, Copy{s, episode});
      Copy& known = found->second;
      const bool known_failed = IsFailure(known.episode.stop), this_failed = IsFailure(episode.stop);
      if (!this_failed) choice.judged[s].insert(episode.key.Id());
      if (known_failed && !this_failed) known = {s, episode};
      if (is_new || known_failed || this_failed) continue;
      ++choice.duplicates;
      if (Fingerprint(stores[known.shard], known.episode) != Fingerprint(stores[s], episode))
        disagreements.push_back(
            fmt::format("{} in {} and {}", episode.key.Id(), shards[known.shard].string(), shards[s].string()));
    }
  }
  if (!disagreements.empty())
    throw InvalidInput("{} episodes are not the same in all shards that hold them; nothing was merged:\n  {}",
                       disagreements.size(), fmt::join(disagreements, "\n  "));
  for (auto& [key, copy] : chosen) {
    choice.judged[copy.shard].insert(key.Id());
    choice.episodes[copy.shard].push_back(std::move(copy.episode));
  }
  return choice;
}

void CopyDeclarations(const Store& from, Store& to) {
  std::map<std::string, std::string> pages = from.PageHashes();
  for (const Task& task : from.Tasks()) to.AddTask(task, pages[task.id]);
  for (const WorldInfo& world : from.Worlds()) to.AddWorld(world);
  for (const PolicyInfo& policy : from.Policies()) to.AddPolicy(policy);
  to.AddPlan(from.Plan());
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

std::vector<Verdict> VerdictsOf(const Store& store, const std::set<std::string>& episodes) {
  std::vector<Verdict> verdicts = store.Verdicts();
  std::erase_if(verdicts, [&](const Verdict& verdict) { return !episodes.contains(verdict.episode_id); });
  return verdicts;
}

/// Who says it, and of what. Of what one speaker said the last counts.
using Speaker = std::pair<std::string, std::string>;
Speaker SpeakerOf(const Verdict& verdict) { return {verdict.episode_id, verdict.judge}; }

std::map<Speaker, std::vector<Verdict>> BySpeaker(const std::vector<Verdict>& verdicts) {
  std::map<Speaker, std::vector<Verdict>> by_speaker;
  for (const Verdict& verdict : verdicts) by_speaker[SpeakerOf(verdict)].push_back(verdict);
  return by_speaker;
}

bool SayAlike(const Verdict& one, const Verdict& other) {
  const auto words = [](const Verdict& v) { return std::tuple(v.label, v.probability, v.stages, v.reason, v.rubric_version); };
  return words(one) == words(other);
}

/// How many of a speaker's verdicts are there already: those with which both begin, or all if what is there ends with them.
std::ptrdiff_t SaidAlready(const std::vector<Verdict>& there, const std::vector<Verdict>& verdicts) {
  const auto count = std::ssize(verdicts);
  const bool at_the_end = std::ssize(there) >= count && std::equal(verdicts.begin(), verdicts.end(), there.end() - count, SayAlike);
  return at_the_end ? count : std::ranges::mismatch(verdicts, there, SayAlike).in1 - verdicts.begin();
}

/// What was said of those episodes, in its order, and after what others said; what another said alike is said once.
void AddWhatWasNotSaid(const Store& from, const std::set<std::string>& episodes, Store& to) {
  std::vector<Verdict> verdicts = VerdictsOf(from, episodes);
  const auto there = BySpeaker(to.Verdicts());
  std::map<Speaker, std::ptrdiff_t> said;
  for (const auto& [speaker, all] : BySpeaker(verdicts)) {
    if (const auto known = there.find(speaker); known != there.end()) said[speaker] = SaidAlready(known->second, all);
  }
  std::erase_if(verdicts, [&](const Verdict& verdict) { return said[SpeakerOf(verdict)]-- > 0; });
  to.AddVerdicts(verdicts);
}

auto KeyOf(const RealTrial& t) { return std::tuple(t.task, t.initial_state, t.policy, t.checkpoint, t.trial); }

/// @throws InvalidInput naming all trials of which two shards say otherwise: two lists may both count from one
void RequireSameTrials(const std::vector<Store>& stores, const std::vector<fs::path>& shards) {
  std::map<decltype(KeyOf(RealTrial{})), std::pair<std::size_t, RealTrial>> first;
  std::vector<std::string> disagreements;
  for (std::size_t s = 0; s < stores.size(); ++s) {
    for (const RealTrial& trial : stores[s].RealTrials()) {
      const auto& [shard, known] = first.try_emplace(KeyOf(trial), s, trial).first->second;
      if (known.outcome == trial.outcome && known.video == trial.video) continue;
      disagreements.push_back(fmt::format("{} {} {}@{} trial {}: {} ({}) and {} ({})", trial.task, trial.initial_state, trial.policy,
                                          trial.checkpoint, trial.trial, known.source, shards[shard].string(), trial.source,
                                          shards[s].string()));
    }
  }
  if (!disagreements.empty())
    throw InvalidInput("{} real trials are not the same in all shards that hold them; nothing was merged (number them apart, "
                       "column trial, and import again):\n  {}", disagreements.size(), fmt::join(disagreements, "\n  "));
}

/// Imported trials that are not there yet.
void CopyRealTrials(const Store& from, Store& to) {
  std::set<decltype(KeyOf(RealTrial{}))> known;
  for (const RealTrial& trial : to.RealTrials()) known.insert(KeyOf(trial));
  std::vector<RealTrial> fresh;
  for (const RealTrial& trial : from.RealTrials()) {
    if (!known.insert(KeyOf(trial)).second) continue;
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

/// "out/demo/" is out/demo: beside it is where the merged run is made.
fs::path WithoutSlash(const fs::path& folder) {
  const fs::path normal = folder.lexically_normal();
  return normal.has_filename() ? normal : normal.parent_path();
}

/// A folder, made first where a merged run is made and removed last, when the run has its own name already: of that of a
/// run that is being made, what holds it is a merge's that was broken off; a run that holds it is whole.
constexpr const char* kMark = "merging";

void RequireFree(const fs::path& out) {
  if (fs::exists(out)) throw InvalidInput("{}: is there already, wanted a new folder for the merged run", out.string());
}

/// OUT.lock, beside the run that is being made; gone with this, however the merge ends.
class OutLock {
 public:
  explicit OutLock(const fs::path& out) : file_(out.string() + ".lock"), lock_(file_) {}
  ~OutLock() {
    std::error_code ignored;
    fs::remove(file_, ignored);
  }
  OutLock(const OutLock&) = delete;
  OutLock& operator=(const OutLock&) = delete;

 private:
  fs::path file_;
  RunLock lock_;
};

bool LiesIn(const fs::path& path, const fs::path& folder) {
  const fs::path from_folder = fs::weakly_canonical(path).lexically_relative(fs::weakly_canonical(folder));
  return !from_folder.empty() && *from_folder.begin() != "..";
}

/// @throws InvalidInput where to make the run in `part` would take away what no merge left there
void RequireRoom(const fs::path& part, const fs::path& out, const std::vector<fs::path>& shards) {
  const fs::file_status found = fs::symlink_status(part);
  if (found.type() == fs::file_type::not_found) return;
  for (const fs::path& shard : shards) {
    if (LiesIn(shard, part))
      throw InvalidInput("{}: lies where {} would be made, wanted another name for the merged run", shard.string(), out.string());
  }
  const bool is_left = fs::is_directory(found) && (fs::is_empty(part) || fs::is_directory(part / kMark));
  if (!is_left)
    throw InvalidInput("{}: is where {} would be made, and was not left there by a merge that was broken off: wanted another "
                       "name for the merged run, or that one free", part.string(), out.string());
}

/// All but the mark: who is killed meanwhile leaves it.
void Empty(const fs::path& part) {
  for (const fs::directory_entry& left : fs::directory_iterator(part)) {
    if (left.path().filename() != kMark) fs::remove_all(left.path());
  }
}

/// By whom the shards were begun, each version once: that of a merged run may be several already.
std::vector<std::string> VersionsOf(const std::vector<Store>& stores) {
  constexpr std::string_view kBetween = ", ";
  std::vector<std::string> versions;
  for (const Store& store : stores) {
    for (std::string left = store.run().evac_version, next; !left.empty(); left = next) {
      const std::size_t end = left.find(kBetween);
      next = end == std::string::npos ? "" : left.substr(end + kBetween.size());
      left.resize(std::min(end, left.size()));
      if (std::ranges::find(versions, left) == versions.end()) versions.push_back(left);
    }
  }
  return versions;
}

/// What whoever merges may want to know, and no reason to refuse it.
std::vector<std::string> NotesOn(const std::vector<Store>& stores) {
  std::vector<std::string> notes;
  const std::vector<std::string> versions = VersionsOf(stores);
  if (versions.size() > 1)
    notes.push_back(fmt::format("the runs were begun by evac {}, and one version need not come to what another did",
                                fmt::join(versions, " and ")));
  for (const Store& store : stores) {
    const fs::path calls = store.folder() / CallCache::kFile;
    if (fs::exists(calls)) notes.push_back(fmt::format("{} is not merged: its answers stay there", calls.string()));
    const fs::path logs = store.folder() / "logs";
    std::error_code ignored;
    if (fs::is_directory(logs, ignored))
      notes.push_back(fmt::format("{} is not merged: what the policies printed stays there", logs.string()));
  }
  return notes;
}

/// What was chosen of all, in the folder where it is made. @returns how much of the suite that is
RunExtent Fill(const fs::path& part, const std::vector<Store>& stores, const Choice& choice) {
  RunInfo run = stores.front().run();
  run.evac_version = fmt::format("{}", fmt::join(VersionsOf(stores), ", "));
  Store merged = Store::CreateOrContinue(part, run);
  for (const Store& store : stores) CopyDeclarations(store, merged);  // of all scenes the lowest seed's, before any episode
  for (std::size_t s = 0; s < stores.size(); ++s) {
    CopyEpisodes(choice.episodes[s], stores[s], merged);
    CopyRealTrials(stores[s], merged);
  }
  for (std::size_t s = 0; s < stores.size(); ++s) AddWhatWasNotSaid(stores[s], choice.judged[s], merged);
  return ExtentOf(merged.Plan(), merged.Episodes());
}

/// Without those that stand there before: what was counted on their wires would be counted again.
std::vector<fs::path> EachOnce(const std::vector<fs::path>& shards) {
  std::vector<fs::path> once;
  std::set<fs::path> seen;
  for (const fs::path& shard : shards) {
    if (seen.insert(fs::weakly_canonical(WithoutSlash(shard))).second) once.push_back(shard);
  }
  return once;
}

}  // namespace

MergeSummary MergeRuns(const std::vector<fs::path>& given, const fs::path& wanted_out) {
  const fs::path out = WithoutSlash(wanted_out);
  const std::vector<fs::path> shards = EachOnce(given);
  if (shards.empty()) throw InvalidInput("merge: found no shard, wanted at least one run's folder");
  if (out.empty()) throw InvalidInput("merge: found no name, wanted a new folder for the merged run");
  RequireFree(out);
  const std::vector<Store> stores = OpenAll(shards);
  const Choice choice = Choose(stores, shards);
  RequireSameTrials(stores, shards);
  const fs::path part = out.string() + ".tmp";
  MakeFolders(out.parent_path());
  const OutLock lock(out);
  RequireFree(out);  // another merge to it may have ended since
  RequireRoom(part, out, shards);
  MakeFolders(part / kMark);
  Empty(part);
  const RunExtent extent = Fill(part, stores, choice);
  SyncAndRename(part, out);
  fs::remove(out / kMark);
  std::size_t count = 0;
  for (const std::vector<Episode>& taken : choice.episodes) count += taken.size();
  MergeSummary summary{static_cast<int>(count), choice.duplicates, NotesOn(stores)};
  if (extent.missing > 0)
    summary.notes.push_back(fmt::format("{} of the suite's {} episodes are there: a shard was broken off, or is none "
                                        "of these; evac resume {} runs the others",
                                        extent.planned - extent.missing, extent.planned, out.string()));
  return summary;
}

int TakeEpisodes(const Store& from, const std::function<bool(const EpisodeKey&)>& wanted, Store& to) {
  std::vector<Episode> episodes = from.Episodes();
  std::erase_if(episodes, [&](const Episode& episode) { return IsFailure(episode.stop) || !wanted(episode.key); });
  TakeInitialScenes(from, episodes, to);
  std::set<std::string> taken;  // also those that a call which was killed before it came to their verdicts took
  for (const Episode& episode : episodes) taken.insert(episode.key.Id());
  std::erase_if(episodes, [&](const Episode& episode) { return to.Has(episode.key); });
  CopyEpisodes(episodes, from, to);
  AddWhatWasNotSaid(from, taken, to);
  return static_cast<int>(episodes.size());
}

}  // namespace evac
