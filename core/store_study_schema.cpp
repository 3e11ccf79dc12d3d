#include "core/store_study_database.h"

namespace evac {

/// Documented column by column in docs/formats/study.md.
const char* const kStudySchema = R"sql(
CREATE TABLE study (
  id INTEGER PRIMARY KEY CHECK (id = 1), name TEXT NOT NULL, seed TEXT NOT NULL, raters_per_clip INTEGER NOT NULL,
  width_px INTEGER NOT NULL, height_px INTEGER NOT NULL, period_s REAL NOT NULL, evac_version TEXT NOT NULL);
CREATE TABLE waves (number INTEGER PRIMARY KEY, list_hash TEXT NOT NULL);
CREATE TABLE rubrics (hash TEXT PRIMARY KEY, task TEXT NOT NULL, document TEXT NOT NULL);

CREATE TABLE clips (
  id INTEGER PRIMARY KEY, wave INTEGER NOT NULL REFERENCES waves (number),
  run TEXT NOT NULL, episode TEXT NOT NULL, task TEXT NOT NULL, initial_state TEXT NOT NULL,
  policy TEXT NOT NULL, checkpoint TEXT NOT NULL, world TEXT NOT NULL, is_real INTEGER NOT NULL,
  source_sha256 TEXT NOT NULL, use TEXT NOT NULL CHECK (use IN ('counted', 'gold', 'practice', 'example')),
  reference TEXT, reference_reason TEXT NOT NULL, rubric_hash TEXT NOT NULL REFERENCES rubrics (hash),
  views TEXT NOT NULL, file TEXT NOT NULL UNIQUE, video_sha256 TEXT NOT NULL, frames INTEGER NOT NULL,
  UNIQUE (run, episode));

CREATE TABLE invites (
  secret_hash TEXT PRIMARY KEY, role TEXT NOT NULL, created_ms INTEGER NOT NULL,
  used_by INTEGER REFERENCES raters (id), used_uuid TEXT NOT NULL DEFAULT '');
CREATE TABLE raters (
  id INTEGER PRIMARY KEY, role TEXT NOT NULL, name TEXT NOT NULL, status TEXT NOT NULL, counts INTEGER NOT NULL,
  tab_epoch INTEGER NOT NULL DEFAULT 0, joined_ms INTEGER NOT NULL);
CREATE TABLE sessions (
  secret_hash TEXT PRIMARY KEY, rater INTEGER NOT NULL REFERENCES raters (id), created_ms INTEGER NOT NULL);
CREATE TABLE events (
  id INTEGER PRIMARY KEY AUTOINCREMENT, rater INTEGER REFERENCES raters (id), what TEXT NOT NULL,
  detail TEXT NOT NULL, at_ms INTEGER NOT NULL);

CREATE TABLE presentations (
  id TEXT PRIMARY KEY, rater INTEGER NOT NULL REFERENCES raters (id), clip INTEGER NOT NULL REFERENCES clips (id),
  order_index INTEGER NOT NULL, showing TEXT NOT NULL, repeat_of TEXT REFERENCES presentations (id),
  state TEXT NOT NULL DEFAULT 'open' CHECK (state IN ('open', 'answered', 'unplayable')),
  shown_ms INTEGER, lease_until_ms INTEGER NOT NULL DEFAULT 0,
  UNIQUE (rater, order_index));
CREATE UNIQUE INDEX one_first_showing ON presentations (rater, clip) WHERE repeat_of IS NULL;

CREATE TABLE verdicts (
  id INTEGER PRIMARY KEY AUTOINCREMENT, client_uuid TEXT NOT NULL UNIQUE,
  presentation TEXT NOT NULL REFERENCES presentations (id), rater INTEGER NOT NULL REFERENCES raters (id),
  clip INTEGER NOT NULL REFERENCES clips (id), seq INTEGER NOT NULL,
  supersedes INTEGER UNIQUE REFERENCES verdicts (id),
  label TEXT NOT NULL CHECK (label IN ('success', 'failure', 'cannot_tell', 'retracted')),
  stages INTEGER NOT NULL, progress REAL, flags TEXT NOT NULL, cause TEXT NOT NULL, confidence INTEGER,
  is_final INTEGER NOT NULL, created_ms INTEGER NOT NULL, shown_at_ms REAL NOT NULL, first_play_ms REAL NOT NULL,
  decided_ms REAL NOT NULL, rt_ms REAL NOT NULL, visible_ms REAL NOT NULL, played TEXT NOT NULL, coverage REAL NOT NULL,
  max_speed REAL NOT NULL, median_speed REAL NOT NULL, seeks INTEGER NOT NULL, replays INTEGER NOT NULL,
  pauses INTEGER NOT NULL, stalls_ms REAL NOT NULL, interrupted INTEGER NOT NULL, viewport TEXT NOT NULL,
  pixel_ratio REAL NOT NULL, tab_epoch INTEGER NOT NULL, order_index INTEGER NOT NULL, wave INTEGER NOT NULL,
  rubric_hash TEXT NOT NULL, video_sha256 TEXT NOT NULL, app_version TEXT NOT NULL,
  UNIQUE (rater, seq));
CREATE INDEX verdicts_of_presentation ON verdicts (presentation);
CREATE INDEX verdicts_of_clip ON verdicts (clip);
CREATE TABLE verdict_notes (
  verdict INTEGER PRIMARY KEY REFERENCES verdicts (id), note TEXT NOT NULL, ua_hash TEXT NOT NULL);

CREATE TRIGGER verdicts_stay BEFORE DELETE ON verdicts BEGIN SELECT RAISE(ABORT, 'verdicts are never deleted'); END;
CREATE TRIGGER verdicts_hold BEFORE UPDATE ON verdicts BEGIN SELECT RAISE(ABORT, 'verdicts are never changed'); END;
CREATE TRIGGER clips_stay BEFORE DELETE ON clips BEGIN SELECT RAISE(ABORT, 'a study is frozen'); END;
CREATE TRIGGER clips_hold BEFORE UPDATE ON clips BEGIN SELECT RAISE(ABORT, 'a study is frozen'); END;

CREATE TABLE guesses (
  rater INTEGER NOT NULL REFERENCES raters (id), clip INTEGER NOT NULL REFERENCES clips (id),
  guess TEXT NOT NULL CHECK (guess IN ('real', 'generated', 'unsure')), at_ms INTEGER NOT NULL,
  PRIMARY KEY (rater, clip));

CREATE VIEW current_verdicts AS
  SELECT v.* FROM verdicts v
  WHERE v.label <> 'retracted' AND NOT EXISTS (SELECT 1 FROM verdicts s WHERE s.supersedes = v.id);
CREATE VIEW votes AS
  SELECT v.* FROM current_verdicts v JOIN raters r ON r.id = v.rater JOIN presentations p ON p.id = v.presentation
  WHERE r.counts = 1 AND p.showing IN ('counted', 'gold', 'import');
PRAGMA user_version = 1;
)sql";

/// A rater's next clip, who holds or answered one, how far a rater is: each read from an index of just those rows.
const char* const kStudyIndexes = R"sql(
CREATE TABLE IF NOT EXISTS round_trips (wave INTEGER PRIMARY KEY REFERENCES waves (number), codec_sha256 TEXT NOT NULL);
CREATE INDEX IF NOT EXISTS presentations_to_finish ON presentations (rater, order_index)
  WHERE state = 'open' AND shown_ms IS NOT NULL;
CREATE INDEX IF NOT EXISTS presentations_to_come ON presentations (rater, order_index)
  WHERE state = 'open' AND shown_ms IS NULL;
CREATE INDEX IF NOT EXISTS presentations_held ON presentations (clip, lease_until_ms)
  WHERE state = 'open' AND lease_until_ms > 0;
CREATE INDEX IF NOT EXISTS presentations_of_rater ON presentations (rater, showing, state);
CREATE INDEX IF NOT EXISTS presentations_answered ON presentations (clip, showing, rater) WHERE state = 'answered';
DROP INDEX IF EXISTS presentations_of_clip;
)sql";

}  // namespace evac
