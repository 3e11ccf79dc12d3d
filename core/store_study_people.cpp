#include <utility>

#include "core/error.h"
#include "core/hash.h"
#include "core/secret.h"
#include "core/store_study.h"
#include "core/store_study_database.h"

/// Links, raters, sessions.
namespace evac {
namespace {

constexpr const char* kRaterColumns =
    "SELECT r.id, r.role, r.name, r.status, r.counts, r.tab_epoch, r.joined_ms FROM raters r ";

StudyRater RaterOf(const sqlite::Statement& row) {
  StudyRater rater;
  rater.id = row.Integer(0);
  rater.role = RaterRoleFromName(row.Text(1));
  rater.name = row.Text(2);
  rater.status = row.Text(3);
  rater.counts = row.Integer(4) != 0;
  rater.tab_epoch = row.Integer(5);
  rater.joined_ms = row.Integer(6);
  return rater;
}

std::int64_t LastRow(sqlite::Connection& connection) {
  sqlite::Statement row = connection.Query("SELECT last_insert_rowid()");
  row.Step();
  return row.Integer(0);
}

}  // namespace

void StudyStore::AddInvite(const std::string& secret, RaterRole role, std::int64_t now_ms) {
  database_->connection.Run("INSERT INTO invites (secret_hash, role, created_ms) VALUES (?, ?, ?)", Sha256Hex(secret),
                            Name(role), now_ms);
}

std::optional<StudyStore::Invite> StudyStore::FindInvite(const std::string& secret) const {
  const std::string hash = Sha256Hex(secret);
  sqlite::Statement row = database_->connection.Query(
      "SELECT role, used_by, used_uuid, secret_hash FROM invites WHERE secret_hash = ?", hash);
  if (!row.Step() || !SameSecret(row.View(3), hash)) return std::nullopt;
  Invite invite{RaterRoleFromName(row.Text(0)), std::nullopt, row.Text(2)};
  if (!row.IsNull(1)) invite.used_by = row.Integer(1);
  return invite;
}

StudyRater StudyStore::Join(const std::string& secret, const std::string& uuid, const std::string& name,
                            std::int64_t now_ms) {
  sqlite::Connection& connection = database_->connection;
  const std::optional<Invite> invite = FindInvite(secret);
  if (!invite || invite->used_by) throw InternalError("a link that is not free was to be used");
  connection.Run("INSERT INTO raters (role, name, status, counts, joined_ms) VALUES (?, ?, 'active', 1, ?)",
                 Name(invite->role), name, now_ms);
  const std::int64_t id = LastRow(connection);
  connection.Run("UPDATE invites SET used_by = ?, used_uuid = ? WHERE secret_hash = ?", id, uuid, Sha256Hex(secret));
  AddEvent(id, "joined", "", now_ms);
  return Rater(id);
}

StudyRater StudyStore::ImportedRater(const std::string& name, std::int64_t now_ms) {
  sqlite::Connection& connection = database_->connection;
  sqlite::Statement row =
      connection.Query((std::string(kRaterColumns) + "WHERE r.status = 'imported' AND r.name = ?").c_str(), name);
  if (row.Step()) return RaterOf(row);
  connection.Run("INSERT INTO raters (role, name, status, counts, joined_ms) VALUES ('rater', ?, 'imported', 1, ?)",
                 name, now_ms);
  return Rater(LastRow(connection));
}

void StudyStore::AddSession(std::int64_t rater, const std::string& secret, std::int64_t now_ms) {
  database_->connection.Run("INSERT INTO sessions VALUES (?, ?, ?)", Sha256Hex(secret), rater, now_ms);
}

std::optional<StudyRater> StudyStore::RaterOfSession(const std::string& secret) const {
  const std::string hash = Sha256Hex(secret);
  sqlite::Statement row =
      database_->connection.Query("SELECT rater, secret_hash FROM sessions WHERE secret_hash = ?", hash);
  if (!row.Step() || !SameSecret(row.View(1), hash)) return std::nullopt;
  return Rater(row.Integer(0));
}

StudyRater StudyStore::Rater(std::int64_t id) const {
  sqlite::Statement row = database_->connection.Query((std::string(kRaterColumns) + "WHERE r.id = ?").c_str(), id);
  if (!row.Step()) throw DamagedStudy(folder(), fmt::format("there is no rater {}", id), "everyone whom a row names");
  return RaterOf(row);
}

std::vector<StudyRater> StudyStore::Raters() const {
  sqlite::Statement row = database_->connection.Query((std::string(kRaterColumns) + "ORDER BY r.id").c_str());
  std::vector<StudyRater> raters;
  while (row.Step()) raters.push_back(RaterOf(row));
  return raters;
}

std::int64_t StudyStore::NextTab(std::int64_t rater) {
  database_->connection.Run("UPDATE raters SET tab_epoch = tab_epoch + 1 WHERE id = ?", rater);
  return Rater(rater).tab_epoch;
}

void StudyStore::Withdraw(std::int64_t rater, bool keep, bool erase, std::int64_t now_ms) {
  sqlite::Connection& connection = database_->connection;
  const char* status = erase ? "erased" : keep ? "withdrawn" : "excluded";
  connection.Run("UPDATE raters SET status = ?, counts = ? WHERE id = ?", status, keep ? 1 : 0, rater);
  connection.Run("DELETE FROM sessions WHERE rater = ?", rater);
  connection.Run("UPDATE presentations SET lease_until_ms = 0 WHERE rater = ?", rater);
  if (erase) {
    connection.Run("UPDATE raters SET name = '' WHERE id = ?", rater);
    connection.Run("DELETE FROM verdict_notes WHERE verdict IN (SELECT id FROM verdicts WHERE rater = ?)", rater);
  }
  AddEvent(rater, status, keep ? "verdicts count" : "verdicts do not count", now_ms);
}

void StudyStore::AddEvent(std::int64_t rater, const std::string& what, const std::string& detail, std::int64_t now_ms) {
  database_->connection.Run("INSERT INTO events (rater, what, detail, at_ms) VALUES (?, ?, ?, ?)", rater, what, detail,
                            now_ms);
}

void StudyStore::AddGuess(std::int64_t rater, std::int64_t clip, const std::string& guess, std::int64_t now_ms) {
  database_->connection.Run("INSERT OR IGNORE INTO guesses VALUES (?, ?, ?, ?)", rater, clip, guess, now_ms);
}

std::vector<StudyStore::Guess> StudyStore::Guesses() const {
  sqlite::Statement row = database_->connection.Query(
      "SELECT g.rater, g.clip, g.guess FROM guesses g JOIN raters r ON r.id = g.rater WHERE r.counts = 1 "
      "ORDER BY g.rater, g.clip");
  std::vector<Guess> guesses;
  while (row.Step()) guesses.push_back({row.Integer(0), row.Integer(1), row.Text(2)});
  return guesses;
}

}  // namespace evac
