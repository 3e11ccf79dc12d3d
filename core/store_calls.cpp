#include "core/store_calls.h"

#include "core/error.h"
#include "core/file.h"
#include "core/store_sqlite.h"

namespace evac {
namespace {

constexpr std::int64_t kApplicationId = 0x6576636a;  // "evcj"

constexpr const char* kSchema = R"sql(
CREATE TABLE judge_calls (
  id INTEGER PRIMARY KEY AUTOINCREMENT,
  key TEXT NOT NULL, judge TEXT NOT NULL, response TEXT NOT NULL, status TEXT NOT NULL,
  prompt_tokens INTEGER NOT NULL, completion_tokens INTEGER NOT NULL, latency_ms INTEGER NOT NULL,
  attempts INTEGER NOT NULL, created_at TEXT NOT NULL);
CREATE INDEX judge_calls_by_key ON judge_calls (key, status, id);
CREATE TABLE servers (
  url TEXT NOT NULL, model TEXT NOT NULL, fingerprint TEXT NOT NULL, PRIMARY KEY (url, model));
PRAGMA user_version = 1;
)sql";

std::int64_t Pragma(sqlite::Connection& connection, const char* sql) {
  sqlite::Statement statement = connection.Query(sql);
  return statement.Step() ? statement.Integer(0) : 0;
}

void Check(sqlite::Connection& connection, const std::filesystem::path& file) {
  const std::int64_t version = Pragma(connection, "PRAGMA user_version");
  if (Pragma(connection, "PRAGMA application_id") != kApplicationId || version != 1)
    throw InvalidInput("{}: is no cache of judges' calls that this evac knows (version {})", file.string(), version);
}

}  // namespace

std::vector<CallTotals> TotalsOfCalls(const std::filesystem::path& run) {
  const std::filesystem::path file = run / CallCache::kFile;
  if (!std::filesystem::exists(StatusOf(file))) return {};
  sqlite::Connection connection = sqlite::Connection::OpenReadOnly(file);
  if (Pragma(connection, "SELECT count(*) FROM sqlite_schema") == 0) return {};  // a judge that was stopped as it began
  Check(connection, file);
  sqlite::Statement row = connection.Query(
      "SELECT judge, status, count(*), sum(attempts), sum(prompt_tokens), sum(completion_tokens), sum(latency_ms) "
      "FROM judge_calls GROUP BY judge, status ORDER BY judge, status");
  std::vector<CallTotals> totals;
  while (row.Step()) {
    if (totals.empty() || totals.back().judge != row.View(0)) totals.push_back({.judge = row.Text(0)});
    CallTotals& of_judge = totals.back();
    of_judge.calls[row.Text(1)] = row.Integer(2);
    of_judge.attempts += row.Integer(3);
    of_judge.prompt_tokens += row.Integer(4);
    of_judge.completion_tokens += row.Integer(5);
    of_judge.latency_ms += row.Integer(6);
  }
  return totals;
}

struct CallCache::Database {
  sqlite::Connection connection;
};

CallCache::CallCache(const std::filesystem::path& file)
    : database_(new Database{sqlite::Connection::OpenReadWrite(file)}) {
  sqlite::Connection& connection = database_->connection;
  if (Pragma(connection, "PRAGMA user_version") != 0 || Pragma(connection, "SELECT count(*) FROM sqlite_schema") != 0) {
    Check(connection, file);
    return;
  }
  sqlite::Transaction transaction(connection);
  connection.RunScript(kSchema);
  connection.RunScript(fmt::format("PRAGMA application_id = {}", kApplicationId));
  transaction.Commit();
}

CallCache::~CallCache() = default;

std::optional<JudgeCall> CallCache::Find(const std::string& key) const {
  const std::lock_guard lock(mutex_);
  sqlite::Statement row = database_->connection.Query(
      "SELECT judge, response, status, prompt_tokens, completion_tokens, latency_ms, attempts, created_at "
      "FROM judge_calls WHERE key = ? AND status = 'ok' ORDER BY id DESC LIMIT 1",
      key);
  if (!row.Step()) return std::nullopt;
  return JudgeCall{.key = key,
                   .judge = row.Text(0),
                   .response = row.Text(1),
                   .status = row.Text(2),
                   .prompt_tokens = row.Integer(3),
                   .completion_tokens = row.Integer(4),
                   .latency_ms = row.Integer(5),
                   .attempts = static_cast<int>(row.Integer(6)),
                   .created_at = row.Text(7)};
}

void CallCache::Add(const JudgeCall& call) {
  const std::lock_guard lock(mutex_);
  database_->connection.Run(
      "INSERT INTO judge_calls (key, judge, response, status, prompt_tokens, completion_tokens, latency_ms, attempts, "
      "created_at) VALUES (?, ?, ?, ?, ?, ?, ?, ?, ?)",
      call.key, call.judge, call.response, call.status, call.prompt_tokens, call.completion_tokens, call.latency_ms,
      call.attempts, call.created_at);
}

std::optional<std::string> CallCache::Fingerprint(const std::string& server, const std::string& model) const {
  const std::lock_guard lock(mutex_);
  sqlite::Statement row =
      database_->connection.Query("SELECT fingerprint FROM servers WHERE url = ? AND model = ?", server, model);
  if (!row.Step()) return std::nullopt;
  return row.Text(0);
}

void CallCache::SetFingerprint(const std::string& server, const std::string& model, const std::string& fingerprint) {
  const std::lock_guard lock(mutex_);
  database_->connection.Run(
      "INSERT INTO servers (url, model, fingerprint) VALUES (?, ?, ?) "
      "ON CONFLICT (url, model) DO UPDATE SET fingerprint = excluded.fingerprint",
      server, model, fingerprint);
}

}  // namespace evac
