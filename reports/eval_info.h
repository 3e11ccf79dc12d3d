#pragma once

#include <string>

#include "reports/summary.h"

namespace evac {

/// The run in the shape of LeRobot's `eval_info.json`, for tools that read that file (docs/formats/eval_info_json.md):
///   per_task   [{task_group, task_id, metrics {sum_rewards, max_rewards, successes, video_paths}}]
///   per_group  {group: {avg_sum_reward, avg_max_reward, pc_success, n_episodes, video_paths}}
///   overall    the same and eval_s, eval_ep_s
/// A group is a policy in a world ("sim/visual_pick@good"), since LeRobot's file knows one policy; `task_id` counts the
/// run's tasks from 0. An episode's reward is 1 if it succeeded, else 0; only episodes that count are listed.
/// pc_success is 0 to 100. Ours beside theirs: pc_success_ci95, n_apart, task. Without a clock eval_s and eval_ep_s are
/// null, and so is a mean over no episode (NaN there). Source: `eval_policy_all` and `TaskMetrics` in
/// src/lerobot/scripts/lerobot_eval.py, github.com/huggingface/lerobot.
std::string EvalInfoJson(const RunSummary& summary);

}  // namespace evac
