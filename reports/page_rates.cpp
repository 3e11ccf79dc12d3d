#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <map>
#include <set>

#include "reports/charts.h"
#include "reports/counted_judges.h"
#include "reports/html.h"
#include "reports/page_parts.h"
#include "reports/wording.h"

namespace evac {
namespace {

/// "2 errors, 1 cannot tell": what is in no rate; empty where there is nothing.
std::string ApartWords(const RateCell& cell) {
  std::string words;
  for (const Outcome outcome : {Outcome::kError, Outcome::kCannotTell, Outcome::kInvalid, Outcome::kUnjudged}) {
    if (cell.Of(outcome) > 0) words += (words.empty() ? "" : ", ") + CountInWords(outcome, cell.Of(outcome));
  }
  return words;
}

std::string Row(const RunSummary& summary, const RateCell& cell) {
  const std::size_t world = MarksOf(summary).at(cell.world);
  const std::int64_t successes = cell.Of(Outcome::kSuccess), n = successes + cell.Of(Outcome::kFailure);
  const std::string apart = ApartWords(cell);
  return fmt::format(
      "<tr><th scope=\"row\">{}{}</th><td class=\"plot\">{}</td><td class=\"num\"><a href=\"#clips\" "
      "data-show=\"{}\">{}/{}</a></td><td "
      "class=\"num rate\">{}{}</td><td class=\"letters\">{}</td>"
      "<td class=\"apart\">{}</td></tr>",
      MarkerIcon(WorldShape(world), fmt::format("dot w{}", world % 4)), Escaped(cell.world),
      RateStrip(cell.rate, world), ShowClips(cell.task, cell.policy, cell.world), successes, n,
      n == 0 ? "undefined: no verdict" : PercentWithInterval(cell.rate),
      apart.empty() ? "" : "<small class=\"aside\">" + apart + "</small>", cell.letters,
      apart.empty() ? "<span class=\"none\">–</span>" : apart);
}

/// The best in the real world first, over all tasks, so that every task shows them in the same order.
std::vector<std::string> ByRealRate(const RunSummary& summary) {
  std::map<std::string, std::pair<double, int>> sums;
  for (const RateCell& cell : summary.rates) {
    if (cell.world != summary.reference || !cell.rate.value) continue;
    sums[cell.policy].first += *cell.rate.value;
    ++sums[cell.policy].second;
  }
  const auto mean = [&sums](const std::string& policy) {
    const auto found = sums.find(policy);
    return found == sums.end() ? -1.0 : found->second.first / found->second.second;
  };
  std::vector<std::string> policies = summary.policies;
  std::stable_sort(policies.begin(), policies.end(),
                   [&mean](const std::string& a, const std::string& b) { return mean(a) > mean(b); });
  return policies;
}

std::string TaskTable(const RunSummary& summary, const std::vector<RateCell>& rates, const Task& task) {
  std::string html = fmt::format(
      "<div class=\"task\"><h3>{}</h3><p class=\"quiet\">“{}”</p><table class=\"rates\"><thead><tr><th "
      "scope=\"col\">world</th>"
      "<th scope=\"col\" class=\"plot\"><span class=\"sr\">success rate, percent</span>{}</th><th scope=\"col\" "
      "class=\"num\">k/n</th>"
      "<th scope=\"col\" class=\"num rate\">success [{:.0f} %]</th><th scope=\"col\" class=\"letters\"><span "
      "class=\"sr\">letters of policies that do not differ</span></th><th scope=\"col\" "
      "class=\"apart\">apart</th></tr></thead>",
      Escaped(task.id), Escaped(task.instruction), RateScale(), 100 * summary.options.confidence);
  for (const std::string& policy : ByRealRate(summary)) {
    std::string rows;
    for (const RateCell& cell : rates) {
      if (cell.task == task.id && cell.policy == policy) rows += Row(summary, cell);
    }
    if (!rows.empty())
      html += fmt::format("<tbody><tr class=\"group\"><th scope=\"rowgroup\" colspan=\"6\">{}</th></tr>{}</tbody>",
                          Escaped(policy), rows);
  }
  return html + "</table></div>";
}

std::string TaskTables(const RunSummary& summary, const std::vector<RateCell>& rates) {
  std::string html = "<div class=\"tasks\">";
  for (const Task& task : summary.data.tasks) html += TaskTable(summary, rates, task);
  return html + "</div>";
}

/// One judge's tables behind a button of its own; that of the judge whose verdicts this page counts is pressed. Works
/// without script.
std::string JudgeTab(std::size_t index, const std::string& judge, const std::string& tables) {
  return fmt::format(
      "<input type=\"radio\" class=\"sr\" name=\"rates-judge\" id=\"rates-judge-{0}\"{1}><label "
      "for=\"rates-judge-{0}\">{2}</label><div class=\"panel\">{3}</div>",
      index, index == 0 ? " checked" : "", Escaped(judge), tables);
}

std::string TablesByJudge(const ReportData& report) {
  const RunSummary& summary = report.summary;
  const std::string own = TaskTables(summary, summary.rates);
  if (report.by_judge.empty()) return own;
  std::string html = "<div class=\"tabs\" role=\"group\" aria-label=\"Whose verdicts are counted\"><span "
                     "class=\"quiet\">Verdicts of</span>" +
                     JudgeTab(0, JudgeWords(summary.options.judge), own);
  for (std::size_t i = 0; i < report.by_judge.size(); ++i) {
    const auto& [judge, rates] = report.by_judge[i];
    html += JudgeTab(i + 1, judge,
                     fmt::format("<p class=\"quiet\">As <b>{}</b> sees the same episodes. All else on this page counts "
                                 "the verdicts of <b>{}</b>; how far the two agree stands under <a "
                                 "href=\"#judges\">Judges</a>.</p>",
                                 Escaped(judge), Escaped(JudgeWords(summary.options.judge))) +
                         TaskTables(summary, rates));
  }
  return html + "</div>";
}

}  // namespace

std::string RatesPart(const ReportData& report) {
  const RunSummary& summary = report.summary;
  std::string html =
      "<section id=\"rates\"><h2>Success rates</h2><p class=\"quiet\">Dot: successes over successes and failures. Bar: "
      "Wilson interval"
      ", clustered by initial state where states repeat. Errors, “cannot tell” and invalid verdicts stand apart and "
      "are in no rate.";
  if (const std::set<std::string>& unpaired = report.letters.unpaired_tests; report.letters.pairs > 0) {
    html += fmt::format(
        " Policies that share a letter, on one task in one world, do not differ significantly: exact McNemar over "
        "shared initial states{} (on their effective number where states repeat), Holm over {} of a world, {:.0f} %.",
        unpaired.empty() ? "" : fmt::format(", {} where fewer than 80 % are shared", fmt::join(unpaired, " or ")),
        Counted(report.letters.pairs, "pair"), 100 * (1 - summary.options.confidence));
  }
  html += "</p>";
  if (summary.rates.empty()) return html + "<p>The run holds no episodes yet.</p></section>";
  return html + TablesByJudge(report) + "</section>";
}

}  // namespace evac
