#include "core/store.h"

#include <mutex>
#include <set>

#include "core/error.h"
#include "core/file.h"
#include "core/store_files.h"
#include "core/store_lock.h"
#include "core/store_rows.h"
#include "core/store_schema.h"
#include "core/store_sqlite.h"

namespace evac {

namespace fs = std::filesystem;

/// SQLite is called by one thread at a time: every method of Store holds `mutex`.
struct Store::Database {
  fs::path folder;
  std::unique_ptr<RunLock> lock;  ///< none for readers and in memory
  bool is_writable;
  sqlite::Connection connection;
  std::mutex mutex;

  Database(fs::path run_folder, std::unique_ptr<RunLock> run_lock, bool writable, sqlite::Connection open)
      : folder(std::move(run_folder)), lock(std::move(run_lock)), is_writable(writable), connection(std::move(open)) {}

  template <typename Select>
  auto Read(const Select& select) try {
    const std::lock_guard guard(mutex);
    return select(connection);
  } catch (const Error& error) {
    throw error.Called(kStoreError);
  }
  /// In one transaction.
  template <typename Change>
  void Write(const Change& change) try {
    const std::lock_guard guard(mutex);
    if (!is_writable) throw InternalError("{}: the run was opened for reading only", folder.string());
    sqlite::Transaction transaction(connection);
    change(connection);
    transaction.Commit();
  } catch (const Error& error) {
    throw error.Called(kStoreError);
  }
};

namespace {

fs::path DatabaseIn(const fs::path& folder) { return folder / run_files::kDatabase; }

void BeginOrDemandSame(sqlite::Connection& connection, const RunInfo& run, const fs::path& folder) {
  const std::optional<RunInfo> stored = rows::SelectRun(connection);
  if (stored && stored->suite_hash == run.suite_hash) return;
  if (stored && !rows::IsWithoutResults(connection)) {
    throw InvalidInput(
        "{}: holds a run of another suite: its suite hash is {}, this suite's is {}; choose another folder",
        folder.string(), stored->suite_hash, run.suite_hash);
  }
  rows::DeleteBeginning(connection);
  rows::InsertRun(connection, run);
}

/// The record's episode without its steps, its files named; the thumbnail is written.
Episode WithFiles(const EpisodeRecord& record, const fs::path& folder) {
  Episode episode = {.key = record.episode.key,
                     .observations = {},
                     .commands = {},
                     .chunks = record.episode.chunks,
                     .stop = record.episode.stop,
                     .stop_reason = record.episode.stop_reason,
                     .failure = record.episode.failure,
                     .video = record.episode.video,
                     .video_sha256 = record.episode.video_sha256,
                     .thumbnail = record.episode.thumbnail};
  if (record.video) {
    episode.video = run_files::NameInside(folder, record.video->path);
    episode.video_sha256 = record.video->sha256;
  }
  if (!record.thumbnail_jpeg.empty()) {
    episode.thumbnail = run_files::ThumbnailName(episode.key);
    MakeFolders((folder / episode.thumbnail).parent_path());
    WriteFileAtomically(folder / episode.thumbnail, record.thumbnail_jpeg);
  }
  return episode;
}

}  // namespace

Store::Store(std::unique_ptr<Database> database) : database_(std::move(database)) {}
Store::Store(Store&&) noexcept = default;
Store& Store::operator=(Store&&) noexcept = default;
Store::~Store() = default;

Store Store::CreateOrContinue(const fs::path& folder, const RunInfo& run) {
  MakeFolders(folder);
  const fs::path file = DatabaseIn(folder);
  if (!fs::exists(StatusOf(file))) run_files::RequireNoOthersFiles(folder);
  auto lock = std::make_unique<RunLock>(folder / run_files::kLock);
  if (fs::exists(StatusOf(file))) {  // looked at before anything is written: it may be a newer evac's
    sqlite::Connection reading = sqlite::Connection::OpenReadOnly(file);
    schema::Version(reading, schema::Steps(), file);
  }
  auto database = std::make_unique<Database>(folder, std::move(lock), true, sqlite::Connection::OpenReadWrite(file));
  schema::Migrate(database->connection, schema::Steps(), file);
  database->Write([&](sqlite::Connection& connection) { BeginOrDemandSame(connection, run, folder); });
  return Store(std::move(database));
}

Store Store::Open(const fs::path& folder, Mode mode) {
  const fs::path file = DatabaseIn(folder);
  if (!fs::is_regular_file(StatusOf(file)))
    throw InvalidInput("{}: there is no run ({} is missing)", folder.string(), run_files::kDatabase);
  sqlite::Connection reading = sqlite::Connection::OpenReadOnly(file);
  const int version = schema::Version(reading, schema::Steps(), file);
  if (version == 0 || !rows::SelectRun(reading))
    throw InvalidInput("{}: the run in it was never begun", folder.string());
  if (mode == Mode::kReadOnly) return Store(std::make_unique<Database>(folder, nullptr, false, std::move(reading)));

  auto lock = std::make_unique<RunLock>(folder / run_files::kLock);
  auto database = std::make_unique<Database>(folder, std::move(lock), true, sqlite::Connection::OpenReadWrite(file));
  schema::Migrate(database->connection, schema::Steps(), file);
  return Store(std::move(database));
}

Store Store::InMemory(const fs::path& folder, const RunInfo& run) {
  auto database = std::make_unique<Database>(folder, nullptr, true, sqlite::Connection::OpenInMemory());
  schema::Migrate(database->connection, schema::Steps(), ":memory:");
  rows::InsertRun(database->connection, run);
  return Store(std::move(database));
}

std::string Store::Engine() { return std::string("SQLite ") + sqlite3_libversion(); }

const fs::path& Store::folder() const { return database_->folder; }

RunInfo Store::run() const {
  return database_->Read([](auto& connection) { return rows::SelectRun(connection).value(); });
}

void Store::AddTask(const Task& task, const std::string& page_hash) {
  database_->Write([&](auto& connection) {
    rows::DeclareTask(connection, task);
    if (!page_hash.empty()) rows::DeclarePageHash(connection, task.id, page_hash);
  });
}

void Store::AddWorld(const WorldInfo& world) {
  database_->Write([&](auto& connection) { rows::DeclareWorld(connection, world); });
}

void Store::AddPolicy(const PolicyInfo& policy) {
  database_->Write([&](auto& connection) { rows::DeclarePolicy(connection, policy); });
}

void Store::AddPolicyAsItIsNow(const PolicyInfo& policy) {
  database_->Write([&](auto& connection) {
    rows::ForgetDeclarationWithoutEpisodes(connection, policy);
    rows::DeclarePolicy(connection, policy);
  });
}

std::vector<Task> Store::Tasks() const { return database_->Read(rows::SelectTasks); }
std::vector<WorldInfo> Store::Worlds() const { return database_->Read(rows::SelectWorlds); }
std::vector<PolicyInfo> Store::Policies() const { return database_->Read(rows::SelectPolicies); }
std::map<std::string, std::string> Store::PageHashes() const { return database_->Read(rows::SelectPageHashes); }

void Store::AddPlan(const std::vector<PlannedEpisodes>& plan) {
  database_->Write([&](auto& connection) {
    for (const PlannedEpisodes& planned : plan) rows::UpsertPlanned(connection, planned);
  });
}

std::vector<PlannedEpisodes> Store::Plan() const { return database_->Read(rows::SelectPlan); }

void Store::Add(const EpisodeRecord& record) { AddAll({&record, 1}); }

void Store::AddAll(std::span<const EpisodeRecord> records) {
  std::vector<Episode> episodes;
  for (const EpisodeRecord& record : records) {
    if (Has(record.episode.key))  // before its thumbnail is overwritten
      throw InternalError("episode {} is in the store already", record.episode.key.Id());
    episodes.push_back(WithFiles(record, folder()));
  }
  database_->Write([&](auto& connection) {
    for (std::size_t i = 0; i < records.size(); ++i) {
      rows::InsertEpisode(connection, episodes[i]);
      rows::InsertSteps(connection, records[i].episode);
      if (!records[i].privileged.empty())
        rows::InsertPrivileged(connection, episodes[i].key.Id(), records[i].privileged);
    }
  });
}

bool Store::Has(const EpisodeKey& key) const {
  return database_->Read([&](auto& connection) { return rows::SelectEpisode(connection, key.Id()).has_value(); });
}

void Store::RemoveFailed(const EpisodeKey& key) {
  std::optional<Episode> episode;
  database_->Write([&](auto& connection) {
    episode = rows::SelectEpisode(connection, key.Id());
    if (!episode) throw InternalError("episode {} is not in the store", key.Id());
    if (!IsFailure(episode->stop)) throw InternalError("episode {} has not failed: it stays", key.Id());
    rows::DeleteFailedEpisode(connection, key.Id());
  });
  for (const std::string& name : {episode->video, episode->thumbnail}) {
    std::error_code left_for_remove_orphans;
    if (!name.empty()) fs::remove(folder() / name, left_for_remove_orphans);
  }
}

std::vector<Episode> Store::Episodes() const { return database_->Read(rows::SelectEpisodes); }

void Store::ForEachEnded(const std::string& judge, const std::function<void(const EndedEpisode&)>& see) const {
  database_->Read([&](auto& connection) { rows::VisitEnded(connection, judge, see); });
}

void Store::LoadSteps(Episode& episode) const {
  database_->Read([&](auto& connection) { rows::SelectSteps(connection, episode); });
}

PrivilegedTrack Store::LoadPrivileged(const std::string& episode_id) const {
  return database_->Read([&](auto& connection) { return rows::SelectPrivileged(connection, episode_id); });
}

void Store::AddInitialScene(const PairKey& pair, const InitialScene& scene) {
  database_->Write([&](auto& connection) { rows::UpsertInitialScene(connection, pair, scene); });
}

std::optional<InitialScene> Store::LoadInitialScene(const std::string& task, const std::string& initial_state) const {
  return database_->Read([&](auto& connection) { return rows::SelectInitialScene(connection, task, initial_state); });
}

std::vector<PairKey> Store::InitialScenes() const { return database_->Read(rows::SelectInitialScenePairs); }

void Store::AddVerdict(const Verdict& verdict) { AddVerdicts({&verdict, 1}); }

void Store::AddVerdicts(std::span<const Verdict> verdicts) {
  database_->Write([&](auto& connection) {
    for (const Verdict& verdict : verdicts) rows::InsertVerdict(connection, verdict);
  });
}

std::vector<Verdict> Store::Verdicts() const { return database_->Read(rows::SelectVerdicts); }

std::vector<std::string> Store::Judges() const { return database_->Read(rows::SelectJudges); }

std::map<std::string, std::map<std::string, Verdict>> Store::CurrentVerdicts() const {
  std::map<std::string, std::map<std::string, Verdict>> current;
  for (Verdict& verdict : Verdicts()) {
    Verdict& place = current[verdict.episode_id][verdict.judge];
    place = std::move(verdict);
  }
  return current;
}

void Store::AddRealTrials(const std::vector<RealTrial>& trials) {
  database_->Write([&](auto& connection) {
    for (const RealTrial& trial : trials) rows::InsertRealTrial(connection, trial);
  });
}

std::vector<RealTrial> Store::RealTrials() const { return database_->Read(rows::SelectRealTrials); }

void Store::AddLooks(const std::vector<SequentialLook>& looks) {
  database_->Write([&](auto& connection) {
    for (const SequentialLook& look : looks) rows::InsertLook(connection, look);
  });
}

std::vector<SequentialLook> Store::Looks() const { return database_->Read(rows::SelectLooks); }

void Store::AddGateRecord(const GateRecord& record, const std::vector<SequentialLook>& looks) {
  database_->Write([&](auto& connection) {
    rows::InsertGateRecord(connection, record);
    for (const SequentialLook& look : looks) rows::InsertLook(connection, look);
  });
}

void Store::RepeatGateRecord(const std::string& key) {
  database_->Write([&](auto& connection) { rows::MoveGateRecordLast(connection, key); });
}

std::vector<GateRecord> Store::GateRecords() const { return database_->Read(rows::SelectGateRecords); }

void Store::Count(const std::string& policy, const Counters& counters) {
  database_->Write([&](auto& connection) { rows::AddToCounters(connection, policy, counters); });
}

std::map<std::string, Counters> Store::CountersByPolicy() const { return database_->Read(rows::SelectCounters); }

void Store::RemoveOrphans() {
  if (!database_->is_writable) throw InternalError("{}: the run was opened for reading only", folder().string());
  std::set<std::string> named;
  for (const Episode& episode : Episodes()) named.insert({episode.video, episode.thumbnail});
  run_files::RemoveAllBut(named, folder());
}

fs::path Store::VideoPath(const EpisodeKey& key) const {
  const fs::path path = folder() / run_files::VideoName(key);
  MakeFolders(path.parent_path());
  return path;
}

}  // namespace evac
