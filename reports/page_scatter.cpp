#include <fmt/format.h>

#include <algorithm>

#include "reports/charts.h"
#include "reports/html.h"
#include "reports/page_parts.h"
#include "reports/wording.h"

namespace evac {
namespace {

std::string StatisticRow(const std::string& name, const Estimate& estimate, const std::string& remark) {
  const std::string value = estimate.value ? Plain(*estimate.value) : "undefined";
  std::string interval = "–";
  if (estimate.interval)
    interval = fmt::format("[{}, {}]", Plain(estimate.interval->low), Plain(estimate.interval->high));
  const std::string& reason = estimate.value ? estimate.interval.reason() : estimate.value.reason();
  return fmt::format(
      "<tr><th scope=\"row\">{}<small>{}</small></th><td class=\"num big\">{}</td><td class=\"num\">{}{}</td><td "
      "class=\"num\">{}</td></tr>",
      name, remark, value, interval, reason.empty() ? "" : "<small class=\"why\">" + Escaped(reason) + "</small>",
      estimate.n);
}

/// "90 % [70, 97]", its interval on a line of its own where there is little room.
std::string RateCellOf(const Estimate& rate) {
  if (rate.value && !rate.interval) return "<td class=\"num\">" + Percent(*rate.value) + "</td>";
  const std::string words = PercentWithInterval(rate);
  const std::size_t interval = words.find('[');
  if (interval == std::string::npos) return "<td class=\"num\">" + Escaped(words) + "</td>";
  return "<td class=\"num\">" + words.substr(0, interval) + "<span class=\"ci\">" + words.substr(interval) +
         "</span></td>";
}

/// Rates from a table come without counts, and so without intervals.
bool HasIntervals(const WorldComparison& comparison) {
  return std::ranges::any_of(comparison.points, [](const ComparedPoint& point) { return !!point.real.interval; });
}

std::string StatisticsTable(const WorldComparison& comparison) {
  const CorrelationGroup& group = comparison.correlation;
  const double confidence = 100 * group.pearson.confidence;
  std::string html = fmt::format(
      "<table class=\"stats\"><thead><tr><th scope=\"col\">statistic</th><th scope=\"col\" class=\"num\">value</th>"
      "<th scope=\"col\" class=\"num\">[{:.0f} %]</th><th scope=\"col\" class=\"num\">points</th></tr></thead><tbody>",
      confidence);
  html += StatisticRow("Pearson", group.pearson, "1: rates lie on a line");
  html += StatisticRow("Spearman", group.spearman, "1: same order");
  html += StatisticRow("MMRV", group.mmrv, "0: no two ranked wrongly");
  html += "</tbody></table>";
  std::string notes = fmt::format("Intervals: {}. ", Escaped(group.pearson.method));
  if (group.mmrv.interval && group.mmrv.method != group.pearson.method)
    notes += fmt::format("Of MMRV: {}. ", Escaped(group.mmrv.method));
  if (group.undefined_replicates > 0)
    notes += fmt::format("{} replicates without a defined Pearson were dropped. ", group.undefined_replicates);
  notes += fmt::format("MMRV: {}; {} among the points.", Escaped(Name(group.options.convention)),
                       Counted(group.ranks.ties, "tie"));
  if (!comparison.by_task.empty()) notes += " It ranks all points as one list; within each task: below.";
  if (group.ranks.over_range && group.mmrv.value)
    notes += fmt::format(" Over the range of the {} rates it is {}.", Escaped(comparison.real),
                         Plain(*group.ranks.over_range));
  if (group.distance.bias) {
    notes += fmt::format(
        " Rates in {} are {} points off on average, {:.0f} points in size (means over the points, no interval).",
        Escaped(comparison.other), SignedPoints(*group.distance.bias), 100 * *group.distance.mae);
  }
  return html + "<p class=\"quiet\">" + notes +
         (HasIntervals(comparison)
              ? " The intervals say how much other initial states could change the number, not other policies or tasks."
              : "") +
         "</p>";
}

std::string PointsTable(const WorldComparison& comparison, const std::vector<PointStyle>& styles) {
  std::string html = fmt::format(
      "<div class=\"wide\"><table class=\"points\"><thead><tr><th scope=\"col\"><span "
      "class=\"sr\">point</span></th><th scope=\"col\">"
      "policy, task</th><th scope=\"col\" class=\"num\">{}</th><th scope=\"col\" class=\"num\">{}</th>"
      "<th scope=\"col\" class=\"num\">pairs</th></tr></thead><tbody>",
      Escaped(comparison.real), Escaped(comparison.other));
  for (std::size_t i = 0; i < comparison.points.size(); ++i) {
    const ComparedPoint& point = comparison.points[i];
    html += fmt::format(
        "<tr><td class=\"key\"><b>{}</b>{}</td><th scope=\"row\">{} <span class=\"quiet\">{}</span></th>"
        "{}{}<td class=\"num\">{}</td></tr>",
        point.letter, PointIcon(styles[i]), Breakable(point.policy), Breakable(point.task), RateCellOf(point.real),
        RateCellOf(point.other), point.real.n > 0 ? std::to_string(point.real.n) : "–");
  }
  return html + "</tbody></table></div>";
}

/// Within each task: fewer points, so wider intervals, but no task's difficulty that stands in for agreement.
std::string ByTaskTable(const WorldComparison& comparison) {
  if (comparison.by_task.empty()) return "";
  std::string html =
      "<div class=\"wide\"><table class=\"stats\"><caption class=\"sr\">Within each task</caption><thead><tr><th "
      "scope=\"col\">within a "
      "task</th>"
      "<th scope=\"col\" class=\"num\">Pearson</th><th scope=\"col\" class=\"num\">Spearman</th><th scope=\"col\" "
      "class=\"num\">MMRV</th></tr></thead><tbody>";
  for (const CorrelationGroup& group : comparison.by_task) {
    html += fmt::format("<tr><th scope=\"row\">{}<small>{}</small></th>", Escaped(group.group),
                        Counted(static_cast<std::int64_t>(group.points.size()), "point"));
    html += StackedCell(group.pearson) + StackedCell(group.spearman) + StackedCell(group.mmrv) + "</tr>";
  }
  return html + "</tbody></table></div>";
}

std::string LeftOut(const WorldComparison& comparison) {
  std::string names;
  for (const PairTable& table : comparison.tables) {
    if (table.Counted() == 0) names += (names.empty() ? "" : "; ") + Escaped(table.task + ", " + table.policy);
  }
  return names.empty() ? ""
                       : "<p class=\"quiet\">No point, because no pair is judged in both worlds: " + names + ".</p>";
}

/// Nothing outside of the chart's square is drawn in it.
bool FitsInto100Percent(const WorldComparison& comparison) {
  const auto fits = [](const Estimate& rate) { return *rate.value >= 0 && *rate.value <= 1; };
  return std::ranges::all_of(comparison.points,
                             [&](const ComparedPoint& point) { return fits(point.real) && fits(point.other); });
}

std::string Figure(const WorldComparison& comparison, const std::vector<PointStyle>& styles) {
  if (!FitsInto100Percent(comparison))
    return "<p class=\"quiet\">No chart: a rate is outside of 0 to 100 %.</p>";
  return "<figure>" + Scatter(comparison, styles) +
         fmt::format(
             "<figcaption>One point per task and policy{}. On the dashed line both worlds agree; above it {} is kinder. "
             "Shape: policy. Fill: task.</figcaption></figure>",
             HasIntervals(comparison) ? ", Wilson intervals both ways" : "", Escaped(comparison.other));
}

std::string OneComparison(const RunSummary& summary, const WorldComparison& comparison) {
  const std::string title =
      fmt::format("<h3>{} against {}</h3>", Escaped(comparison.other), Escaped(comparison.real));
  if (comparison.points.empty())
    return title + "<p>No pair of episodes has a success or failure in both worlds yet.</p>";
  return title + ComparisonPart(comparison, StylesOf(summary, comparison));
}

}  // namespace

std::string ComparisonPart(const WorldComparison& comparison, const std::vector<PointStyle>& styles) {
  return "<div class=\"comparison\">" + Figure(comparison, styles) + "<div>" + StatisticsTable(comparison) +
         ByTaskTable(comparison) + "</div></div>" + PointsTable(comparison, styles) + LeftOut(comparison);
}

std::vector<PointStyle> StylesOf(const WorldComparison& comparison) {
  std::vector<std::string> policies, tasks;
  const auto place = [](std::vector<std::string>& names, const std::string& name) {
    const auto index = static_cast<std::size_t>(std::ranges::find(names, name) - names.begin());
    if (index == names.size()) names.push_back(name);
    return index;
  };
  std::vector<PointStyle> styles;
  for (const ComparedPoint& point : comparison.points)
    styles.push_back({place(policies, point.policy), place(tasks, point.task)});
  return styles;
}

std::vector<PointStyle> StylesOf(const RunSummary& summary, const WorldComparison& comparison) {
  std::vector<PointStyle> styles;
  for (const ComparedPoint& point : comparison.points) {
    PointStyle style;
    style.policy = static_cast<std::size_t>(std::find(summary.policies.begin(), summary.policies.end(), point.policy) -
                                            summary.policies.begin());
    while (style.task < summary.data.tasks.size() && summary.data.tasks[style.task].id != point.task) ++style.task;
    styles.push_back(style);
  }
  return styles;
}

std::string ScatterPart(const RunSummary& summary) {
  std::string html = "<section id=\"worlds\"><h2>Worlds compared</h2>";
  if (summary.reference.empty())
    return html + "<p>No world of this run is marked real: there is nothing to compare with.</p></section>";
  if (summary.comparisons.empty()) return html + "<p>The run has one world: there is nothing to compare.</p></section>";
  for (const WorldComparison& comparison : summary.comparisons) html += OneComparison(summary, comparison);
  return html + "</section>";
}

}  // namespace evac
