#pragma once

#include <functional>
#include <map>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "core/store.h"
#include "core/store_sqlite.h"
#include "core/types.h"

/// The store's tables as nouns: what one row means, and the SQL for it. Each write is part of the caller's transaction.
namespace evac::rows {

/// A run that is only read may be of an older schema.
bool HasTable(sqlite::Connection& connection, const char* name);

void InsertRun(sqlite::Connection& connection, const RunInfo& run);
std::optional<RunInfo> SelectRun(sqlite::Connection& connection);
/// False while there is an episode, a real trial, a look or a gate's decision: nothing is lost if another run begins here.
bool IsWithoutResults(sqlite::Connection& connection);
/// What a run of another suite said before its first episode.
void DeleteBeginning(sqlite::Connection& connection);

/// @throws InvalidInput if something else is stored under the name.
void DeclareTask(sqlite::Connection& connection, const Task& task);
void DeclareWorld(sqlite::Connection& connection, const WorldInfo& world);
void DeclarePolicy(sqlite::Connection& connection, const PolicyInfo& policy);
/// Of a policy that says something else now.
void ForgetDeclarationWithoutEpisodes(sqlite::Connection& connection, const PolicyInfo& policy);
std::vector<Task> SelectTasks(sqlite::Connection& connection);
std::vector<WorldInfo> SelectWorlds(sqlite::Connection& connection);
std::vector<PolicyInfo> SelectPolicies(sqlite::Connection& connection);
/// @throws InvalidInput if another is stored for the task.
void DeclarePageHash(sqlite::Connection& connection, const std::string& task, const std::string& page_hash);
/// Empty, as is the plan, where the run is of a schema from before there were any.
std::map<std::string, std::string> SelectPageHashes(sqlite::Connection& connection);
/// Of what is there already the larger number stays.
void UpsertPlanned(sqlite::Connection& connection, const PlannedEpisodes& planned);
std::vector<PlannedEpisodes> SelectPlan(sqlite::Connection& connection);

void InsertEpisode(sqlite::Connection& connection, const Episode& episode);
void InsertSteps(sqlite::Connection& connection, const Episode& episode);
void InsertPrivileged(sqlite::Connection& connection, const std::string& episode_id, const PrivilegedTrack& track);
/// In pair-key order, then world.
std::vector<Episode> SelectEpisodes(sqlite::Connection& connection);
std::optional<Episode> SelectEpisode(sqlite::Connection& connection, const std::string& episode_id);
void VisitEnded(sqlite::Connection& connection, const std::string& judge,
                const std::function<void(const EndedEpisode&)>& see);
void SelectSteps(sqlite::Connection& connection, Episode& episode);
PrivilegedTrack SelectPrivileged(sqlite::Connection& connection, const std::string& episode_id);
void DeleteFailedEpisode(sqlite::Connection& connection, const std::string& episode_id);

/// Stored unless a scene of a lower (seed, policy, checkpoint) is there, or one of another seed that an imagined episode
/// began from.
void UpsertInitialScene(sqlite::Connection& connection, const PairKey& pair, const InitialScene& scene);
std::optional<InitialScene> SelectInitialScene(sqlite::Connection& connection, const std::string& task,
                                               const std::string& initial_state);

std::vector<PairKey> SelectInitialScenePairs(sqlite::Connection& connection);

void InsertVerdict(sqlite::Connection& connection, const Verdict& verdict);
std::vector<Verdict> SelectVerdicts(sqlite::Connection& connection);
std::vector<std::string> SelectJudges(sqlite::Connection& connection);

void AddToCounters(sqlite::Connection& connection, const std::string& policy, const Counters& counters);
std::map<std::string, Counters> SelectCounters(sqlite::Connection& connection);

/// Empty where the run is of a schema from before there were any.
void InsertRealTrial(sqlite::Connection& connection, const RealTrial& trial);
std::vector<RealTrial> SelectRealTrials(sqlite::Connection& connection);
void InsertLook(sqlite::Connection& connection, const SequentialLook& look);
std::vector<SequentialLook> SelectLooks(sqlite::Connection& connection);
void InsertGateRecord(sqlite::Connection& connection, const GateRecord& record);
/// The same row under the highest id.
void MoveGateRecordLast(sqlite::Connection& connection, const std::string& key);
std::vector<GateRecord> SelectGateRecords(sqlite::Connection& connection);

}  // namespace evac::rows
