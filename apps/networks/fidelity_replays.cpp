#include <fmt/format.h>

#include <algorithm>
#include <limits>
#include <map>
#include <optional>
#include <utility>

#include "apps/factory.h"
#include "apps/networks/fidelity.h"
#include "apps/interrupts.h"
#include "apps/progress_display.h"
#include "core/hash.h"
#include "core/policy.h"
#include "core/version.h"
#include "harness/rollout.h"
#include "harness/scheduler.h"
#include "judges/judge_episodes.h"
#include "judges/oracle_judge.h"

namespace evac {
namespace {

namespace fs = std::filesystem;

/// Plays to each episode what was chosen for it before, in chunks, whatever it observes; the last chunk ends it.
class GivenActions final : public Policy {
 public:
  GivenActions(const std::vector<Replay>& replays, int chunk_size) : chunk_size_(static_cast<std::size_t>(chunk_size)) {
    for (const Replay& replay : replays) {
      const Job job{replay.task, replay.initial, {replay.pair, ""}};
      by_episode_[{replay.pair.task, job.PolicySeed()}] = &replay.actions;
    }
  }

  std::string Name() const override { return "given actions"; }

  void Reset(SceneId scene, const Task& task, std::uint64_t seed) override {
    const auto found = by_episode_.find({task.id, seed});
    if (found == by_episode_.end()) throw InternalError("nobody chose actions for this episode of {}", task.id);
    playing_[scene] = {found->second, 0};
  }

  std::vector<Acted> Act(std::span<const SceneObservation> batch) override {
    std::vector<Acted> answers;
    for (const SceneObservation& asked : batch) {
      auto& [actions, next] = playing_.at(asked.scene);
      const std::size_t count = std::min(chunk_size_, actions->size() - next);
      const auto from = actions->begin() + static_cast<std::ptrdiff_t>(next);
      next += count;
      answers.push_back(ActionChunk{{from, from + static_cast<std::ptrdiff_t>(count)}, next == actions->size(), 0});
    }
    return answers;
  }

