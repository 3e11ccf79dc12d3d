#include <fmt/format.h>

#include <string>

#include "core/store_study.h"
#include "core/store_study_database.h"

/// What leaves a study as a table. Columns are named as they are stored, so that none can be forgotten.
namespace evac {
namespace {

#define EVAC_OWN_COLUMNS                                                                                           \
  "v.id AS verdict, v.seq, v.rater, p.showing, p.repeat_of, v.presentation, v.client_uuid, v.supersedes, "         \
  "NOT EXISTS (SELECT 1 FROM verdicts s WHERE s.supersedes = v.id) AS is_current, v.label, v.stages, v.progress, " \
  "v.flags, v.cause, coalesce(n.note, '') AS note, v.confidence, v.is_final, v.created_ms, v.shown_at_ms, "        \
  "v.first_play_ms, v.decided_ms, v.rt_ms, v.visible_ms, v.played, v.coverage, v.max_speed, v.median_speed, "      \
  "v.seeks, v.replays, v.pauses, v.stalls_ms, v.interrupted, v.viewport, v.pixel_ratio, "                          \
  "coalesce(n.ua_hash, '') AS ua_hash, v.tab_epoch, v.order_index, v.wave, v.rubric_hash, v.video_sha256, "        \
  "v.app_version"

constexpr const char* kOwnNames[] = {
    "verdict",    "seq",         "rater",     "showing",     "repeat_of",    "presentation",  "client_uuid",
    "supersedes", "is_current",  "label",     "stages",      "progress",     "flags",         "cause",
    "note",       "confidence",  "is_final",  "created_ms",  "shown_at_ms",  "first_play_ms", "decided_ms",
    "rt_ms",      "visible_ms",  "played",    "coverage",    "max_speed",    "median_speed",  "seeks",
    "replays",    "pauses",      "stalls_ms", "interrupted", "viewport",     "pixel_ratio",   "ua_hash",
    "tab_epoch",  "order_index", "wave",      "rubric_hash", "video_sha256", "app_version"};
constexpr const char* kClipNames[] = {"rater_role", "rater_status", "rater_counts",  "study",  "run",
                                      "episode",    "task",         "initial_state", "policy", "checkpoint",
                                      "world",      "is_real",      "reference"};

void Fill(StudyTable& table, sqlite::Statement row) {
  while (row.Step()) {
    std::vector<std::string> cells;
    for (int column = 0; column < static_cast<int>(table.columns.size()); ++column) cells.push_back(row.Text(column));
    table.rows.push_back(std::move(cells));
  }
}

}  // namespace

StudyTable StudyStore::VerdictTable() const {
  RequireWhole();
  StudyTable table;
  table.columns.assign(std::begin(kOwnNames), std::end(kOwnNames));
  table.columns.insert(table.columns.end(), std::begin(kClipNames), std::end(kClipNames));
  Fill(table, database_->connection.Query(
                  "SELECT " EVAC_OWN_COLUMNS
                  ", r.role, r.status, r.counts, s.name, c.run, c.episode, c.task, c.initial_state, c.policy, "
                  "c.checkpoint, c.world, c.is_real, c.reference FROM verdicts v JOIN presentations p ON p.id = "
                  "v.presentation JOIN clips c ON c.id = v.clip JOIN raters r ON r.id = v.rater JOIN study s "
                  "LEFT JOIN verdict_notes n ON n.verdict = v.id ORDER BY v.id"));
  return table;
}

StudyTable StudyStore::VerdictTableOf(std::int64_t rater) const {
  StudyTable table;
  table.columns.assign(std::begin(kOwnNames), std::end(kOwnNames));
  Fill(table, database_->connection.Query(
                  "SELECT " EVAC_OWN_COLUMNS
                  " FROM verdicts v JOIN presentations p ON p.id = v.presentation LEFT JOIN verdict_notes n ON "
                  "n.verdict = v.id WHERE v.rater = ? ORDER BY v.id",
                  rater));
  // Which clips were gold or shown twice would tell a rater what to watch for; which came later, whose they are.
  for (std::vector<std::string>& row : table.rows) {
    if (row[3] != "practice") row[3] = "clip";
    for (const unsigned hidden : {4u, 37u, 39u}) row[hidden].clear();  // repeat_of, wave, video_sha256
  }
  return table;
}

}  // namespace evac
