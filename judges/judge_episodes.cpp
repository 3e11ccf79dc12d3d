#include "judges/judge_episodes.h"

#include <fmt/format.h>

#include <algorithm>
#include <new>
#include <string_view>

#include "core/error.h"

namespace evac {
namespace {

/// @returns nothing if the judge will not be asked about this episode, or about any more: the summary says so.
/// @throws what is not the clip's doing (a full disk, no memory): the episode is to be asked about again.
std::optional<Verdict> RateSafely(Judge& judge, const Task& task, const Episode& episode, JudgeSummary& summary) {
  Verdict invalid;
  try {
    return judge.Rate(task, episode);
  } catch (const Error& error) {
    const std::string_view kind = error.kind();
    if (kind == "not_judged") ++summary.left_out;
    if (kind == "judge_over") summary.why_over = error.what();
    if (kind == "not_judged" || kind == "judge_over") return std::nullopt;
    if (error.exit_code() == ExitCode::kInternal) throw;
    invalid.reason = error.what();
  } catch (const std::bad_alloc&) {
    throw;
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
                const std::vector<std::string>& names) {
  const auto found = current.find(episode);
  return found != current.end() &&
         std::ranges::any_of(names, [&](const std::string& name) { return found->second.contains(name); });
}

/// In their order; the summary counts the others.
std::vector<Episode> ToBeAskedAbout(const Store& store, const std::string& judge, const JudgeOptions& options,
                                    JudgeSummary& summary) {
  const auto current = store.CurrentVerdicts();
  std::vector<std::string> names = options.also_called;
  names.push_back(judge);
  std::vector<Episode> asked;
  for (Episode& episode : store.Episodes()) {
    if (!options.wanted(episode)) continue;
    if (IsFailure(episode.stop)) {
      ++summary.failed;
    } else if (!options.again && HasVerdict(current, episode.key.Id(), names)) {
      ++summary.already;
    } else {
      asked.push_back(std::move(episode));
    }
  }
  return asked;
}

}  // namespace

std::string Sentence(const JudgeSummary& summary) {
  std::string labels;
  for (const auto& [label, count] : summary.labels)
    labels += fmt::format("{}{} {}", labels.empty() ? "" : ", ", count, Name(label));
  return fmt::format("{} rated{}, {} had a verdict already, {} failed episodes are not judged{}", summary.rated,
                     labels.empty() ? "" : " (" + labels + ")", summary.already, summary.failed,
                     summary.left_out > 0 ? fmt::format(", {} left out", summary.left_out) : "");
}

JudgeSummary JudgeEpisodes(Judge& judge, Store& store, const JudgeOptions& options) {
  std::map<std::string, Task> tasks;
  for (Task& task : store.Tasks()) tasks.emplace(task.id, std::move(task));
  JudgeSummary summary;
  std::vector<Episode> asked = ToBeAskedAbout(store, judge.Name(), options, summary);
  const int total = static_cast<int>(asked.size());
  int done = 0;
  if (total > 0) options.on_asked(done, total);
  for (Episode& episode : asked) {
    if (summary.why_over.empty() && options.interrupted()) summary.why_over = "interrupted";
    if (!summary.why_over.empty()) break;
    store.LoadSteps(episode);
    const auto verdict = RateSafely(judge, tasks.at(episode.key.pair.task), episode, summary);
    episode = {};  // its steps are many
    if (verdict) {
      store.AddVerdict(*verdict);
      options.on_verdict(*verdict);
      ++summary.rated;
      ++summary.labels[verdict->label];
    }
    if (summary.why_over.empty()) options.on_asked(++done, total);
  }
  return summary;
}

}  // namespace evac