 private:
  std::size_t chunk_size_;
  std::map<std::pair<std::string, std::uint64_t>, const std::vector<Arms>*> by_episode_;
  std::map<SceneId, std::pair<const std::vector<Arms>*, std::size_t>> playing_;
};

/// Of a run of replays. Those that an earlier evac made, from other scenes than their actions are of, have another; so have
/// those that it ended by another rule: theirs is without one.
std::string HashOf(const std::string& name, const std::string& suite_hash, const std::string& rule) {
  return Sha256Hex(name + " from the states of " + suite_hash + (rule.empty() ? "" : ", " + rule));
}

RunInfo InfoOf(const ReplayRun& run) {
  return {.suite_text = run.suite.text,
          .suite_hash = HashOf(run.name, run.suite.hash, run.rule),
          .suite_path = fs::absolute(run.suite.path).lexically_normal().string(),
          .evac_version = EVAC_VERSION};
}

void DeclareReplays(const ReplayRun& run, const std::vector<Replay>& replays, Store& store) {
  Suite declared = run.suite;
  declared.tasks = run.tasks;
  declared.worlds = run.worlds;
  Declare(declared, store);
  for (const Replay& replay : replays)
    store.AddPolicy({replay.pair.policy, replay.pair.checkpoint, R"({"replays":"recorded actions"})"});
}

std::vector<Job> JobsIn(const SuiteWorld& world, const std::vector<Replay>& replays) {
  std::vector<Job> jobs;
  for (const Replay& replay : replays) jobs.push_back({replay.task, replay.initial, {replay.pair, world.name}});
  return jobs;
}

bool IsSame(const Arms& one, const Arms& other) {
  return std::ranges::equal(one, other, [](const ArmState& a, const ArmState& b) {
    return a.base_from_gripper.matrix() == b.base_from_gripper.matrix() && a.closure == b.closure;
  });
}

/// Whether an episode played a replay's actions, or the first of them where a rule ended it.
bool Played(const Store& store, Episode episode, const Replay& replay) {
  store.LoadSteps(episode);
  return episode.commands.size() <= replay.actions.size() &&
         std::equal(episode.commands.begin(), episode.commands.end(), replay.actions.begin(), IsSame);
}

std::map<PairKey, const Replay*> ByPair(const std::vector<Replay>& replays) {
  std::map<PairKey, const Replay*> by_pair;
  for (const Replay& replay : replays) by_pair[replay.pair] = &replay;
  return by_pair;
}

/// What was replayed before the closed loop was made anew is not compared with what it is now.
void RequireSameActions(const ReplayRun& run, const std::vector<Replay>& replays, const Store& store) {
  const auto by_pair = ByPair(replays);
  for (const Episode& episode : store.Episodes()) {
    const auto replay = by_pair.find(episode.key.pair);
    if (replay == by_pair.end() || Played(store, episode, *replay->second)) continue;
    throw InvalidInput("{}: {} played other actions than its episode has now: remove that folder, and the same command makes "
                       "its replays anew", run.folder.string(), episode.key.Id());
  }
}

/// Whether what the earlier run's episodes in a world came to is what this one's would.
bool IsTheSame(const SuiteWorld& world, const ReplayRun& run) { return !world.evac || run.model_is_the_same; }

bool TakesAny(const ReplayRun& run) {
  return std::ranges::any_of(run.worlds, [&](const SuiteWorld& world) { return IsTheSame(world, run); });
}

/// Of an earlier run's episodes that would come out the same those that played the same actions.
std::set<EpisodeKey> ToTake(const ReplayRun& run, const std::vector<Replay>& replays) {
  std::set<std::string> same;
  for (const SuiteWorld& world : run.worlds) {
    if (IsTheSame(world, run)) same.insert(world.name);
  }
  const auto by_pair = ByPair(replays);
  const Store earlier = Store::Open(run.reality, Store::Mode::kReadOnly);
  std::set<EpisodeKey> keys;
  int others = 0;
  for (const Episode& episode : earlier.Episodes()) {
    const auto replay = by_pair.find(episode.key.pair);
    if (IsFailure(episode.stop) || replay == by_pair.end() || !same.contains(episode.key.world)) continue;
    if (Played(earlier, episode, *replay->second))
      keys.insert(episode.key);
    else
      ++others;
  }
  if (others > 0)
    fmt::print(stderr, "evac: warning: {}: {} of its episodes played other actions than these: not taken over\n",
               run.reality.string(), others);
  return keys;
}

/// The run in a folder; nothing if none was begun there.
std::optional<Store> BegunIn(const fs::path& folder) try {
  return Store::Open(folder, Store::Mode::kReadOnly);
} catch (const Error&) {
  return std::nullopt;
}

/// Of the first that did not fail; 0: there is none.
std::size_t FramesOf(const Store& replays) {
  for (Episode& episode : replays.Episodes()) {
    if (IsFailure(episode.stop)) continue;
    replays.LoadSteps(episode);
    return episode.commands.size();
  }
  return 0;
}

/// How replays that are there already are other ones than `run`'s; nothing if they are not.
/// @param suite_hash  of the closed loop that they are of
std::optional<std::string> WhatDiffers(const ReplayRun& run, const Store& there, const std::string& suite_hash) {
  const std::string found = there.run().suite_hash;
  if (found == HashOf(run.name, suite_hash, run.rule) || there.Episodes().empty()) return std::nullopt;
  const std::size_t frames = run.frames > 0 ? FramesOf(there) : 0, k = run.frames_per_chunk;
  if (frames > 0 && frames != run.frames)
    return fmt::format("--horizon-chunks: found {} ({} frames), wanted {} ({} frames)", frames / k, frames, run.frames / k, run.frames);
  if (found == HashOf(run.name, suite_hash, ""))
    return fmt::format("an earlier evac ended its replays by another rule, wanted {}", run.rule);
  return "its replays began in other scenes than their actions are of (an earlier evac)";
}

/// Whether what is in `run.reality` are the same replays, of the closed loop beside them.
bool IsOfSameReplays(const ReplayRun& run) {
  const fs::path closed = run.reality.parent_path() / "closed";
  if (!fs::exists(run.reality) || !fs::exists(closed)) return false;
  const std::string suite_hash = Store::Open(closed, Store::Mode::kReadOnly).run().suite_hash;
  const auto differs = WhatDiffers(run, Store::Open(run.reality, Store::Mode::kReadOnly), suite_hash);
  if (differs) fmt::print(stderr, "evac: warning: {}: {}: not taken over\n", run.reality.string(), *differs);
  return !differs;
}

/// In the tasks of the run, whatever those are that they were made from.
void PointAt(const std::vector<Task>& tasks, std::vector<Replay>& replays) {
  for (Replay& replay : replays)
    replay.task = &*std::find_if(tasks.begin(), tasks.end(), [&](const Task& task) { return task.id == replay.pair.task; });
}

/// What failed in an earlier call is tried again in this one.
void RemoveFailed(Store& store) {
  for (const Episode& episode : store.Episodes()) {
    if (IsFailure(episode.stop)) store.RemoveFailed(episode.key);
  }
}

RolloutOptions OptionsOf(const ReplayRun& run, const SuiteWorld& world, ProgressDisplay& display) {
  RolloutOptions options;
  options.lanes = run.suite.lanes;
  options.lane = {.chunk_size = run.suite.chunk_size,
                  .policy_chunk_size = run.suite.chunk_size,
                  .latency = {},
                  .video = run.suite.video,
                  .film = world.film,
                  .keep_initial_scene = world.is_real};
  options.failures_left = std::numeric_limits<int>::max();  // a failed replay is a row without an outcome
  options.on_progress = [&display](const Progress& progress) { display.Show(progress, ProgressDisplay::Clock::now()); };
  options.interrupted = IsInterrupted;
  return options;
}

}  // namespace

std::vector<Replay> ReplaysOf(const Store& store, const std::string& world, const Suite& suite) {
  std::map<std::string, InitialState> states;
  for (const InitialState& state : suite.initial_states) states[state.id] = state;
  std::map<std::string, const Task*> tasks;
  for (const Task& task : suite.tasks) tasks[task.id] = &task;
  std::vector<Replay> replays;
  for (Episode& episode : store.Episodes()) {
    if (episode.key.world != world || IsFailure(episode.stop)) continue;
    store.LoadSteps(episode);
    const PairKey& pair = episode.key.pair;
    const Task* task = tasks.at(pair.task);
    replays.push_back({pair, task, StateOn(*task, states.at(pair.initial_state)), std::move(episode.commands)});
  }
  return replays;
}

void RequireSameReplays(const ReplayRun& run) {
  const auto there = BegunIn(run.folder);
  if (!there) return;
  if (const auto differs = WhatDiffers(run, *there, run.suite.hash))
    throw InvalidInput("{}: {}: remove that folder, and the same command makes them anew", run.folder.string(), *differs);
}

Store RunReplays(const ReplayRun& run, std::vector<Replay> replays) {
  PointAt(run.tasks, replays);
  Store store = Store::CreateOrContinue(run.folder, InfoOf(run));
  RemoveFailed(store);
  store.RemoveOrphans();
  RequireSameActions(run, replays, store);
  DeclareReplays(run, replays, store);
  if (TakesAny(run) && IsOfSameReplays(run)) TakeReality(run.reality, ToTake(run, replays), store);
  std::optional<Store> scenes;
  if (!run.scenes.empty()) scenes = Store::Open(run.scenes, Store::Mode::kReadOnly);
  int total = 0, missing = 0;
  for (const SuiteWorld& world : run.worlds) {
    total += static_cast<int>(replays.size());
    missing += static_cast<int>(MissingJobs(JobsIn(world, replays), store).size());
  }
  ProgressDisplay display(total, total - missing, stderr);
  GivenActions actions(replays, run.suite.chunk_size);
  for (const SuiteWorld& world : run.worlds) {
    JobQueue jobs(MissingJobs(JobsIn(world, replays), store));
    if (jobs.size() == 0) continue;
    display.Begin(run.name + " · " + world.name);
    std::unique_ptr<World> made = run.make ? run.make(world) : nullptr;
    if (!made) made = MakeWorld(world, run.suite, scenes ? &*scenes : &store);
    const Summary summary = RunEpisodes(actions, *made, jobs, store, OptionsOf(run, world, display));
    if (summary.failed > 0)
      display.Say(fmt::format("{} replays failed; the last: {}", summary.failed, summary.last_failure));
    if (summary.interrupted) throw InternalError("interrupted; the same command goes on");
  }
  OracleJudge oracle(store);
  JudgeEpisodes(oracle, store, {});
  return store;
}

}  // namespace evac
