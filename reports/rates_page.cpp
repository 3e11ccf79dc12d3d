#include "reports/rates_page.h"

#include <fmt/format.h>

#include <algorithm>

#include "reports/comparison.h"
#include "reports/html.h"
#include "reports/page_parts.h"
#include "reports/wording.h"

namespace evac {
namespace {

/// "0.98 [0.84, 1.00]", or why there is none.
std::string Cell(const Estimate& estimate) {
  if (!estimate.value)
    return fmt::format("<td class=\"num\">undefined<small class=\"why\">{}</small></td>",
                       Escaped(estimate.value.reason()));
  if (!estimate.interval) return fmt::format("<td class=\"num\">{}</td>", Plain(*estimate.value));
  return fmt::format("<td class=\"num\">{} <span class=\"ci\">[{}, {}]</span></td>", Plain(*estimate.value),
                     Plain(estimate.interval->low), Plain(estimate.interval->high));
}

std::string Id(const CorrelationGroup& group) { return "group-" + Anchor(group.group); }

std::string Overview(const std::vector<CorrelationGroup>& groups) {
  std::string html =
      "<section id=\"groups\"><h2>Groups</h2><div class=\"wide\"><table class=\"stats\"><thead><tr><th "
      "scope=\"col\">group</th><th scope=\"col\" class=\"num\">points</th><th scope=\"col\" "
      "class=\"num\">Pearson</th><th scope=\"col\" class=\"num\">Spearman</th><th scope=\"col\" "
      "class=\"num\">MMRV</th></tr></thead><tbody>";
  for (const CorrelationGroup& group : groups) {
    html += fmt::format("<tr><th scope=\"row\"><a href=\"#{}\">{}</a></th><td class=\"num\">{}</td>{}{}{}</tr>",
                        Id(group), Breakable(group.group), group.points.size(), Cell(group.pearson),
                        Cell(group.spearman), Cell(group.mmrv));
  }
  return html + "</tbody></table></div><p class=\"quiet\">Groups are compared apart. Only rates are known, not what they "
                "were counted from: intervals of Pearson by Fisher’s z, of Spearman after Bonett and Wright, none of "
                "MMRV. They take the points as drawn at random.</p></section>\n";
}

bool FitsIntoChart(const CorrelationGroup& group) {
  return std::ranges::all_of(group.points, [](const CorrelationPoint& point) {
    return point.real_sr >= 0 && point.real_sr <= 1 && point.sim_sr >= 0 && point.sim_sr <= 1;
  });
}

}  // namespace

std::string RatesPage(const std::vector<CorrelationGroup>& groups, const std::string& source,
                      const std::string& program) {
  std::size_t points = 0;
  for (const CorrelationGroup& group : groups) points += group.points.size();
  std::string html = PageHead("Rates in two worlds", PageScripts::kNone) + "<body>";
  html += fmt::format(
      "<header><h1>Rates in two worlds</h1><p class=\"subtitle\">{} · {} · {}</p></header>\n<main>\n", Escaped(source),
      Counted(static_cast<std::int64_t>(groups.size()), "group"), Counted(static_cast<std::int64_t>(points), "point"));
  html += Overview(groups);
  for (const CorrelationGroup& group : groups) {
    const WorldComparison comparison = AsComparison(group);
    html += fmt::format("<section id=\"{}\"><h2>{}</h2>", Id(group), Breakable(group.group)) +
            ComparisonPart(comparison, StylesOf(comparison)) + "</section>\n";
  }
  return html + fmt::format("<p class=\"quiet\">{}</p></main></body></html>\n", Escaped(program));
}

std::vector<ChartFile> ChartFilesOf(const std::vector<CorrelationGroup>& groups) {
  std::vector<NamedDrawing> drawings;
  for (const CorrelationGroup& group : groups) {
    if (!FitsIntoChart(group)) continue;
    const WorldComparison comparison = AsComparison(group);
    drawings.push_back({group.group, group.group, ScatterDrawing(comparison, StylesOf(comparison))});
  }
  return AsFiles(drawings);
}

}  // namespace evac
