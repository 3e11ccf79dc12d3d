#include "reports/headlines.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <functional>

#include "core/run_extent.h"
#include "reports/counted_judges.h"
#include "reports/wording.h"

namespace evac {
namespace {

constexpr std::size_t kMostItems = 5, kMostNamed = 3;

bool IsDecided(const Number& p) { return p && *p < kAlpha; }

std::string TagOf(const Estimate& difference, const Number& p) {
  if (!IsDecided(p) || !difference.value || *difference.value == 0) return "not decided";
  return *difference.value < 0 ? "worse" : "better";
}

/// What gates decided, the gravest first: they were asked this very question.
std::vector<HeadlineItem> GateItems(const ReportData& report) {
  std::vector<ShownGate> gates = report.gates;
  std::ranges::stable_sort(gates, std::ranges::greater(), GravityOf);
  std::vector<HeadlineItem> items;
  for (const ShownGate& gate : gates) {
    const std::string& judge = gate.decision.judge;
    std::string text = "gate " + gate.decision.name;
    if (!judge.empty() && judge != report.summary.options.judge) text += fmt::format(" (judge {})", JudgeWords(judge));
    if (!gate.is_current) text += " (of older data)";
    for (const RuleDecision& rule : gate.decision.rules) {
      if (rule.outcome != gate.decision.outcome) continue;
      text += ": " + rule.statement;
      break;
    }
    items.push_back({Name(gate.decision.outcome), text, "#gates"});
  }
  return items;
}

HeadlineItem CandidateItem(const Candidate& candidate) {
  const ComparisonRow& all = candidate.comparison.all;
  std::string text = candidate.comparison.first;
  if (all.first.value && all.second.value && candidate.p_holm) {
    const std::string n = all.is_paired
                              ? Counted(all.shared, "pair")
                              : fmt::format("{} and {}", all.first_episodes, Counted(all.second_episodes, "episode"));
    text += fmt::format(": {} against {}, {}{} ({}, {})", Percent(*all.first.value), Percent(*all.second.value),
                        PointsWithInterval(all.difference), all.stratified_se ? " task by task" : "", n,
                        PValue(*candidate.p_holm));
  } else {
    text += ": no episode of both is judged";
  }
  return {TagOf(all.difference, candidate.p_holm), text, "#rates"};
}

/// What is worse comes first, then what is open.
int Urgency(const HeadlineItem& item) { return item.tag == "worse" ? 0 : item.tag == "not decided" ? 1 : 2; }

/// Of a report without candidates.
std::string WhyNothingIsHeldAgainst(const ReportData& report) {
  const std::size_t policies = report.summary.policies.size();
  if (policies == 0) return "The run has no policy yet: nothing to compare.";
  if (policies == 1) return "The run has one policy: nothing to compare it with. Its rates are below.";
  return "No policy of the run is compared with another. Their rates are below.";
}

Headline Worse(const ReportData& report) {
  Headline headline;
  headline.items = GateItems(report);
  if (report.candidates.empty()) {
    headline.question = "Is the candidate worse?";
    if (headline.items.empty()) headline.items = {{"", WhyNothingIsHeldAgainst(report), "#rates"}};
    return headline;
  }
  headline.question = report.candidates.size() == 1
                          ? fmt::format("Is {} worse than {}?", report.candidates[0].comparison.first, report.baseline)
                          : fmt::format("Is any policy worse than {}?", report.baseline);
  std::vector<HeadlineItem> items;
  for (const Candidate& candidate : report.candidates) items.push_back(CandidateItem(candidate));
  std::ranges::stable_sort(items, {}, Urgency);
  if (items.size() > kMostItems) {
    const auto left_out = static_cast<std::int64_t>(items.size() - kMostItems);
    items.resize(kMostItems);
    items.push_back({"", Counted(left_out, "further policy is", "further policies are") + " below", "#rates"});
  }
  headline.items.insert(headline.items.end(), items.begin(), items.end());
  return headline;
}

/// "take_toast: visual_pick@fair -45 points [-62, -25]; …" of the candidates that differ here, the largest loss first.
HeadlineItem LossesAt(const ReportData& report, const std::string& task) {
  std::vector<std::pair<double, std::string>> found;
  for (const Candidate& candidate : report.candidates) {
    for (std::size_t i = 0; i < candidate.comparison.tasks.size(); ++i) {
      const ComparisonRow& row = candidate.comparison.tasks[i];
      if (row.task != task || !IsDecided(candidate.task_p_holm[i]) || !row.difference.value) continue;
      found.emplace_back(*row.difference.value, candidate.comparison.first + " " + PointsWithInterval(row.difference));
    }
  }
  HeadlineItem item{"", "", "#rates"};
  if (found.empty()) return item;
  std::ranges::stable_sort(found, {}, &std::pair<double, std::string>::first);
  item.tag = found.back().first < 0 ? "worse" : found.front().first > 0 ? "better" : "both ways";
  for (std::size_t i = 0; i < found.size() && i < kMostNamed; ++i)
    item.text += (i == 0 ? task + ": " : "; ") + found[i].second;
  if (found.size() > kMostNamed) item.text += fmt::format("; and {} more", found.size() - kMostNamed);
  return item;
}

Headline Where(const ReportData& report) {
  Headline headline{"Where?", {}};
  std::string undecided;
  for (const Task& task : report.summary.data.tasks) {
    if (report.candidates.empty()) break;
    HeadlineItem item = LossesAt(report, task.id);
    if (item.text.empty()) {
      undecided += (undecided.empty() ? "" : ", ") + task.id;
    } else if (headline.items.size() < kMostItems) {
      headline.items.push_back(std::move(item));
    }
  }
  if (!undecided.empty())
    headline.items.push_back({"not decided", undecided + ": no difference that these episodes can show", "#rates"});
  if (headline.items.empty()) headline.items.push_back({"", "The rates per task stand below.", "#rates"});
  return headline;
}

HeadlineItem TrustItem(const TaskTrust& task, const TrustReport& trust, bool name_world) {
  std::string text = name_world ? fmt::format("{}, {}", trust.world, task.task) : task.task;
  if (task.pairs.n() == 0) return {Name(task.trust), text + ": no initial state was tried in both worlds", "#trust"};
  text += fmt::format(": {} against {} real, bias {}, {}", Percent(*task.model.value), Percent(*task.real.value),
                      PointsWithInterval(task.bias), Counted(task.pairs.n(), "pair"));
  return {Name(task.trust), text, "#trust"};
}

Headline Trusted(const ReportData& report) {
  Headline headline;
  if (report.trust.empty()) {
    headline.question = "Can I trust the world model?";
    headline.items = {{"unknown", report.no_trust, ""}};
    return headline;
  }
  const bool one = report.trust.size() == 1 && report.unsaid.empty();
  headline.question =
      fmt::format("Can I trust {} to within ±{}?", one ? report.trust[0].world : "the other worlds",
                  GivenPoints(report.trust[0].options.margin));
  std::size_t left_out = 0;
  for (const TrustReport& trust : report.trust) {
    for (const TaskTrust& task : trust.tasks) {
      if (headline.items.size() < 2 * kMostItems) {
        headline.items.push_back(TrustItem(task, trust, !one));
      } else {
        ++left_out;
      }
    }
  }
  if (left_out > 0)
    headline.items.push_back({"", Counted(static_cast<std::int64_t>(left_out), "further task") + " below", "#trust"});
  for (const auto& [world, reason] : report.unsaid)
    headline.items.push_back({"unknown", fmt::format("{}: {}", world, reason), "#trust"});
  if (headline.items.empty()) headline.items.push_back({"unknown", "no task was tried in both worlds", "#trust"});
  return headline;
}

void AddMissing(const RunSummary& summary, std::vector<HeadlineItem>& items) {
  if (const RunExtent extent = ExtentOf(summary.data.plan, summary.data.episodes); extent.missing > 0)
    items.push_back({"",
                     fmt::format("{} of {} not there yet: evac resume RUN, or evac merge with the other shards",
                                 extent.missing, Counted(extent.planned, "episode is", "episodes are")),
                     ""});
  if (const auto unjudged = summary.Count(Outcome::kUnjudged); unjudged > 0) {
    const std::string with_small = CountedWithSmall(summary);
    const std::string judge = LastJudge(summary.options.judge), never = with_small.empty() ? NeverJudged(judge) : "";
    const std::string commands = with_small.empty() ? fmt::format("{}", fmt::join(JudgingCommands(judge), ", then "))
                                                    : "evac report RUN --judge " + with_small;
    items.push_back({"",
                     fmt::format("{} not judged yet: {}{}", Counted(unjudged, "episode is", "episodes are"), commands,
                                 never.empty() ? "" : " (" + never + ")"),
                     "#clips"});
  }
  if (const auto errors = summary.Count(Outcome::kError); errors > 0)
    items.push_back({"", Counted(errors, "episode") + " stopped with an error: look at the reasons", "#errors"});
}

/// The stage with the most one-sided flips that the tests decide on.
void AddStage(const ReportData& report, std::vector<HeadlineItem>& items) {
  const StageParting* worst = nullptr;
  const auto lean = [](const StageParting& parting) {
    return std::abs(parting.flips.only_first - parting.flips.only_second);
  };
  for (const StageParting& parting : report.stages.partings) {
    if (IsDecided(parting.p_holm) && (worst == nullptr || lean(parting) > lean(*worst))) worst = &parting;
  }
  if (worst == nullptr) return;
  items.push_back(
      {"",
       fmt::format("Look at {} in {}: {} episodes went on in {} alone, {} in {} alone", worst->stage, worst->task,
                   worst->flips.only_first, worst->world, worst->flips.only_second, report.summary.reference),
       "#stages"});
}

/// Tasks at which it is open whether a world may be trusted, the cheapest to decide first.
void AddTrustToDecide(const TrustReport& trust, std::vector<HeadlineItem>& items) {
  std::vector<const TaskTrust*> open;
  for (const TaskTrust& task : trust.tasks) {
    if (task.trust == Trust::kUnknown && task.more) open.push_back(&task);
  }
  if (open.empty()) return;
  std::ranges::stable_sort(open, {}, [](const TaskTrust* task) { return *task->more; });
  std::string text = fmt::format("To decide whether {} may be trusted: about {} at {}", trust.world,
                                 Counted(*open[0]->more, "more pair"), open[0]->task);
  const std::size_t named = std::min(open.size(), kMostItems);
  for (std::size_t i = 1; i < named; ++i) text += fmt::format(", {} at {}", *open[i]->more, open[i]->task);
  if (open.size() > named) text += "; " + Counted(static_cast<std::int64_t>(open.size() - named), "further task");
  items.push_back({"", std::move(text), "#trust"});
}

void AddMorePairs(const ReportData& report, std::vector<HeadlineItem>& items) {
  for (const TrustReport& trust : report.trust) AddTrustToDecide(trust, items);
  for (const Candidate& candidate : report.candidates) {
    const ComparisonRow& all = candidate.comparison.all;
    if (IsDecided(candidate.p_holm) || !candidate.more) continue;
    items.push_back({"",
                     fmt::format("About {} would decide on {}",
                                 Counted(*candidate.more, all.is_paired ? "more pair" : "more episode per policy",
                                         all.is_paired ? "" : "more episodes per policy"),
                                 candidate.comparison.first),
                     "#rates"});
  }
}

void AddFlips(const RunSummary& summary, std::vector<HeadlineItem>& items) {
  for (const WorldComparison& comparison : summary.comparisons) {
    std::int64_t flips = 0, counted = 0;
    for (const PairTable& table : comparison.tables) {
      flips += table.real_only + table.other_only;
      counted += table.Counted();
    }
    if (flips == 0) continue;
    items.push_back({"",
                     fmt::format("Watch the {} of {} and {} ({} compared)", Counted(flips, "flip"), comparison.other,
                                 comparison.real, Counted(counted, "pair")),
                     "#states"});
  }
}

Headline Next(const ReportData& report) {
  Headline headline{"What next?", {}};
  AddMissing(report.summary, headline.items);
  AddStage(report, headline.items);
  AddMorePairs(report, headline.items);
  AddFlips(report.summary, headline.items);
  if (headline.items.size() > kMostItems) headline.items.resize(kMostItems);
  if (headline.items.empty()) headline.items.push_back({"", "Nothing is left open by this run.", ""});
  return headline;
}

}  // namespace

std::vector<Headline> HeadlinesOf(const ReportData& report) {
  return {Worse(report), Where(report), Trusted(report), Next(report)};
}

}  // namespace evac
