#include "reports/findings.h"

#include <fmt/format.h>

#include <algorithm>
#include <iterator>

#include "core/run_extent.h"
#include "reports/counted_judges.h"
#include "reports/letters.h"
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

/// The policies of one task in the real world, the best first, by rate.
std::vector<const RateCell*> Ranked(const RunSummary& summary, const std::string& task) {
  std::vector<const RateCell*> cells;
  for (const RateCell& cell : summary.rates) {
    if (cell.task == task && cell.world == summary.reference && cell.rate.value) cells.push_back(&cell);
  }
  std::stable_sort(cells.begin(), cells.end(),
                   [](const RateCell* a, const RateCell* b) { return *a->rate.value > *b->rate.value; });
  return cells;
}

/// Of the real world. Letters rest on the same ones: an answer never says other than they do.
std::vector<PolicyContest> RealContests(const RunSummary& summary) {
  std::vector<PolicyContest> contests = summary.contests;
  if (contests.empty()) {
    std::vector<RateCell> cells;
    std::ranges::copy_if(summary.rates, std::back_inserter(cells),
                         [&](const RateCell& cell) { return cell.world == summary.reference; });
    contests = GiveLetters(summary.episodes, 1 - summary.options.confidence, cells).contests;
  }
  std::erase_if(contests, [&](const PolicyContest& contest) { return contest.world != summary.reference; });
  return contests;
}

std::string RateInWords(const RateCell& cell) {
  return fmt::format("{} {}/{} = {}", cell.policy, cell.Of(Outcome::kSuccess), cell.rate.n,
                     PercentWithInterval(cell.rate));
}

/// Above what is significant where the flips or the rates tested lean the other way.
double Doubt(const PolicyContest& contest) { return contest.first_leads ? contest.p_holm : 1; }

/// "In 40 shared initial states, 6 to 0 where only one of the two succeeds: exact McNemar p = 0.03; after Holm over the
/// 3 pairs of policies in real p = 0.09."
std::string EvidenceInWords(const PolicyContest& contest, std::size_t family) {
  std::string text;
  if (contest.is_paired) {
    const bool has_repeats = contest.pairs.pairs > contest.shared_states;
    text = fmt::format("In {}, {} to {} where only one of the two succeeds: {}",
                       Counted(contest.pairs.pairs, has_repeats ? "shared pair" : "shared initial state"),
                       contest.pairs.flips.only_first, contest.pairs.flips.only_second,
                       OnPairs(contest.test, contest.shared));
  } else {
    text = fmt::format("Of {} and {} episodes, not on the same initial states: {}", contest.first_episodes.all,
                       contest.second_episodes.all,
                       OnEpisodes(contest.test, contest.first_episodes, contest.second_episodes));
  }
  text += " " + PValue(contest.p);
  if (family > 1)
    text += fmt::format("; after Holm over the {} pairs of policies in {} {}", family, contest.world,
                        PValue(contest.p_holm));
  return text + ".";
}

Finding Best(const RunSummary& summary, const std::vector<PolicyContest>& contests, const std::string& task) {
  Finding finding;
  finding.question = fmt::format("Which policy is best at {} in {}?", task, summary.reference);
  const std::vector<const RateCell*> ranked = Ranked(summary, task);
  std::vector<const PolicyContest*> of_best;
  for (const PolicyContest& contest : contests) {
    if (contest.task == task && !ranked.empty() && contest.first == ranked[0]->policy) of_best.push_back(&contest);
  }
  if (of_best.empty()) {
    finding.decision = ranked.empty() ? Decision::kNotDecided : Decision::kNote;
    finding.answer =
        ranked.empty() ? "No episode has been judged." : RateInWords(*ranked[0]) + "; no other policy to compare.";
    return finding;
  }
  const PolicyContest& closest = **std::ranges::max_element(of_best, {}, [](const auto* one) { return Doubt(*one); });
  const auto open = std::ranges::count_if(
      of_best, [&](const auto* one) { return Doubt(*one) > 1 - summary.options.confidence; });
  const std::string other = RateInWords(**std::ranges::find(ranked, closest.second, &RateCell::policy));
  const std::int64_t others = std::ssize(of_best) - 1;
  finding.decision = open == 0 ? Decision::kYes : Decision::kNotDecided;
  finding.answer =
      open == 0 ? fmt::format("{}, ahead of {}{}. ", RateInWords(*ranked[0]), other,
                              others == 0 ? "" : ", the closest, and of " + Counted(others, "other"))
                : fmt::format("Between {} and {}{}. ", RateInWords(*ranked[0]), other,
                              open == 1 ? "" : ", and not decided against " + Counted(open - 1, "other"));
  finding.answer += EvidenceInWords(closest, contests.size());
  return finding;
}

Finding Completeness(const RunSummary& summary) {
  Finding finding;
  finding.question = "Did every episode run, and was it judged?";
  const auto all = static_cast<std::int64_t>(summary.episodes.size());
  const std::int64_t counted = summary.Count(Outcome::kSuccess) + summary.Count(Outcome::kFailure);
  const RunExtent extent = ExtentOf(summary.data.plan, summary.data.episodes);
  if (extent.missing == 0 && counted == all) {
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
  if (extent.missing > 0)
    finding.answer = fmt::format("{} of {} of the suite are there: the run goes on, was broken off, or is a part.",
                                 extent.planned - extent.missing, Counted(extent.planned, "episode"));
  if (counted < all)
    finding.answer += fmt::format("{}{} of {} count. In no rate: {}.", finding.answer.empty() ? "" : " ", counted,
                                  Counted(all, "episode"), apart);
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
  if (!summary.reference.empty() && summary.policies.size() > 1) {
    const std::vector<PolicyContest> contests = RealContests(summary);
    for (const Task& task : summary.data.tasks) findings.push_back(Best(summary, contests, task.id));
  }
  findings.push_back(Completeness(summary));
  return findings;
}

}  // namespace evac
