#include "reports/methods.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <set>

#include "reports/counted_judges.h"
#include "reports/wording.h"

namespace evac {
namespace {

std::int64_t Size(std::size_t size) { return static_cast<std::int64_t>(size); }

std::string Joined(const std::set<std::string>& parts) {
  std::string text;
  for (const std::string& part : parts) text += (text.empty() ? "" : "; ") + part;
  return text;
}

std::string What(const ReportData& report) {
  const RunSummary& summary = report.summary;
  std::set<std::pair<std::string, std::string>> states;
  std::set<std::uint64_t> seeds;
  for (const JudgedEpisode& judged : summary.episodes) {
    states.insert({judged.episode.key.pair.task, judged.episode.key.pair.initial_state});
    seeds.insert(judged.episode.key.pair.seed);
  }
  std::string worlds;
  for (const WorldInfo& world : summary.data.worlds)
    worlds += (worlds.empty() ? "" : ", ") + world.name + (world.is_real ? " (the reference)" : "");
  return fmt::format(
      "We evaluated {} on {} in {} ({}) from {} with {} each: {} in all, judged by {}{}. ",
      Counted(Size(summary.policies.size()), "policy", "policies"), Counted(Size(summary.data.tasks.size()), "task"),
      Counted(Size(summary.data.worlds.size()), "world"), worlds, Counted(Size(states.size()), "initial state"),
      Counted(Size(seeds.size()), "seed"), Counted(Size(summary.episodes.size()), "episode"), JudgeWords(summary.options.judge),
      summary.options.judge == "oracle" ? ", which reads the simulators’ physics" : "");
}

std::string Apart(const RunSummary& summary) {
  std::string apart;
  for (const Outcome outcome : {Outcome::kError, Outcome::kCannotTell, Outcome::kInvalid, Outcome::kUnjudged}) {
    if (summary.Count(outcome) > 0)
      apart += (apart.empty() ? "" : ", ") + CountInWords(outcome, summary.Count(outcome));
  }
  return apart.empty() ? "No episode was excluded. " : "Excluded from all rates: " + apart + ". ";
}

std::string Rates(const RunSummary& summary) {
  std::set<std::string> methods;
  for (const RateCell& cell : summary.rates) {
    if (cell.rate.interval) methods.insert(cell.rate.method);
  }
  if (methods.empty()) return "";
  return fmt::format("Success rates carry {:.0f} % intervals ({}). ", 100 * summary.options.confidence,
                     Joined(methods));
}

bool HasRepeats(const RunSummary& summary) {
  return std::ranges::any_of(summary.rates, [](const RateCell& cell) { return cell.rate.n > cell.states; });
}

std::string Policies(const ReportData& report) {
  if (report.candidates.empty()) return "";
  std::set<std::string> tests, intervals;
  std::int64_t task_tests = 0;
  bool paired = false;
  for (const Candidate& candidate : report.candidates) {
    const ComparisonRow& all = candidate.comparison.all;
    paired = paired || all.is_paired;
    if (all.p) tests.insert(all.test);
    if (all.difference.interval) intervals.insert(all.difference.method);
    for (const ComparisonRow& row : candidate.comparison.tasks) {
      if (row.p) tests.insert(row.test);
      task_tests += row.p ? 1 : 0;
      if (row.difference.interval) intervals.insert(row.difference.method);
    }
  }
  if (tests.empty()) return "";
  std::string letters;
  if (const std::set<std::string>& unpaired = report.letters.unpaired_tests; report.letters.pairs > 0) {
    letters = fmt::format(
        "Letters join policies whose difference on a task in a world is not significant (exact McNemar over shared "
        "states and seeds{}{}; Holm over the {} of a world; Piepho 2004). ",
        unpaired.empty() ? "" : fmt::format(", {} where fewer than 80 % are shared", fmt::join(unpaired, " or ")),
        HasRepeats(report.summary) ? ", on effective pairs and episodes" : "",
        Counted(report.letters.pairs, "pair"));
  }
  const std::int64_t comparisons = Size(report.candidates.size());
  return fmt::format(
             "Policies were compared with {} in {}{} ({}; two-sided), with intervals of the difference by {}; p-values "
             "are Holm-adjusted over the {}{}. ",
             report.baseline, report.world, paired ? ", paired by initial state and seed" : "", Joined(tests),
             Joined(intervals), Counted(comparisons, "comparison"),
             task_tests > comparisons ? fmt::format(", those of single tasks over all {} of them", task_tests) : "") +
         letters;
}

std::string Worlds(const ReportData& report) {
  std::string text;
  for (const WorldComparison& comparison : report.summary.comparisons) {
    const CorrelationGroup& group = comparison.correlation;
    text += fmt::format("{} and {} were compared over {} that share task, initial state, policy, checkpoint and seed",
                        comparison.other, comparison.real, Counted(comparison.agreement.n, "pair"));
    text += group.pearson.value
                ? fmt::format(" by Pearson, Spearman and MMRV ({}) over {} ({}). ", Name(group.options.convention),
                              Counted(group.pearson.n, "(task, policy) point"), group.pearson.method)
                : fmt::format("; no correlation is reported ({}). ", group.pearson.value.reason());
  }
  for (const TrustReport& trust : report.trust) {
    text += fmt::format(
        "{} is trusted on a task where the {:.0f} % interval of its bias against {} (Tango, on effective pairs) lies "
        "within ±{}. ",
        trust.world, 100 * trust.options.confidence, trust.real, GivenPoints(trust.options.margin));
  }
  if (!report.stages.partings.empty()) {
    text +=
        "Stages were compared by exact McNemar tests among the pairs that had reached every stage before, "
        "Holm-adjusted "
        "over stages and tasks. ";
  }
  return text;
}

std::string Judges(const ReportData& report) {
  std::int64_t calibrated = 0;
  for (const JudgeAgreement& judge : report.judges.judges) calibrated += judge.IsCalibrated();
  if (report.summary.judges.size() < 2) return "No second judge was consulted. ";
  return fmt::format(
      "Judges were held against {}, per world, by Cohen’s kappa with the standard error of Fleiss, Cohen and Everitt, "
      "summed by initial state where it repeats ({}). ",
      HeldAgainst(report.judges), Counted(calibrated, "judge and world", "judges and worlds"));
}

}  // namespace

std::string MethodsParagraph(const ReportData& report) {
  std::string text =
      What(report) + Apart(report.summary) + Rates(report.summary) + Policies(report) + Worlds(report) + Judges(report);
  if (!report.checkpoints.empty())
    text += "First and last checkpoints were compared like policies, without adjustment for their number. ";
  text.pop_back();
  return text;
}

}  // namespace evac
