#include <algorithm>

#include "core/error.h"
#include "core/store_codec.h"
#include "core/store_rows.h"

namespace evac::rows {
namespace {

/// Their order is ReadEpisode's.
#define EVAC_EPISODE_COLUMNS                                                                                        \
  "task, initial_state, policy, checkpoint, seed, world, chunks, stop, stop_reason, failure, video, video_sha256, " \
  "thumbnail"

Episode ReadEpisode(const sqlite::Statement& row) {
  Episode episode;
  episode.key.pair = {row.Text(0), row.Text(1), row.Text(2), row.Text(3), static_cast<std::uint64_t>(row.Integer(4))};
  episode.key.world = row.Text(5);
  episode.chunks = static_cast<int>(row.Integer(6));
  episode.stop = StopReasonFromName(row.Text(7));
  episode.stop_reason = row.Text(8);
  episode.failure = row.Text(9);
  episode.video = row.Text(10);
  episode.video_sha256 = row.Text(11);
  episode.thumbnail = row.Text(12);
  return episode;
}

std::optional<std::string> NullIfEmpty(const std::string& text) {
  return text.empty() ? std::nullopt : std::optional(text);
}

bool Exists(sqlite::Statement row) { return row.Step(); }

/// What SQLite's foreign keys would refuse without saying which.
void DemandDeclared(sqlite::Connection& connection, const EpisodeKey& key) {
  const PairKey& pair = key.pair;
  if (!Exists(connection.Query("SELECT 1 FROM tasks WHERE id = ?", pair.task))) {
    throw InternalError("episode {}: task '{}' was not added to the store", key.Id(), pair.task);
  }
  if (!Exists(connection.Query("SELECT 1 FROM worlds WHERE name = ?", key.world))) {
    throw InternalError("episode {}: world '{}' was not added to the store", key.Id(), key.world);
  }
  if (!Exists(
          connection.Query("SELECT 1 FROM policies WHERE name = ? AND checkpoint = ?", pair.policy, pair.checkpoint))) {
    throw InternalError("episode {}: policy '{}@{}' was not added to the store", key.Id(), pair.policy,
                        pair.checkpoint);
  }
}

}  // namespace

void InsertEpisode(sqlite::Connection& connection, const Episode& episode) {
  const PairKey& pair = episode.key.pair;
  if (SelectEpisode(connection, episode.key.Id()))
    throw InternalError("episode {} is in the store already", episode.key.Id());
  DemandDeclared(connection, episode.key);
  connection.Run("INSERT INTO episodes (id, failed, " EVAC_EPISODE_COLUMNS
                 ") VALUES (?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?)",
                 episode.key.Id(), IsFailure(episode.stop), pair.task, pair.initial_state, pair.policy, pair.checkpoint,
                 pair.seed, episode.key.world, episode.chunks, Name(episode.stop), episode.stop_reason,
                 NullIfEmpty(episode.failure), NullIfEmpty(episode.video), NullIfEmpty(episode.video_sha256),
                 NullIfEmpty(episode.thumbnail));
}

void InsertSteps(sqlite::Connection& connection, const Episode& episode) {
  std::vector<codec::ArmsStep> observed, commanded;
  for (const Observation& observation : episode.observations)
    observed.push_back({observation.arms, observation.arms_are_commanded});
  for (const Arms& arms : episode.commands) commanded.push_back({arms, true});
  const std::string observations = codec::EncodeArms(observed), commands = codec::EncodeArms(commanded);
  connection.Run("INSERT INTO steps (episode, observations, commands) VALUES (?, ?, ?)", episode.key.Id(),
                 sqlite::Blob{observations}, sqlite::Blob{commands});
}

void InsertPrivileged(sqlite::Connection& connection, const std::string& episode_id, const PrivilegedTrack& track) {
  const std::string frames = codec::EncodePrivileged(track);
  connection.Run("INSERT INTO privileged (episode, frames) VALUES (?, ?)", episode_id, sqlite::Blob{frames});
}

std::vector<Episode> SelectEpisodes(sqlite::Connection& connection) {
  std::vector<Episode> episodes;
  for (auto row = connection.Query("SELECT " EVAC_EPISODE_COLUMNS " FROM episodes"); row.Step();)
    episodes.push_back(ReadEpisode(row));
  // Not in SQL, where a seed above 2^63 would be negative.
  std::sort(episodes.begin(), episodes.end(), [](const Episode& a, const Episode& b) { return a.key < b.key; });
  return episodes;
}

std::optional<Episode> SelectEpisode(sqlite::Connection& connection, const std::string& episode_id) {
  auto row = connection.Query("SELECT " EVAC_EPISODE_COLUMNS " FROM episodes WHERE id = ?", episode_id);
  return row.Step() ? std::optional(ReadEpisode(row)) : std::nullopt;
}

void VisitEnded(sqlite::Connection& connection, const std::string& judge,
                const std::function<void(const EndedEpisode&)>& see) {
  connection.Run("PRAGMA cache_size = -131072");  // 128 MiB while it lasts: verdicts lie in another order than episodes
  auto row = connection.Query(
      "SELECT task, initial_state, policy, checkpoint, world, failed, "
      "(SELECT label FROM verdicts WHERE judge = ? AND episode = episodes.id ORDER BY id DESC LIMIT 1) FROM episodes",
      judge);
  while (row.Step()) {
    see({row.View(0), row.View(1), row.View(2), row.View(3), row.View(4), row.Integer(5) != 0,
         row.IsNull(6) ? std::nullopt : std::optional(LabelFromName(row.Text(6)))});
  }
  connection.Run("PRAGMA cache_size = -2000");  // SQLite's own
}

void SelectSteps(sqlite::Connection& connection, Episode& episode) {
  auto row = connection.Query("SELECT observations, commands FROM steps WHERE episode = ?", episode.key.Id());
  if (!row.Step()) throw InternalError("episode {} is not in the store", episode.key.Id());
  episode.observations.clear();
  episode.commands.clear();
  for (codec::ArmsStep& step : codec::DecodeArms(row.Text(0))) {
    episode.observations.push_back(
        {.images = {}, .arms = std::move(step.arms), .arms_are_commanded = step.are_commanded});
  }
  for (codec::ArmsStep& step : codec::DecodeArms(row.Text(1))) episode.commands.push_back(std::move(step.arms));
}

PrivilegedTrack SelectPrivileged(sqlite::Connection& connection, const std::string& episode_id) {
  auto row = connection.Query("SELECT frames FROM privileged WHERE episode = ?", episode_id);
  return row.Step() ? codec::DecodePrivileged(row.Text(0)) : PrivilegedTrack();
}

void DeleteFailedEpisode(sqlite::Connection& connection, const std::string& episode_id) {
  connection.Run("INSERT INTO removals (episode) VALUES (?)",
                 episode_id);  // lets these rows, and no others, be deleted
  connection.Run("DELETE FROM verdicts WHERE episode = ?", episode_id);
  connection.Run("DELETE FROM episodes WHERE id = ?",
                 episode_id);  // its steps, privileged track and removal go with it
}

}  // namespace evac::rows
