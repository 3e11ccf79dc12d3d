#include "core/store_schema.h"

#include <cstdint>

#include "core/error.h"

namespace evac::schema {
namespace {

constexpr std::int64_t kApplicationId = 0x65766163;  // "evac"

/// Documented column by column in docs/formats/run.md.
constexpr const char* kVersion1 = R"sql(
CREATE TABLE run (
  id INTEGER PRIMARY KEY CHECK (id = 1),
  suite_text TEXT NOT NULL, suite_hash TEXT NOT NULL, suite_path TEXT NOT NULL, evac_version TEXT NOT NULL);

CREATE TABLE tasks (id TEXT PRIMARY KEY, definition TEXT NOT NULL, page TEXT NOT NULL, page_path TEXT NOT NULL);

CREATE TABLE worlds (
  name TEXT PRIMARY KEY, type TEXT NOT NULL, is_real INTEGER NOT NULL CHECK (is_real IN (0, 1)), profile_hash TEXT NOT NULL);

CREATE TABLE policies (
  name TEXT NOT NULL, checkpoint TEXT NOT NULL, declaration TEXT NOT NULL, PRIMARY KEY (name, checkpoint));

CREATE TABLE episodes (
  id TEXT PRIMARY KEY,
  task TEXT NOT NULL REFERENCES tasks (id), initial_state TEXT NOT NULL,
  policy TEXT NOT NULL, checkpoint TEXT NOT NULL, world TEXT NOT NULL REFERENCES worlds (name), seed INTEGER NOT NULL,
  chunks INTEGER NOT NULL, stop TEXT NOT NULL, stop_reason TEXT NOT NULL,
  failed INTEGER NOT NULL CHECK (failed IN (0, 1)), failure TEXT,
  video TEXT, video_sha256 TEXT, thumbnail TEXT,
  CHECK ((video IS NULL) = (video_sha256 IS NULL)),
  UNIQUE (task, initial_state, policy, checkpoint, seed, world),
  FOREIGN KEY (policy, checkpoint) REFERENCES policies (name, checkpoint));

CREATE TABLE steps (
  episode TEXT PRIMARY KEY REFERENCES episodes (id) ON DELETE CASCADE, observations BLOB NOT NULL, commands BLOB NOT NULL);

CREATE TABLE privileged (
  episode TEXT PRIMARY KEY REFERENCES episodes (id) ON DELETE CASCADE, frames BLOB NOT NULL);

CREATE TABLE initial_scenes (
  task TEXT NOT NULL REFERENCES tasks (id), initial_state TEXT NOT NULL,
  seed INTEGER NOT NULL, policy TEXT NOT NULL, checkpoint TEXT NOT NULL,
  arms BLOB NOT NULL, cameras TEXT NOT NULL,
  PRIMARY KEY (task, initial_state));

CREATE TABLE initial_scene_images (
  task TEXT NOT NULL, initial_state TEXT NOT NULL, position INTEGER NOT NULL, png BLOB NOT NULL,
  PRIMARY KEY (task, initial_state, position),
  FOREIGN KEY (task, initial_state) REFERENCES initial_scenes (task, initial_state) ON DELETE CASCADE);

CREATE TABLE verdicts (
  id INTEGER PRIMARY KEY AUTOINCREMENT,
  episode TEXT NOT NULL REFERENCES episodes (id), judge TEXT NOT NULL,
  label TEXT NOT NULL CHECK (label IN ('success', 'failure', 'cannot_tell', 'invalid')),
  probability REAL, stages TEXT NOT NULL, reason TEXT NOT NULL, rubric_version TEXT NOT NULL);
CREATE INDEX verdicts_of_episode ON verdicts (episode);

CREATE TABLE counters (policy TEXT NOT NULL, name TEXT NOT NULL, value INTEGER NOT NULL, PRIMARY KEY (policy, name));

CREATE TABLE removals (episode TEXT PRIMARY KEY REFERENCES episodes (id) ON DELETE CASCADE);

CREATE TRIGGER removals_are_of_failed_episodes BEFORE INSERT ON removals
WHEN NOT EXISTS (SELECT 1 FROM episodes WHERE id = NEW.episode AND failed)
BEGIN SELECT RAISE(ABORT, 'only a failed episode can be removed'); END;

CREATE TRIGGER episodes_stay_as_they_are BEFORE UPDATE ON episodes
BEGIN SELECT RAISE(ABORT, 'episodes are never changed'); END;
CREATE TRIGGER episodes_stay BEFORE DELETE ON episodes
WHEN NOT EXISTS (SELECT 1 FROM removals WHERE episode = OLD.id)
BEGIN SELECT RAISE(ABORT, 'episodes are never deleted'); END;

CREATE TRIGGER verdicts_stay_as_they_are BEFORE UPDATE ON verdicts
BEGIN SELECT RAISE(ABORT, 'verdicts are append-only'); END;
CREATE TRIGGER verdicts_are_not_replaced BEFORE INSERT ON verdicts
WHEN EXISTS (SELECT 1 FROM verdicts WHERE id = NEW.id)
BEGIN SELECT RAISE(ABORT, 'verdicts are append-only'); END;
CREATE TRIGGER verdicts_stay BEFORE DELETE ON verdicts
WHEN NOT EXISTS (SELECT 1 FROM removals WHERE episode = OLD.episode)
BEGIN SELECT RAISE(ABORT, 'verdicts are append-only'); END;
)sql";

/// Trials on a real robot, typed in or imported, and what sequential comparisons have bet so far.
constexpr const char* kVersion2 = R"sql(
CREATE TABLE real_trials (
  id INTEGER PRIMARY KEY AUTOINCREMENT,
  task TEXT NOT NULL REFERENCES tasks (id), initial_state TEXT NOT NULL, policy TEXT NOT NULL, checkpoint TEXT NOT NULL,
  trial INTEGER NOT NULL,
  outcome TEXT NOT NULL CHECK (outcome IN ('success', 'failure', 'cannot_tell', 'invalid')),
  video TEXT, source TEXT NOT NULL,
  UNIQUE (task, initial_state, policy, checkpoint, trial));

CREATE TABLE sequential_looks (
  id INTEGER PRIMARY KEY AUTOINCREMENT,
  comparison TEXT NOT NULL, task TEXT NOT NULL,
  pairs INTEGER NOT NULL, only_first INTEGER NOT NULL, only_second INTEGER NOT NULL, e_value REAL NOT NULL);

CREATE TRIGGER real_trials_stay_as_they_are BEFORE UPDATE ON real_trials
BEGIN SELECT RAISE(ABORT, 'real trials are never changed'); END;
CREATE TRIGGER real_trials_stay BEFORE DELETE ON real_trials
BEGIN SELECT RAISE(ABORT, 'real trials are never deleted'); END;
CREATE TRIGGER sequential_looks_stay_as_they_are BEFORE UPDATE ON sequential_looks
BEGIN SELECT RAISE(ABORT, 'looks are append-only'); END;
CREATE TRIGGER sequential_looks_stay BEFORE DELETE ON sequential_looks
BEGIN SELECT RAISE(ABORT, 'looks are append-only'); END;
)sql";

