#include "reports/report_data.h"

#include <algorithm>
#include <map>
#include <utility>

#include "core/error.h"
#include "core/statistics/many_comparisons.h"
#include "reports/findings.h"
#include "reports/gate_data.h"

namespace evac {
namespace {

std::string BaselineOf(const RunSummary& summary, const std::string& wanted) {
  if (wanted.empty()) return summary.policies.size() < 2 ? "" : summary.policies.front();
  if (std::ranges::find(summary.policies, wanted) != summary.policies.end()) return wanted;
  std::string known;
  for (const std::string& policy : summary.policies) known += (known.empty() ? "" : ", ") + policy;
  throw InvalidInput("--baseline: found {}, wanted a policy of the run: {}", wanted, known);
}

std::map<std::string, ComparedPolicy> EpisodesByPolicy(const RunSummary& summary, const std::string& world) {
  std::map<std::string, ComparedPolicy> policies;
  for (const JudgedEpisode& judged : summary.episodes) {
    if (judged.episode.key.world != world) continue;
    const std::string label = PolicyLabel(judged.episode.key.pair.policy, judged.episode.key.pair.checkpoint);
    ComparedPolicy& policy = policies[label];
    policy.name = label;
    policy.episodes.push_back(judged);
  }
  return policies;
}

/// Each is planned for the strictest of Holm's steps.
void AdjustForCandidates(double alpha, std::vector<Candidate>& candidates) {
  std::vector<double> p_values;
  for (const Candidate& candidate : candidates) {
    if (candidate.comparison.all.p) p_values.push_back(*candidate.comparison.all.p);
  }
  const std::vector<double> adjusted = HolmAdjusted(p_values);
  auto next = adjusted.begin();
  for (Candidate& candidate : candidates) {
    const PolicyComparison& comparison = candidate.comparison;
    if (!comparison.all.p) continue;
    candidate.p_holm = *next++;
    const Promise promise{alpha / static_cast<double>(p_values.size()), comparison.options.power};
    candidate.more = MoreToDecide(comparison.all, promise);
  }
}

/// Over all that is shown together, not over the tasks of one comparison.
void AdjustTasks(std::vector<Candidate>& candidates) {
  std::vector<double> p_values;
  for (const Candidate& candidate : candidates) {
    for (const ComparisonRow& row : candidate.comparison.tasks) {
      if (row.p) p_values.push_back(*row.p);
    }
  }
  const std::vector<double> adjusted = HolmAdjusted(p_values);
  auto next = adjusted.begin();
  for (Candidate& candidate : candidates) {
    for (const ComparisonRow& row : candidate.comparison.tasks)
      candidate.task_p_holm.push_back(row.p ? Number(*next++) : row.p);
  }
}

std::vector<Candidate> CandidatesOf(const RunSummary& summary, const std::string& baseline, const std::string& world) {
  std::map<std::string, ComparedPolicy> policies = EpisodesByPolicy(summary, world);
  std::vector<Candidate> candidates;
  if (!policies.contains(baseline)) return candidates;
  for (const std::string& policy : summary.policies) {
    if (policy == baseline || !policies.contains(policy)) continue;
    candidates.push_back(
        {ComparePolicies(policies[policy], policies[baseline], {.alpha = 1 - summary.options.confidence})});
  }
  AdjustForCandidates(kAlpha, candidates);
  AdjustTasks(candidates);
  return candidates;
}

void AddTrust(TrustOptions options, ReportData& report) {
  const RunSummary& run = report.summary;
  options.confidence = run.options.confidence;
  options.bootstrap = {run.options.bootstrap_replicates, run.options.bootstrap_seed, run.options.confidence};
  std::vector<std::string> worlds;
  for (const WorldInfo& world : run.data.worlds) {
    if (!world.is_real) worlds.push_back(world.name);
  }
  WorldsTrust trust = TrustOfWorlds(run, worlds, options);
  report.trust = std::move(trust.worlds);
  report.unsaid = std::move(trust.unsaid);
  if (report.trust.empty()) report.no_trust = WhyNothingIsSaid(report.unsaid);
}

}  // namespace

ReportData ReportDataOf(RunSummary summary, const ReportOptions& options) {
  ReportData report;
  report.summary = std::move(summary);
  report.letters =
      GiveLetters(report.summary.episodes, 1 - report.summary.options.confidence, report.summary.rates);
  report.summary.contests = report.letters.contests;
  const RunSummary& run = report.summary;
  report.by_judge = RatesOfOtherJudges(run);
  report.baseline = BaselineOf(run, options.baseline);
  report.world = !run.reference.empty() || run.data.worlds.empty() ? run.reference : run.data.worlds.front().name;
  if (!report.baseline.empty()) report.candidates = CandidatesOf(run, report.baseline, report.world);
  if (!run.data.gates.empty()) report.gates = LastGates(run.data.gates, DataHash(run.data));
  AddTrust(options.trust, report);
  report.stages = StagesOf(run);
  report.judges = JudgesOf(run);
  report.checkpoints = CheckpointsOf(run);
  return report;
}

}  // namespace evac
