#pragma once

#include <algorithm>
#include <string>
#include <utility>
#include <vector>

#include "reports/summary.h"

namespace evac {

/// One (task, policy "NAME@c"): its outcomes in the initial states 0, 1, …, a text for each of the seeds 0, 1, …: s
/// success, f failure, - no such episode.
struct RepeatedCell {
  std::string task, policy;
  std::vector<std::string> real, sim;
};

/// The same outcomes with every seed: repeats that tell nothing new.
inline std::vector<std::string> Alike(int seeds, const std::string& outcomes) {
  return std::vector<std::string>(static_cast<std::size_t>(seeds), outcomes);
}

/// A run with several seeds, counted: worlds real and sim, judged by the oracle; nothing lies on a disk.
inline RunSummary RepeatedRun(const std::vector<RepeatedCell>& cells) {
  RunData data;
  data.worlds = {{"real", "mujoco", true, "real-profile"}, {"sim", "mujoco", false, "sim-profile"}};
  const auto add = [&](const RepeatedCell& cell, const std::string& world, const std::vector<std::string>& outcomes) {
    for (std::size_t seed = 0; seed < outcomes.size(); ++seed) {
      for (std::size_t state = 0; state < outcomes[seed].size(); ++state) {
        const char letter = outcomes[seed][state];
        if (letter == '-') continue;
        Episode episode;
        episode.key = {{cell.task, "41-" + std::to_string(1000 + state), cell.policy, "c", seed}, world};
        episode.stop = StopReason::kMaxChunks;
        Verdict verdict;
        verdict.judge = "oracle";
        verdict.episode_id = episode.key.Id();
        verdict.label = letter == 's' ? Label::kSuccess : Label::kFailure;
        data.verdicts[episode.key.Id()]["oracle"] = verdict;
        data.episodes.push_back(episode);
      }
    }
  };
  for (const RepeatedCell& cell : cells) {
    if (std::ranges::find(data.tasks, cell.task, &Task::id) == data.tasks.end())
      data.tasks.emplace_back().id = cell.task;
    if (std::ranges::find(data.policies, cell.policy, &PolicyInfo::name) == data.policies.end())
      data.policies.push_back({cell.policy, "c", "{}"});
    add(cell, "real", cell.real);
    add(cell, "sim", cell.sim);
  }
  std::ranges::sort(data.episodes, {}, &Episode::key);
  return Summarise(std::move(data), {.bootstrap_replicates = 1});
}

}  // namespace evac
