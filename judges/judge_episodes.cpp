#include "judges/judge_episodes.h"

#include "core/error.h"

namespace evac {
namespace {

Verdict RateSafely(Judge& judge, const Task& task, const Episode& episode) {
  Verdict invalid;
  try {
    return judge.Rate(task, episode);
  } catch (const std::exception& error) {
    invalid.reason = error.what();
  }
  invalid.episode_id = episode.key.Id();
  invalid.judge = judge.Name();
  invalid.label = Label::kInvalid;
  invalid.rubric_version = task.rubric.version;
  return invalid;
}

bool HasVerdict(const std::map<std::string, std::map<std::string, Verdict>>& current, const std::string& episode,
                const std::string& judge) {
  const auto found = current.find(episode);
  return found != current.end() && found->second.contains(judge);
}

}  // namespace

JudgeSummary JudgeEpisodes(Judge& judge, Store& store, const JudgeOptions& options) {
  std::map<std::string, Task> tasks;
  for (Task& task : store.Tasks()) tasks.emplace(task.id, std::move(task));
  const auto current = store.CurrentVerdicts();
  JudgeSummary summary;
  for (Episode& episode : store.Episodes()) {
    if (IsFailure(episode.stop)) {
      ++summary.failed;
    } else if (!options.again && HasVerdict(current, episode.key.Id(), judge.Name())) {
      ++summary.already;
    } else {
      store.LoadSteps(episode);
      const Verdict verdict = RateSafely(judge, tasks.at(episode.key.pair.task), episode);
      store.AddVerdict(verdict);
      options.on_verdict(verdict);
      ++summary.rated;
      ++summary.labels[verdict.label];
    }
  }
  return summary;
}

}  // namespace evac
