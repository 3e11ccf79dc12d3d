#include "core/store_rows.h"

namespace evac::rows {

void InsertRealTrial(sqlite::Connection& connection, const RealTrial& trial) {
  const auto video = trial.video.empty() ? std::nullopt : std::optional(trial.video);
  connection.Run(
      "INSERT INTO real_trials (task, initial_state, policy, checkpoint, trial, outcome, video, source) "
      "VALUES (?, ?, ?, ?, ?, ?, ?, ?)",
      trial.task, trial.initial_state, trial.policy, trial.checkpoint, trial.trial, Name(trial.outcome), video,
      trial.source);
}

std::vector<RealTrial> SelectRealTrials(sqlite::Connection& connection) {
  std::vector<RealTrial> trials;
  if (!HasTable(connection, "real_trials")) return trials;
  for (auto row = connection.Query("SELECT task, initial_state, policy, checkpoint, trial, outcome, video, source "
                                   "FROM real_trials ORDER BY id");
       row.Step();) {
    trials.push_back({row.Text(0), row.Text(1), row.Text(2), row.Text(3), row.Integer(4), LabelFromName(row.Text(5)),
                      row.Text(6), row.Text(7)});
  }
  return trials;
}

void InsertLook(sqlite::Connection& connection, const SequentialLook& look) {
  connection.Run(
      "INSERT INTO sequential_looks (comparison, task, pairs, only_first, only_second, e_value) "
      "VALUES (?, ?, ?, ?, ?, ?)",
      look.comparison, look.task, look.pairs, look.only_first, look.only_second, look.e_value);
}

std::vector<SequentialLook> SelectLooks(sqlite::Connection& connection) {
  std::vector<SequentialLook> looks;
  if (!HasTable(connection, "sequential_looks")) return looks;
  for (auto row = connection.Query("SELECT comparison, task, pairs, only_first, only_second, e_value "
                                   "FROM sequential_looks ORDER BY id");
       row.Step();) {
    looks.push_back({row.Text(0), row.Text(1), row.Integer(2), row.Integer(3), row.Integer(4), row.Real(5)});
  }
  return looks;
}

void InsertGateRecord(sqlite::Connection& connection, const GateRecord& record) {
  connection.Run("INSERT INTO gate_decisions (key, gate, outcome, document) VALUES (?, ?, ?, ?)", record.key,
                 record.gate, record.outcome, record.document);
}

/// REPLACE is no DELETE to the trigger that keeps decisions: nothing but the id changes, and nothing refers to that.
void MoveGateRecordLast(sqlite::Connection& connection, const std::string& key) {
  connection.Run(
      "INSERT OR REPLACE INTO gate_decisions (key, gate, outcome, document) "
      "SELECT key, gate, outcome, document FROM gate_decisions WHERE key = ?",
      key);
}

std::vector<GateRecord> SelectGateRecords(sqlite::Connection& connection) {
  std::vector<GateRecord> records;
  if (!HasTable(connection, "gate_decisions")) return records;
  for (auto row = connection.Query("SELECT key, gate, outcome, document FROM gate_decisions ORDER BY id"); row.Step();)
    records.push_back({row.Text(0), row.Text(1), row.Text(2), row.Text(3)});
  return records;
}

}  // namespace evac::rows
