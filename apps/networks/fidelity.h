#pragma once

#include <filesystem>
#include <functional>
#include <map>
#include <memory>
#include <set>
#include <span>
#include <string>
#include <vector>

#include "core/error.h"
#include "core/store.h"
#include "core/world.h"
#include "harness/suite.h"
#include "reports/fidelity.h"

/// `evac fidelity`: is the world model true? (docs/fidelity.md) It fills OUT/closed, OUT/open, OUT/executed,
/// OUT/counterfactual_NAME and OUT/horizon, each a run of its own that any kill leaves resumable, and counts them
/// (reports/fidelity.h).
namespace evac {

struct FidelityArguments {
  std::string suite, out;
  std::vector<std::string> assignments;
  std::vector<std::string> parts = {"closed", "open", "executed", "counterfactual", "horizon"};
  std::string classifier;       ///< weights of the judge of imagined clips
  std::string reality;          ///< an earlier OUT whose episodes are taken over, where they would come out the same; empty: none
  int counterfactual_states = 10;  ///< successes per task that are made to fail
  int horizon_states = 3;          ///< long rollouts per task
  int horizon_chunks = 30;         ///< of the network's K frames
};
/// @throws InvalidInput naming a part that is none, an option of a part that is not asked for, or what the suite lacks.
ExitCode RunFidelity(const FidelityArguments& arguments);

/// Of a suite with a `recording`: the actions of every recording of that folder (of the first `initial_states.count`,
/// each of at most `max_chunks` chunks, where the suite says so), replayed in the suite's world model and held against
/// the recorded pictures. Nobody knows how they ended, so only pictures are compared.
/// @throws InvalidInput naming an option, or a field of the suite, that means nothing there; or a count of more
///   recordings than can be replayed.
ExitCode RunRecordedFidelity(const FidelityArguments& arguments, const Suite& suite);

/// The three worlds of a fidelity suite.
struct FidelityWorlds {
  SuiteWorld real;   ///< `role: real`
  SuiteWorld again;  ///< the same profile under another name: other noise
  SuiteWorld model;  ///< type evac
};
/// @throws InvalidInput naming which of them the suite lacks, or has more than once.
FidelityWorlds WorldsOf(const Suite& suite);

/// Actions to be executed from an initial state, whatever is observed.
struct Replay {
  PairKey pair;
  const Task* task = nullptr;
  InitialState initial;
  std::vector<Arms> actions;
};

/// The executed actions of every episode of a world that did not fail. They point into `suite.tasks`.
std::vector<Replay> ReplaysOf(const Store& store, const std::string& world, const Suite& suite);

/// Where replays are run, and what from.
struct ReplayRun {
  const Suite& suite;
  std::filesystem::path folder;
  std::string name;               ///< "open loop": shown, and part of the run's hash
  std::vector<Task> tasks;        ///< as they are declared in the store, and replayed in
  std::vector<SuiteWorld> worlds; ///< in the order they run
  std::string rule = {};          ///< when a replay ends: part of the run's hash; empty: no part of it
  std::size_t frames = 0;         ///< of long rollouts, of each; 0: they are as long as their actions
  std::size_t frames_per_chunk = 1;  ///< K, to say how many chunks that is
  std::filesystem::path scenes = {};  ///< the run whose first frames imagined episodes start from; empty: this one
  std::filesystem::path reality = {}; ///< an earlier run whose episodes are taken over: of simulated worlds; empty: none
  bool model_is_the_same = false;     ///< as that run's: what it imagined is taken over too
  /// Makes a world in the place of apps/factory.h; null, or an answer that is null: the factory does.
  std::function<std::unique_ptr<World>(const SuiteWorld& world)> make = {};
};
/// Runs what is missing, and again what failed in an earlier call. @returns the store, judged by the oracle where there is physics.
/// @throws InternalError if it was interrupted, InvalidInput if the folder's episodes played other actions.
Store RunReplays(const ReplayRun& run, std::vector<Replay> replays);
/// @throws InvalidInput if the run's folder holds replays of the same actions that ended by another rule: says which.
void RequireSameReplays(const ReplayRun& run);

/// Seconds that a world model takes per chunk of K frames and scene, of as many scenes at once as the suite has lanes,
/// its cache unused. @param scenes  whose first frames it starts from
/// @returns undefined if no replay is a chunk long, or if the model fails on one of them
Number SecondsPerChunk(const SuiteWorld& model, const Suite& suite, const Store& scenes, std::vector<Replay> replays,
                       int chunk);
/// The same of a world that was made, on all of these. @param replays  not empty, each a chunk long
Number SecondsPerChunk(World& world, std::span<const Replay> replays, int chunk);

/// How many episodes a part has, and how many of them failed.
PartEpisodes EpisodesOf(const std::string& part, const Store& store);
/// The same of these replays alone: those of a call that asked for more stay in the store, and are in no number of this one.
PartEpisodes EpisodesOf(const std::string& part, const Store& store, const std::vector<Replay>& replays);

/// What an OUT is about, by SHA-256: two that are about one reality hold the same episodes of every policy that both have.
struct FidelitySubject {
  std::string reality;                          ///< Suite::reality_hash
  std::string model;                            ///< of what imagines
  std::map<std::string, std::string> policies;  ///< PolicyHash by NAME@CHECKPOINT
};
FidelitySubject SubjectOf(const Suite& suite);
/// Writes it to OUT/reality.sha256, a line for each hash: the hash, two spaces, what it is of.
void StateSubject(const std::filesystem::path& out, const FidelitySubject& subject);
/// Which of a suite's policies an earlier OUT may be taken over of (NAME@CHECKPOINT), and whether its model is the same.
struct SharedSubject {
  std::set<std::string> policies;
  bool model = false;
  bool Has(const std::string& policy, const std::string& checkpoint) const { return policies.contains(policy + "@" + checkpoint); }
};
/// Policies that changed under their name are said to have.
/// @throws InvalidInput unless `earlier` is an OUT about the same reality, and one policy at least is the same.
SharedSubject SharedWith(const std::filesystem::path& earlier, const FidelitySubject& subject);
/// Copies what a run that ended earlier holds of those episodes. No such run: nothing.
/// @throws InvalidInput if another evac made it.
void TakeReality(const std::filesystem::path& earlier_run, const std::set<EpisodeKey>& wanted, Store& store);

/// Writes episodes.csv, fidelity.json and index.html, and says the numbers.
void FinishFidelity(const std::filesystem::path& out, FidelityInput input);

}  // namespace evac
