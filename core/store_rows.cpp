#include "core/store_rows.h"

#include <tuple>

#include "core/error.h"
#include "core/store_codec.h"

namespace evac::rows {
namespace {

/// Whether something was imagined from what is kept: that is what it began from, whatever the real world shows later.
bool IsBegunFrom(sqlite::Connection& connection, const PairKey& pair) {
  return connection
      .Query(
          "SELECT 1 FROM episodes JOIN worlds ON worlds.name = episodes.world WHERE episodes.task = ? AND "
          "episodes.initial_state = ? AND worlds.type = 'evac' AND NOT episodes.failed LIMIT 1",
          pair.task, pair.initial_state)
      .Step();
}

/// Scenes of one seed are alike: which of them is kept matters to nobody.
bool IsStoredAlready(sqlite::Connection& connection, const PairKey& pair) {
  auto row =
      connection.Query("SELECT seed, policy, checkpoint FROM initial_scenes WHERE task = ? AND initial_state = ?",
                       pair.task, pair.initial_state);
  if (!row.Step()) return false;
  const auto stored = std::tuple(static_cast<std::uint64_t>(row.Integer(0)), row.Text(1), row.Text(2));
  if (stored <= std::tie(pair.seed, pair.policy, pair.checkpoint)) return true;
  return std::get<0>(stored) != pair.seed && IsBegunFrom(connection, pair);
}

}  // namespace

void UpsertInitialScene(sqlite::Connection& connection, const PairKey& pair, const InitialScene& scene) {
  if (IsStoredAlready(connection, pair)) return;
  const std::string arms = codec::EncodeArms({{scene.arms, false}});
  connection.Run("DELETE FROM initial_scenes WHERE task = ? AND initial_state = ?", pair.task, pair.initial_state);
  connection.Run(
      "INSERT INTO initial_scenes (task, initial_state, seed, policy, checkpoint, arms, cameras) VALUES (?, ?, ?, ?, "
      "?, ?, ?)",
      pair.task, pair.initial_state, pair.seed, pair.policy, pair.checkpoint, sqlite::Blob{arms},
      codec::EncodeCameras(scene.cameras));
  for (std::size_t i = 0; i < scene.images.size(); ++i) {
    const std::string png = codec::EncodePng(scene.images[i]);
    connection.Run("INSERT INTO initial_scene_images (task, initial_state, position, png) VALUES (?, ?, ?, ?)",
                   pair.task, pair.initial_state, i, sqlite::Blob{png});
  }
}

std::optional<InitialScene> SelectInitialScene(sqlite::Connection& connection, const std::string& task,
                                               const std::string& initial_state) {
  auto row = connection.Query("SELECT arms, cameras FROM initial_scenes WHERE task = ? AND initial_state = ?", task,
                              initial_state);
  if (!row.Step()) return std::nullopt;
  const std::vector<codec::ArmsStep> steps = codec::DecodeArms(row.Text(0));
  if (steps.size() != 1)
    throw InternalError("the store is damaged: initial scene {} {} has {} arm states", task, initial_state,
                        steps.size());
  InitialScene scene{{}, steps[0].arms, codec::DecodeCameras(row.Text(1))};
  auto image =
      connection.Query("SELECT png FROM initial_scene_images WHERE task = ? AND initial_state = ? ORDER BY position",
                       task, initial_state);
  while (image.Step()) scene.images.push_back(codec::DecodePng(image.Text(0)));
  return scene;
}

std::vector<PairKey> SelectInitialScenePairs(sqlite::Connection& connection) {
  std::vector<PairKey> pairs;
  auto row = connection.Query(
      "SELECT task, initial_state, policy, checkpoint, seed FROM initial_scenes ORDER BY task, initial_state");
  while (row.Step())
    pairs.push_back({row.Text(0), row.Text(1), row.Text(2), row.Text(3), static_cast<std::uint64_t>(row.Integer(4))});
  return pairs;
}

void InsertVerdict(sqlite::Connection& connection, const Verdict& verdict) {
  if (!SelectEpisode(connection, verdict.episode_id)) {
    throw InvalidInput("a verdict of {} on episode '{}', which is not in the store", verdict.judge, verdict.episode_id);
  }
  if (verdict.probability && !(*verdict.probability >= 0 && *verdict.probability <= 1)) {  // SQLite has no NaN, but NULL
    throw InvalidInput("a verdict of {} on episode '{}': found probability {}, wanted a number from 0 to 1",
                       verdict.judge, verdict.episode_id, *verdict.probability);
  }
  connection.Run(
      "INSERT INTO verdicts (episode, judge, label, probability, stages, reason, rubric_version) VALUES (?, ?, ?, ?, "
      "?, ?, ?)",
      verdict.episode_id, verdict.judge, Name(verdict.label), verdict.probability, codec::EncodeStages(verdict.stages),
      verdict.reason, verdict.rubric_version);
}

std::vector<Verdict> SelectVerdicts(sqlite::Connection& connection) {
  std::vector<Verdict> verdicts;
  auto row = connection.Query(
      "SELECT episode, judge, label, probability, stages, reason, rubric_version FROM verdicts ORDER BY id");
  while (row.Step()) {
    Verdict& verdict = verdicts.emplace_back();
    verdict.episode_id = row.Text(0);
    verdict.judge = row.Text(1);
    verdict.label = LabelFromName(row.Text(2));
    if (!row.IsNull(3)) verdict.probability = row.Real(3);
    verdict.stages = codec::DecodeStages(row.Text(4));
    verdict.reason = row.Text(5);
    verdict.rubric_version = row.Text(6);
  }
  return verdicts;
}

std::vector<std::string> SelectJudges(sqlite::Connection& connection) {
  std::vector<std::string> judges;
  auto row = connection.Query("SELECT DISTINCT judge FROM verdicts ORDER BY judge");
  while (row.Step()) judges.push_back(row.Text(0));
  return judges;
}

void AddToCounters(sqlite::Connection& connection, const std::string& policy, const Counters& counters) {
  for (const auto& [name, value] : counters) {
    connection.Run(
        "INSERT INTO counters (policy, name, value) VALUES (?, ?, ?) ON CONFLICT (policy, name) DO UPDATE SET value = "
        "value + "
        "excluded.value",
        policy, name, value);
  }
}

std::map<std::string, Counters> SelectCounters(sqlite::Connection& connection) {
  std::map<std::string, Counters> counters;
  for (auto row = connection.Query("SELECT policy, name, value FROM counters"); row.Step();) {
    counters[row.Text(0)][row.Text(1)] = row.Integer(2);
  }
  return counters;
}

}  // namespace evac::rows
