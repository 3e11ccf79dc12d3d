#pragma once

#include <sqlite3.h>

#include <concepts>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <unordered_map>

/// SQLite, owned and with exceptions. Used by core/store*.cpp only.
namespace evac::sqlite {

/// Marks bytes to be bound as a BLOB, not as TEXT.
struct Blob {
  std::string_view bytes;
};

/// Prepared statements that nobody uses just now, by their text: to prepare one takes longer than most take to run.
class IdleStatements {
 public:
  /// One that was kept, or a new one.
  sqlite3_stmt* Take(sqlite3* database, const char* sql);
  void Keep(sqlite3_stmt* statement);

 private:
  struct Finalize {
    void operator()(sqlite3_stmt* statement) const { sqlite3_finalize(statement); }
  };
  std::unordered_map<std::string, std::unique_ptr<sqlite3_stmt, Finalize>> by_text_;
};

/// One prepared statement with its values. Columns count from 0, parameters are bound in their order. Ends before its
/// connection does.
class Statement {
 public:
  Statement(sqlite3* database, IdleStatements& idle, const char* sql)
      : statement_(idle.Take(database, sql), GiveBack{&idle}) {}

  template <typename... Values>
  void BindAll(const Values&... values) {
    int position = 0;
    (Bind(++position, values), ...);
  }
  /// True while there is a row. @throws Error
  bool Step();

  bool IsNull(int column) const;
  std::int64_t Integer(int column) const;
  double Real(int column) const;
  std::string_view View(int column) const;  ///< of TEXT or BLOB, until the next step; "" for NULL
  std::string Text(int column) const { return std::string(View(column)); }

 private:
  void Bind(int position, std::string_view text);
  void Bind(int position, const std::string& text) { Bind(position, std::string_view(text)); }
  void Bind(int position, const char* text) { Bind(position, std::string_view(text)); }
  void Bind(int position, Blob blob);
  void Bind(int position, double value);
  void Bind(int position, std::int64_t value);
  template <std::integral Integer>
  void Bind(int position, Integer value) {
    Bind(position, static_cast<std::int64_t>(value));
  }
  template <typename Value>
  void Bind(int position, const std::optional<Value>& value) {
    if (value) Bind(position, *value);  // a fresh parameter is NULL
  }

  struct GiveBack {
    IdleStatements* idle;
    void operator()(sqlite3_stmt* statement) const { idle->Keep(statement); }
  };
  std::unique_ptr<sqlite3_stmt, GiveBack> statement_;
};

class Connection {
 public:
  /// @throws Error naming the file, if it is no database or cannot be opened.
  static Connection OpenReadWrite(const std::filesystem::path& file);
  static Connection OpenReadOnly(const std::filesystem::path& file);
  static Connection OpenInMemory();

  template <typename... Values>
  Statement Query(const char* sql, const Values&... values) {
    Statement statement(database_.get(), *idle_, sql);
    statement.BindAll(values...);
    return statement;
  }
  /// Runs one statement to its end.
  template <typename... Values>
  void Run(const char* sql, const Values&... values) {
    Statement statement = Query(sql, values...);
    while (statement.Step()) {
    }
  }
  /// Runs a text of several statements.
  void RunScript(const std::string& sql);

 private:
  Connection(const std::string& name, int flags);

  struct Close {
    void operator()(sqlite3* database) const { sqlite3_close_v2(database); }  // waits for its idle statements
  };
  std::unique_ptr<sqlite3, Close> database_;
  std::unique_ptr<IdleStatements> idle_ = std::make_unique<IdleStatements>();
};

/// Everything until Commit happens, or nothing does.
class Transaction {
 public:
  explicit Transaction(Connection& connection) : connection_(connection) { connection_.Run("BEGIN IMMEDIATE"); }
  ~Transaction();
  Transaction(const Transaction&) = delete;
  Transaction& operator=(const Transaction&) = delete;

  void Commit();

 private:
  Connection& connection_;
  bool committed_ = false;
};

}  // namespace evac::sqlite
