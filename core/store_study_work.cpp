#include <fmt/format.h>

#include <algorithm>
#include <utility>

#include "core/error.h"
#include "core/store_study.h"
#include "core/store_study_database.h"

/// Who sees what, and what was said of it.
namespace evac {
namespace {

constexpr const char* kPresentationColumns =
    "SELECT p.id, p.rater, p.clip, p.order_index, p.showing, p.repeat_of, p.state, p.shown_ms, p.lease_until_ms "
    "FROM presentations p ";

std::string PresentationsWhere(const std::string& condition) {
  return fmt::format("{}{}", kPresentationColumns, condition);
}

Presentation PresentationOf(const sqlite::Statement& row) {
  Presentation presentation;
  presentation.id = row.Text(0);
  presentation.rater = row.Integer(1);
  presentation.clip = row.Integer(2);
  presentation.order_index = static_cast<int>(row.Integer(3));
  presentation.showing = ShowingFromName(row.Text(4));
  presentation.repeat_of = row.Text(5);
  presentation.state = row.Text(6);
  if (!row.IsNull(7)) presentation.shown_ms = row.Integer(7);
  presentation.lease_until_ms = row.Integer(8);
  return presentation;
}

#define EVAC_VERDICT_COLUMNS                                                                                     \
  "v.id, v.client_uuid, v.presentation, v.rater, v.clip, v.supersedes, v.label, v.stages, v.progress, v.flags, " \
  "v.cause, coalesce(n.note, ''), v.confidence, v.is_final, v.created_ms, v.shown_at_ms, v.first_play_ms, "      \
  "v.decided_ms, v.rt_ms, v.visible_ms, v.played, v.coverage, v.max_speed, v.median_speed, v.seeks, v.replays, " \
  "v.pauses, v.stalls_ms, v.interrupted, v.viewport, v.pixel_ratio, coalesce(n.ua_hash, ''), v.tab_epoch, "      \
  "v.app_version"
constexpr int kVerdictColumns = 34;

HumanVerdict VerdictOf(const sqlite::Statement& row) {
  HumanVerdict v;
  int column = 0;
  const auto integer = [&] { return row.Integer(column++); };
  const auto count = [&] { return static_cast<int>(row.Integer(column++)); };
  const auto real = [&] { return row.Real(column++); };
  const auto text = [&] { return row.Text(column++); };
  v.id = integer(), v.client_uuid = text(), v.presentation = text(), v.rater = integer(), v.clip = integer();
  if (!row.IsNull(column++)) v.supersedes = row.Integer(column - 1);
  v.label = text(), v.stages = count();
  if (!row.IsNull(column++)) v.progress = row.Real(column - 1);
  v.flags = text(), v.cause = text(), v.note = text();
  if (!row.IsNull(column++)) v.confidence = static_cast<int>(row.Integer(column - 1));
  v.is_final = integer() != 0, v.created_ms = integer(), v.shown_at_ms = real(), v.first_play_ms = real();
  v.decided_ms = real(), v.rt_ms = real(), v.visible_ms = real(), v.played = text(), v.coverage = real();
  v.max_speed = real(), v.median_speed = real(), v.seeks = count(), v.replays = count(), v.pauses = count();
  v.stalls_ms = real(), v.interrupted = integer() != 0, v.viewport = text(), v.pixel_ratio = real();
  v.ua_hash = text(), v.tab_epoch = integer(), v.app_version = text();
  return v;
}

std::optional<HumanVerdict> First(sqlite::Statement row) {
  if (!row.Step()) return std::nullopt;
  return VerdictOf(row);
}

#define EVAC_SAID                                                                                                     \
  "SELECT " EVAC_VERDICT_COLUMNS                                                                                      \
  ", p.showing, p.repeat_of, r.counts, r.role FROM current_verdicts v JOIN presentations p ON p.id = v.presentation " \
  "JOIN raters r ON r.id = v.rater LEFT JOIN verdict_notes n ON n.verdict = v.id "

std::vector<StudyStore::Said> AllSaid(sqlite::Statement row) {
  std::vector<StudyStore::Said> all;
  while (row.Step()) {
    StudyStore::Said said;
    said.verdict = VerdictOf(row);
    said.showing = ShowingFromName(row.Text(kVerdictColumns));
    said.repeat_of = row.Text(kVerdictColumns + 1);
    said.counts = row.Integer(kVerdictColumns + 2) != 0;
    said.role = RaterRoleFromName(row.Text(kVerdictColumns + 3));
    all.push_back(std::move(said));
  }
  return all;
}

/// Whether a presentation that is open and was never shown wants this rater (?1) at this time (?2). Its clip's votes
/// are those that the view `votes` has, read from one index: what is answered, by raters who count.
std::string WantsRater(const char* p) {
  return fmt::format(
      "({0}.showing IN ('gold', 'practice', 'adjudication') OR {0}.showing = 'counted' AND "
      "(SELECT count(*) FROM presentations a WHERE a.clip = {0}.clip AND a.state = 'answered' "
      "AND a.showing IN ('counted', 'gold', 'import') AND a.rater NOT IN (SELECT id FROM raters WHERE counts = 0)) + "
      "(SELECT count(*) FROM presentations o WHERE o.clip = {0}.clip AND o.state = 'open' AND o.lease_until_ms > 0 "
      "AND o.lease_until_ms > ?2 AND o.rater <> ?1 AND o.showing = 'counted') < "
      "(SELECT raters_per_clip FROM study))",
      p);
}

/// Whether a presentation is asked for yet, as above; what was shown and not answered always is.
std::string IsAhead(const char* p) {
  return fmt::format("({0}.state = 'open' AND ({0}.shown_ms IS NOT NULL OR {1}))", p, WantsRater(p));
}

}  // namespace

void StudyStore::AddPresentations(std::span<const Presentation> presentations) {
  for (const Presentation& p : presentations) {
    database_->connection.Run(
        "INSERT INTO presentations (id, rater, clip, order_index, showing, repeat_of, state, shown_ms) "
        "VALUES (?, ?, ?, ?, ?, ?, ?, ?)",
        p.id, p.rater, p.clip, p.order_index, Name(p.showing),
        p.repeat_of.empty() ? std::nullopt : std::optional<std::string>(p.repeat_of), p.state, p.shown_ms);
  }
}

std::optional<Presentation> StudyStore::FindPresentation(const std::string& id) const {
  sqlite::Statement row =
      database_->connection.Query(PresentationsWhere("WHERE p.id = ?").c_str(), id);
  if (!row.Step()) return std::nullopt;
  return PresentationOf(row);
}

std::vector<Presentation> StudyStore::PresentationsOf(std::int64_t rater) const {
  sqlite::Statement row = database_->connection.Query(
      PresentationsWhere("WHERE p.rater = ? ORDER BY p.order_index").c_str(), rater);
  std::vector<Presentation> presentations;
  while (row.Step()) presentations.push_back(PresentationOf(row));
  return presentations;
}

StudyStore::Progress StudyStore::ProgressOf(std::int64_t rater, std::int64_t now_ms) const {
  static const std::string query = fmt::format(
      "SELECT p.showing, p.state = 'answered', count(*) FROM presentations p WHERE p.rater = ?1 AND "
      "(p.state = 'answered' OR {} OR p.state = 'open' AND p.showing = 'repeat' AND EXISTS "
      "(SELECT 1 FROM presentations f WHERE f.id = p.repeat_of AND (f.state = 'answered' OR {}))) GROUP BY 1, 2",
      IsAhead("p"), IsAhead("f"));
  sqlite::Statement row = database_->connection.Query(query.c_str(), rater, now_ms);
  Progress progress;
  while (row.Step()) {
    const Showing showing = ShowingFromName(row.Text(0));
    const bool is_answered = row.Integer(1) != 0;
    if (showing == Showing::kExample) continue;
    if (showing == Showing::kPractice) {
      if (!is_answered) progress.practice_left += row.Integer(2);
      continue;
    }
    progress.total += row.Integer(2);
    if (is_answered) progress.done += row.Integer(2);
  }
  return progress;
}

std::optional<Presentation> StudyStore::NextOpen(std::int64_t rater, std::span<const std::string> held,
                                                 std::int64_t now_ms) const {
  const auto first_not_held = [held](sqlite::Statement row) -> std::optional<Presentation> {
    while (row.Step()) {
      Presentation found = PresentationOf(row);
      if (std::ranges::find(held, found.id) == held.end()) return found;
    }
    return std::nullopt;
  };
  // What was shown and not answered comes first: a reload goes on where it was, an undone verdict is asked again.
  sqlite::Connection& connection = database_->connection;
  if (auto shown = first_not_held(connection.Query(
          PresentationsWhere("WHERE p.rater = ? AND p.state = 'open' AND p.shown_ms IS NOT NULL ORDER BY p.order_index")
              .c_str(),
          rater)))
    return shown;
  // The index stands in the order asked for, so that rows are looked at until the first that is wanted.
  return first_not_held(connection.Query(
      PresentationsWhere(
          "INDEXED BY presentations_to_come WHERE p.rater = ?1 AND p.state = 'open' AND p.shown_ms IS NULL "
          "AND (p.showing = 'repeat' AND EXISTS (SELECT 1 FROM presentations f WHERE f.id = p.repeat_of AND f.state = "
          "'answered') OR " +
          WantsRater("p") + ") ORDER BY p.order_index")
          .c_str(),
      rater, now_ms));
}

void StudyStore::Lease(const std::string& presentation, std::int64_t until_ms, std::int64_t now_ms) {
  database_->connection.Run(
      "UPDATE presentations SET lease_until_ms = ?, shown_ms = coalesce(shown_ms, ?) WHERE id = ?", until_ms, now_ms,
      presentation);
}

void StudyStore::SetState(const std::string& presentation, const std::string& state) {
  database_->connection.Run("UPDATE presentations SET state = ? WHERE id = ?", state, presentation);
}

HumanVerdict StudyStore::AddVerdict(HumanVerdict v) {
  sqlite::Connection& connection = database_->connection;
  connection.Run(
      "INSERT INTO verdicts (client_uuid, presentation, rater, clip, seq, supersedes, label, stages, progress, flags, "
      "cause, confidence, is_final, created_ms, shown_at_ms, first_play_ms, decided_ms, rt_ms, visible_ms, played, "
      "coverage, max_speed, median_speed, seeks, replays, pauses, stalls_ms, interrupted, viewport, pixel_ratio, "
      "tab_epoch, app_version, order_index, wave, rubric_hash, video_sha256) SELECT ?1, p.id, p.rater, p.clip, "
      "1 + (SELECT coalesce(max(seq), 0) FROM verdicts WHERE rater = p.rater), ?2, ?3, ?4, ?5, ?6, ?7, ?8, ?9, ?10, "
      "?11, ?12, ?13, ?14, ?15, ?16, ?17, ?18, ?19, ?20, ?21, ?22, ?23, ?24, ?25, ?26, ?27, ?28, p.order_index, "
      "c.wave, c.rubric_hash, c.video_sha256 FROM presentations p JOIN clips c ON c.id = p.clip WHERE p.id = ?29",
      v.client_uuid, v.supersedes, v.label, v.stages, v.progress, v.flags, v.cause, v.confidence, v.is_final ? 1 : 0,
      v.created_ms, v.shown_at_ms, v.first_play_ms, v.decided_ms, v.rt_ms, v.visible_ms, v.played, v.coverage,
      v.max_speed, v.median_speed, v.seeks, v.replays, v.pauses, v.stalls_ms, v.interrupted ? 1 : 0, v.viewport,
      v.pixel_ratio, v.tab_epoch, v.app_version, v.presentation);
  const std::optional<HumanVerdict> stored = VerdictByUuid(v.client_uuid);
  if (!stored) throw InternalError("there is no presentation {}", v.presentation);
  if (!v.note.empty() || !v.ua_hash.empty())
    connection.Run("INSERT INTO verdict_notes VALUES (?, ?, ?)", stored->id, v.note, v.ua_hash);
  return *VerdictById(stored->id);
}

std::optional<HumanVerdict> StudyStore::VerdictByUuid(const std::string& uuid) const {
  return First(database_->connection.Query(
      "SELECT " EVAC_VERDICT_COLUMNS
      " FROM verdicts v LEFT JOIN verdict_notes n ON n.verdict = v.id WHERE v.client_uuid = ?",
      uuid));
}

std::optional<HumanVerdict> StudyStore::VerdictById(std::int64_t id) const {
  return First(database_->connection.Query(
      "SELECT " EVAC_VERDICT_COLUMNS " FROM verdicts v LEFT JOIN verdict_notes n ON n.verdict = v.id WHERE v.id = ?",
      id));
}

std::optional<HumanVerdict> StudyStore::LastVerdict(const std::string& presentation) const {
  return First(database_->connection.Query(
      "SELECT " EVAC_VERDICT_COLUMNS
      " FROM verdicts v LEFT JOIN verdict_notes n ON n.verdict = v.id WHERE v.presentation = ? "
      "AND NOT EXISTS (SELECT 1 FROM verdicts s WHERE s.supersedes = v.id)",
      presentation));
}

std::optional<HumanVerdict> StudyStore::CurrentVerdict(const std::string& presentation) const {
  return First(database_->connection.Query(
      "SELECT " EVAC_VERDICT_COLUMNS
      " FROM current_verdicts v LEFT JOIN verdict_notes n ON n.verdict = v.id WHERE v.presentation = ?",
      presentation));
}

std::vector<StudyStore::Said> StudyStore::Current() const {
  return AllSaid(database_->connection.Query(EVAC_SAID "ORDER BY v.id"));
}

std::vector<StudyStore::Said> StudyStore::CurrentOf(std::int64_t clip) const {
  return AllSaid(database_->connection.Query(EVAC_SAID "WHERE v.clip = ? ORDER BY v.id", clip));
}

std::vector<StudyStore::Said> StudyStore::CurrentBy(std::int64_t rater) const {
  return AllSaid(database_->connection.Query(EVAC_SAID "WHERE v.rater = ? ORDER BY v.id", rater));
}

std::vector<StudyStore::Ballot> StudyStore::BallotsAfter(std::int64_t verdict) const {
  sqlite::Statement row = database_->connection.Query(
      "SELECT v.id, coalesce(v.supersedes, 0), v.rater, v.clip, v.label, p.showing, r.role, v.is_final, v.stages, "
      "v.flags <> '', v.rt_ms, v.max_speed, v.created_ms FROM verdicts v JOIN presentations p ON p.id = v.presentation "
      "JOIN raters r ON r.id = v.rater WHERE v.id > ? ORDER BY v.id",
      verdict);
  std::vector<Ballot> ballots;
  while (row.Step()) {
    ballots.push_back({row.Integer(0), row.Integer(1), row.Integer(2), row.Integer(3), row.Text(4),
                       ShowingFromName(row.Text(5)), RaterRoleFromName(row.Text(6)), row.Integer(7) != 0,
                       static_cast<int>(row.Integer(8)), row.Integer(9) != 0, row.Real(10), row.Real(11),
                       row.Integer(12)});
  }
  return ballots;
}

std::vector<std::int64_t> StudyStore::Disputes() const {
  sqlite::Statement row = database_->connection.Query(
      "WITH tally AS (SELECT clip, count(*) AS n, sum(label = 'success') AS s, sum(label = 'failure') AS f, "
      "sum(flags <> '') AS flagged FROM votes GROUP BY clip) "
      "SELECT t.clip FROM tally t JOIN clips c ON c.id = t.clip WHERE t.n >= (SELECT raters_per_clip FROM study) "
      "AND (t.s > 0 AND t.f > 0 OR t.s + t.f < min(2, (SELECT raters_per_clip FROM study)) OR t.flagged >= 2 "
      "OR c.reference = 'failure' AND t.s > t.f OR c.reference = 'success' AND t.f > t.s) "
      "AND NOT EXISTS (SELECT 1 FROM current_verdicts v JOIN presentations p ON p.id = v.presentation "
      "JOIN raters r ON r.id = v.rater WHERE v.clip = t.clip AND p.showing = 'adjudication' AND v.is_final = 1 "
      "AND r.counts = 1) ORDER BY t.clip");
  std::vector<std::int64_t> clips;
  while (row.Step()) clips.push_back(row.Integer(0));
  return clips;
}

std::vector<StudyStore::Unplayable> StudyStore::UnplayableClips() const {
  sqlite::Statement row = database_->connection.Query(
      "SELECT e.rater, p.clip, substr(e.detail, 34) FROM events e JOIN presentations p ON p.id = substr(e.detail, 1, "
      "32) "
      "WHERE e.what = 'unplayable' ORDER BY e.id DESC");
  std::vector<Unplayable> clips;
  while (row.Step()) clips.push_back({row.Integer(0), row.Integer(1), row.Text(2)});
  return clips;
}

std::vector<Presentation> StudyStore::Leases(std::int64_t now_ms) const {
  sqlite::Statement row = database_->connection.Query(
      PresentationsWhere("WHERE p.state = 'open' AND p.lease_until_ms > 0 AND p.lease_until_ms > ? ORDER BY p.rater")
          .c_str(),
      now_ms);
  std::vector<Presentation> leases;
  while (row.Step()) leases.push_back(PresentationOf(row));
  return leases;
}

}  // namespace evac
