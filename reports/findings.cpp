#include "reports/findings.h"

#include <fmt/format.h>

#include <algorithm>
#include <map>

#include "core/statistics/mcnemar.h"
#include "core/statistics/rate_difference.h"
#include "reports/counted_judges.h"
#include "reports/wording.h"

namespace evac {
namespace {

/// Percentile intervals of a bootstrap over few states are rough; these words go with the numbers, not with hopes.
Finding Correlation(const WorldComparison& comparison) {
  Finding finding;
  finding.question = fmt::format("Do success rates in {} follow those in {}?", comparison.other, comparison.real);
  const Estimate& r = comparison.correlation.pearson;
  const std::string points = Counted(r.n, "(task, policy) point");
  if (!r.value || !r.interval) {
    finding.decision = Decision::kNotDecided;
    finding.answer = fmt::format("Pearson over {} is {}.", points, NumberWithInterval(r));
    return finding;
  }
  const std::string numbers = fmt::format("Pearson {} over {}", NumberWithInterval(r), points);
  if (r.interval->low > kCloseCorrelation) {
    finding.decision = Decision::kYes;
    finding.answer = fmt::format("{} follows {} closely: {}.", comparison.other, comparison.real, numbers);
  } else if (r.interval->low > 0) {
    finding.decision = Decision::kYes;
    finding.answer = fmt::format("{} follows {} in direction; how closely is not decided: {}.", comparison.other,
                                 comparison.real, numbers);
  } else if (r.interval->high < 0) {
    finding.decision = Decision::kNo;
    finding.answer = fmt::format("{} runs against {}: {}.", comparison.other, comparison.real, numbers);
  } else {
    finding.decision = Decision::kNotDecided;
    finding.answer = fmt::format("The interval holds 0: {}.", numbers);
  }
  return finding;
}

Finding Agreement(const WorldComparison& comparison) {
  Finding finding;
  finding.question = fmt::format("Does {} foretell single episodes of {}?", comparison.other, comparison.real);
  PairTable all;
  for (const PairTable& table : comparison.tables) {
    all.both_succeed += table.both_succeed;
    all.real_only += table.real_only;
    all.other_only += table.other_only;
    all.both_fail += table.both_fail;
  }
  const Estimate& share = comparison.agreement;
  if (!share.value) {
    finding.decision = Decision::kNotDecided;
    finding.answer = "No pair of episodes has been judged in both worlds.";
    return finding;
  }
  finding.answer = fmt::format(
      "{} of {} pairs with the same initial state end alike, {}. "
      "Hallucinated: of {} that fail in {}, {} in {}. Missed: of {} that succeed in {}, {} in {}.",
      all.both_succeed + all.both_fail, share.n, PercentWithInterval(share), all.other_only + all.both_fail,
      comparison.real, Counted(all.other_only, "succeeds", "succeed"), comparison.other,
      all.both_succeed + all.real_only, comparison.real, Counted(all.real_only, "fails", "fail"), comparison.other);
  return finding;
}

/// The best and the next of one task in the real world, by rate.
std::vector<const RateCell*> Ranked(const RunSummary& summary, const std::string& task) {
  std::vector<const RateCell*> cells;
  for (const RateCell& cell : summary.rates) {
    if (cell.task == task && cell.world == summary.reference && cell.rate.value) cells.push_back(&cell);
  }
  std::stable_sort(cells.begin(), cells.end(),
                   [](const RateCell* a, const RateCell* b) { return *a->rate.value > *b->rate.value; });
  return cells;
}

/// Two policies in the real world, paired by initial state and seed: the pairs of each initial state.
std::vector<PairedOutcomes> PairsByState(const RunSummary& summary, const RateCell& first, const RateCell& second) {
  std::map<std::pair<std::string, std::uint64_t>, bool> in_first;
  std::map<std::string, PairedOutcomes> states;
  for (const std::string& policy : {first.policy, second.policy}) {
    for (const JudgedEpisode& judged : summary.episodes) {
      const EpisodeKey& key = judged.episode.key;
      if (!judged.Counts() || key.world != first.world || key.pair.task != first.task) continue;
      if (PolicyLabel(key.pair.policy, key.pair.checkpoint) != policy) continue;
      const std::pair where{key.pair.initial_state, key.pair.seed};
      const bool success = judged.outcome == Outcome::kSuccess;
      if (policy == first.policy) {
        in_first[where] = success;
      } else if (const auto same = in_first.find(where); same != in_first.end()) {
        PairedOutcomes& state = states[key.pair.initial_state];
        ++state.pairs;
        if (same->second != success) ++(success ? state.flips.only_second : state.flips.only_first);
      }
    }
  }
  std::vector<PairedOutcomes> pairs;
  for (const auto& [name, state] : states) pairs.push_back(state);
  return pairs;
}

std::string RateInWords(const RateCell& cell) {
  return fmt::format("{} {}/{} = {}", cell.policy, cell.Of(Outcome::kSuccess), cell.rate.n,
                     PercentWithInterval(cell.rate));
}

Finding Best(const RunSummary& summary, const std::string& task) {
  Finding finding;
  finding.question = fmt::format("Which policy is best at {} in {}?", task, summary.reference);
  const std::vector<const RateCell*> ranked = Ranked(summary, task);
  if (ranked.size() < 2) {
    finding.decision = ranked.empty() ? Decision::kNotDecided : Decision::kNote;
    finding.answer =
        ranked.empty() ? "No episode has been judged." : RateInWords(*ranked[0]) + "; no other policy to compare.";
    return finding;
  }
  const std::vector<PairedOutcomes> states = PairsByState(summary, *ranked[0], *ranked[1]);
  const PairedOutcomes all = SumOf(states), effective = EffectivePairs(states);
  const bool has_repeats = all.pairs > static_cast<std::int64_t>(states.size());
  const double p = McNemarExact(effective.flips).p_exact;
  const bool decided = p < kAlpha && all.flips.only_first > all.flips.only_second;
  finding.decision = decided ? Decision::kYes : Decision::kNotDecided;
  finding.answer = fmt::format(
      "{}{} {}. In {}, {} to {} where only one of the two succeeds: {} {}.", decided ? "" : "Between ",
      RateInWords(*ranked[0]) + (decided ? "," : ""), (decided ? "ahead of " : "and ") + RateInWords(*ranked[1]),
      Counted(all.pairs, has_repeats ? "shared pair" : "shared initial state"), all.flips.only_first,
      all.flips.only_second, OnPairs("exact McNemar", {all.pairs, effective.pairs}), PValue(p));
  return finding;
}

Finding Completeness(const RunSummary& summary) {
  Finding finding;
  finding.question = "Did every episode run, and was it judged?";
  const auto all = static_cast<std::int64_t>(summary.episodes.size());
  const std::int64_t counted = summary.Count(Outcome::kSuccess) + summary.Count(Outcome::kFailure);
  if (counted == all) {
    finding.decision = Decision::kYes;
    finding.answer = fmt::format("All {} ran to their end and were judged by {}.", Counted(all, "episode"),
                                 JudgeWords(summary.options.judge));
    return finding;
  }
  finding.decision = Decision::kNo;
  std::string apart;
  for (const Outcome outcome : {Outcome::kError, Outcome::kCannotTell, Outcome::kInvalid, Outcome::kUnjudged}) {
    if (summary.Count(outcome) == 0) continue;
    apart += (apart.empty() ? "" : ", ") + CountInWords(outcome, summary.Count(outcome));
  }
  finding.answer = fmt::format("{} of {} count. In no rate: {}.", counted, Counted(all, "episode"), apart);
  return finding;
}

}  // namespace

const char* Name(Decision decision) {
  switch (decision) {
    case Decision::kYes:
      return "yes";
    case Decision::kNo:
      return "no";
    case Decision::kNotDecided:
      return "not decided";
    case Decision::kNote:
      return "note";
  }
  return "note";
}

std::vector<Finding> FindingsOf(const RunSummary& summary) {
  std::vector<Finding> findings;
  for (const WorldComparison& comparison : summary.comparisons) {
    findings.push_back(Correlation(comparison));
    findings.push_back(Agreement(comparison));
  }
  for (const Task& task : summary.data.tasks) {
    if (!summary.reference.empty() && summary.policies.size() > 1) findings.push_back(Best(summary, task.id));
  }
  findings.push_back(Completeness(summary));
  return findings;
}

}  // namespace evac
