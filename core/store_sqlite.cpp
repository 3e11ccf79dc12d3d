#include "core/store_sqlite.h"

#include "core/error.h"

namespace evac::sqlite {
namespace {

namespace fs = std::filesystem;

/// A file that is no database is the user's mistake; everything else is the machine's (full disk, lost lock) or ours.
[[noreturn]] void Throw(sqlite3* database, int code) {
  const char* file = sqlite3_db_filename(database, "main");
  const std::string name = file && *file ? file : "store in memory";
  const std::string reason =
      fmt::format("{} (SQLite {})", sqlite3_errmsg(database), sqlite3_extended_errcode(database));
  if ((code & 0xFF) == SQLITE_NOTADB) throw InvalidInput("{}: is no run's database: {}", name, reason);
  throw InternalError("{}: {}", name, reason);
}

void Check(sqlite3* database, int code) {
  if (code != SQLITE_OK) Throw(database, code);
}

/// A path as SQLite's URIs want it.
std::string Escaped(const fs::path& file) {
  std::string escaped;
  for (const char c : file.string()) {
    if (c == '%' || c == '?' || c == '#') {
      escaped += fmt::format("%{:02x}", c);
    } else {
      escaped += c;
    }
  }
  return escaped;
}

}  // namespace

sqlite3_stmt* IdleStatements::Take(sqlite3* database, const char* sql) {
  if (auto found = by_text_.extract(sql)) return found.mapped().release();
  sqlite3_stmt* statement = nullptr;
  Check(database, sqlite3_prepare_v3(database, sql, -1, SQLITE_PREPARE_PERSISTENT, &statement, nullptr));
  return statement;
}

void IdleStatements::Keep(sqlite3_stmt* statement) {
  constexpr std::size_t kMost = 128;  // texts that are made up while running would never be seen again
  sqlite3_reset(statement);           // its error, if any, was thrown when it was run
  sqlite3_clear_bindings(statement);
  std::unique_ptr<sqlite3_stmt, Finalize> kept(statement);
  if (by_text_.size() < kMost) by_text_.try_emplace(sqlite3_sql(statement), std::move(kept));
}

bool Statement::Step() {
  const int code = sqlite3_step(statement_.get());
  if (code != SQLITE_ROW && code != SQLITE_DONE) Throw(sqlite3_db_handle(statement_.get()), code);
  return code == SQLITE_ROW;
}

bool Statement::IsNull(int column) const { return sqlite3_column_type(statement_.get(), column) == SQLITE_NULL; }
std::int64_t Statement::Integer(int column) const { return sqlite3_column_int64(statement_.get(), column); }
double Statement::Real(int column) const { return sqlite3_column_double(statement_.get(), column); }

std::string_view Statement::View(int column) const {
  const auto* bytes = static_cast<const char*>(sqlite3_column_blob(statement_.get(), column));
  const auto size = static_cast<std::size_t>(sqlite3_column_bytes(statement_.get(), column));
  return bytes ? std::string_view(bytes, size) : std::string_view();
}

void Statement::Bind(int position, std::string_view text) {
  const char* bytes = text.data() ? text.data() : "";
  Check(sqlite3_db_handle(statement_.get()),
        sqlite3_bind_text64(statement_.get(), position, bytes, text.size(), SQLITE_TRANSIENT, SQLITE_UTF8));
}

void Statement::Bind(int position, Blob blob) {
  const char* bytes = blob.bytes.data() ? blob.bytes.data() : "";
  Check(sqlite3_db_handle(statement_.get()),
        sqlite3_bind_blob64(statement_.get(), position, bytes, blob.bytes.size(), SQLITE_TRANSIENT));
}

void Statement::Bind(int position, double value) {
  Check(sqlite3_db_handle(statement_.get()), sqlite3_bind_double(statement_.get(), position, value));
}

void Statement::Bind(int position, std::int64_t value) {
  Check(sqlite3_db_handle(statement_.get()), sqlite3_bind_int64(statement_.get(), position, value));
}

Connection::Connection(const std::string& name, int flags) {
  sqlite3* database = nullptr;
  const int code =
      sqlite3_open_v2(name.c_str(), &database, flags | SQLITE_OPEN_NOMUTEX | SQLITE_OPEN_EXRESCODE, nullptr);
  database_.reset(database);
  if (code != SQLITE_OK) throw InternalError("{}: cannot be opened: {}", name, sqlite3_errstr(code));
  sqlite3_busy_timeout(database, 10'000);
  Run("PRAGMA foreign_keys = ON");
}

Connection Connection::OpenReadWrite(const fs::path& file) {
  Connection connection(file.string(), SQLITE_OPEN_READWRITE | SQLITE_OPEN_CREATE);
  connection.Run("PRAGMA journal_mode = WAL");
  connection.Run("PRAGMA synchronous = FULL");
  return connection;
}

Connection Connection::OpenReadOnly(const fs::path& file) {
  Connection connection(file.string(), SQLITE_OPEN_READONLY);
  try {
    connection.Run("SELECT count(*) FROM sqlite_schema");
  } catch (const Error&) {
    // WAL needs a writable folder even to read; a finished run on read-only storage has no log and can do without.
    if (fs::exists(file.string() + "-wal")) throw;
    connection = Connection("file:" + Escaped(file) + "?immutable=1", SQLITE_OPEN_READONLY | SQLITE_OPEN_URI);
    connection.Run("SELECT count(*) FROM sqlite_schema");
  }
  return connection;
}

Connection Connection::OpenInMemory() { return Connection(":memory:", SQLITE_OPEN_READWRITE | SQLITE_OPEN_CREATE); }

void Connection::RunScript(const std::string& sql) {
  Check(database_.get(), sqlite3_exec(database_.get(), sql.c_str(), nullptr, nullptr, nullptr));
}

Transaction::~Transaction() {
  if (committed_) return;
  try {
    connection_.Run("ROLLBACK");
  } catch (const Error&) {  // SQLite has rolled back by itself, as it does when the disk is full
  }
}

void Transaction::Commit() {
  connection_.Run("COMMIT");
  committed_ = true;
}

}  // namespace evac::sqlite
