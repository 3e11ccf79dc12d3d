#include <fmt/format.h>

#include <algorithm>

#include "reports/charts.h"
#include "reports/counted_judges.h"
#include "reports/findings.h"
#include "reports/html.h"
#include "reports/page_parts.h"
#include "reports/wording.h"

namespace evac {
namespace {

std::string Keys(const StageFunnel& funnel, const WorldMarks& marks) {
  std::string html;
  for (const StageRow& row : funnel.worlds) html += WorldKey(marks.at(row.world), row.world);
  return "<span class=\"keys\">" + html + "</span>";
}

std::string TaskFunnels(const StageReport& stages, const std::string& task, const WorldMarks& marks) {
  std::string html;
  for (const StageFunnel& funnel : stages.funnels) {
    if (funnel.task != task) continue;
    html += fmt::format("<figure><figcaption><b>{}</b> {}</figcaption>{}</figure>", Breakable(funnel.policy),
                        Keys(funnel, marks), InPage(StageDrawing(funnel, marks)));
  }
  return html.empty() ? "" : "<h3>" + Breakable(task) + "</h3><div class=\"multiples\">" + html + "</div>";
}

std::string PartingRow(const StageParting& parting, const std::string& reference) {
  const bool decided = parting.p_holm && *parting.p_holm < kAlpha;
  const std::string verdict = !decided                                               ? "not decided"
                              : parting.flips.only_first > parting.flips.only_second ? "kinder"
                                                                                     : "harder";
  return fmt::format(
      "<tr title=\"{}\"><th scope=\"row\">{}</th><td>{}</td><td>{}</td><td class=\"num\">{}</td><td "
      "class=\"num\">{}</td><td "
      "class=\"num\">{}</td><td class=\"num\">{}</td></tr>",
      Escaped(PartingInWords(parting, reference)), Breakable(parting.task), Breakable(parting.stage), Tag(verdict),
      parting.pairs, parting.flips.only_first, parting.flips.only_second,
      parting.p_holm ? PValue(*parting.p_holm) : "–");
}

std::string Partings(const ReportData& report, const std::string& world) {
  std::vector<const StageParting*> shown;
  for (const StageParting& parting : report.stages.partings) {
    if (parting.world == world && parting.pairs > 0) shown.push_back(&parting);
  }
  if (shown.empty()) return "";
  std::string html = fmt::format(
      "<h3>Where {0} parts from {1}</h3><p class=\"quiet\">Among the pairs that had reached every stage before: how "
      "many "
      "went on in one world alone. Exact McNemar on the effective number of pairs where initial states repeat (seeds, "
      "policies), Holm over this table.</p><div class=\"wide\"><table "
      "class=\"points\"><thead><tr><th scope=\"col\">task</th><th scope=\"col\">stage</th><th scope=\"col\">{0} is</th>"
      "<th scope=\"col\" class=\"num\">pairs</th><th scope=\"col\" class=\"num\">only {0}</th><th scope=\"col\" "
      "class=\"num\">only {1}</th><th scope=\"col\" class=\"num\">after Holm</th></tr></thead><tbody>",
      Escaped(world), Escaped(report.summary.reference));
  for (const StageParting* parting : shown) html += PartingRow(*parting, report.summary.reference);
  return html + "</tbody></table></div>";
}

/// The decided ones in words; else that none is, or that there is nothing to decide from.
std::string Statement(const ReportData& report, const std::string& world) {
  std::string items;
  std::int64_t pairs = 0;
  for (const StageParting& parting : report.stages.partings) {
    if (parting.world == world) pairs += parting.pairs;
    if (parting.world == world && parting.p_holm && *parting.p_holm < kAlpha)
      items += fmt::format("<li>{}: {}.</li>", Breakable(parting.task),
                           Escaped(PartingInWords(parting, report.summary.reference)));
  }
  if (pairs == 0)
    return fmt::format("<p>Of {} nothing can be said here: no pair of episodes tells the stages there and in {}.</p>",
                       Escaped(world), Escaped(report.summary.reference));
  if (items.empty())
    return fmt::format("<p>At no stage do these pairs show that {} is kinder or harder than {}.</p>", Escaped(world),
                       Escaped(report.summary.reference));
  return "<ul class=\"statements\">" + items + "</ul>";
}

}  // namespace

std::string StagesPart(const ReportData& report) {
  std::string html =
      "<section id=\"stages\"><h2>Stages</h2><p class=\"quiet\">The share of episodes that reached a stage and all "
      "before it, with Wilson intervals. Where the worlds’ lines part is where one of them lies.</p>";
  if (report.stages.funnels.empty())
    return html + "<p>" + Escaped(JudgeWords(report.summary.options.judge)) + " tells no stages.</p></section>";
  for (const WorldComparison& comparison : report.summary.comparisons) html += Statement(report, comparison.other);
  const WorldMarks marks = MarksOf(report.summary);
  for (const Task& task : report.summary.data.tasks) html += TaskFunnels(report.stages, task.id, marks);
  for (const WorldComparison& comparison : report.summary.comparisons) html += Partings(report, comparison.other);
  return html + "</section>";
}

}  // namespace evac