/// For rates over very many episodes: a judge's labels without reading its verdicts' texts.
constexpr const char* kVersion3 = R"sql(
CREATE INDEX verdicts_of_judge ON verdicts (judge, episode, id, label);
)sql";

/// What gates decided of the run.
constexpr const char* kVersion4 = R"sql(
CREATE TABLE gate_decisions (
  id INTEGER PRIMARY KEY AUTOINCREMENT,
  key TEXT NOT NULL UNIQUE, gate TEXT NOT NULL,
  outcome TEXT NOT NULL CHECK (outcome IN ('pass', 'fail', 'inconclusive')), document TEXT NOT NULL);

CREATE TRIGGER gate_decisions_stay_as_they_are BEFORE UPDATE ON gate_decisions
BEGIN SELECT RAISE(ABORT, 'gate decisions are never changed'); END;
CREATE TRIGGER gate_decisions_stay BEFORE DELETE ON gate_decisions
BEGIN SELECT RAISE(ABORT, 'gate decisions are never deleted'); END;
)sql";

/// What tasks were made of, and how many episodes there are to be: how far a run is, and what it may be held against.
constexpr const char* kVersion5 = R"sql(
CREATE TABLE page_hashes (task TEXT PRIMARY KEY REFERENCES tasks (id), sha256 TEXT NOT NULL);

CREATE TABLE planned_episodes (
  task TEXT NOT NULL REFERENCES tasks (id), world TEXT NOT NULL REFERENCES worlds (name),
  policy TEXT NOT NULL, checkpoint TEXT NOT NULL, episodes INTEGER NOT NULL CHECK (episodes >= 0),
  PRIMARY KEY (task, world, policy, checkpoint));
)sql";

constexpr const char* kSteps[] = {kVersion1, kVersion2, kVersion3, kVersion4, kVersion5};

std::int64_t Pragma(sqlite::Connection& connection, const char* sql) {
  sqlite::Statement statement = connection.Query(sql);
  return statement.Step() ? statement.Integer(0) : 0;
}

}  // namespace

std::span<const char* const> Steps() { return kSteps; }

int Version(sqlite::Connection& connection, std::span<const char* const> steps, const std::filesystem::path& file) {
  const std::int64_t version = Pragma(connection, "PRAGMA user_version");
  const bool is_ours = Pragma(connection, "PRAGMA application_id") == kApplicationId;
  const bool is_empty = version == 0 && Pragma(connection, "SELECT count(*) FROM sqlite_schema") == 0;
  if (!is_ours && !is_empty)
    throw InvalidInput("{}: is another program's database, wanted an evac run's", file.string());
  if (version > static_cast<std::int64_t>(steps.size())) {
    throw InvalidInput("{}: has schema version {}, this evac knows up to {}: open it with a newer evac", file.string(),
                       version, steps.size());
  }
  return static_cast<int>(version);
}

void Migrate(sqlite::Connection& connection, std::span<const char* const> steps, const std::filesystem::path& file) {
  for (std::size_t at = static_cast<std::size_t>(Version(connection, steps, file)); at < steps.size(); ++at) {
    sqlite::Transaction transaction(connection);
    connection.RunScript(steps[at]);
    connection.RunScript(fmt::format("PRAGMA application_id = {}; PRAGMA user_version = {}", kApplicationId, at + 1));
    transaction.Commit();
  }
}

}  // namespace evac::schema
