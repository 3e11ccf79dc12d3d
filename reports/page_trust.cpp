#include <fmt/format.h>

#include <algorithm>

#include "reports/charts.h"
#include "reports/html.h"
#include "reports/page_parts.h"
#include "reports/wording.h"

namespace evac {
namespace {

std::string RateOrReason(const Estimate& rate) { return Escaped(PercentWithInterval(rate)); }

std::string Tested(const TaskTrust& task) {
  if (task.pairs.n() == 0) return "–";
  return OnPairs(PValue(task.test.p_exact), {task.pairs.n(), task.tested_pairs});
}

std::string TaskRow(const TaskTrust& task, const TrustReport& trust, std::size_t world) {
  const std::string statement = TrustStatement(task, trust);
  const std::string more = task.trust != Trust::kUnknown ? ""
                           : task.more                   ? fmt::format("about {}", Counted(*task.more, "more pair"))
                                                         : Escaped(task.more.reason());
  return fmt::format(
      "<tr title=\"{}\"><th scope=\"row\">{}</th><td>{}</td><td class=\"plot\">{}</td><td class=\"num\">{}</td>"
      "<td class=\"num\">{}</td><td class=\"num\">{}</td><td class=\"num\">{}</td><td "
      "class=\"more-pairs\">{}</td></tr>",
      Escaped(statement), Breakable(task.task), Tag(Name(task.trust)),
      BiasStrip(task.bias, trust.options.margin, world),
      Escaped(PointsWithInterval(task.bias)), task.pairs.n(), Escaped(NumberWithInterval(task.agreement.kappa)),
      Escaped(Tested(task)), more.empty() ? "–" : more);
}

std::string TaskTable(const TrustReport& trust, std::size_t world) {
  std::string html = fmt::format(
      "<div class=\"wide\"><table class=\"rates trust\"><thead><tr><th scope=\"col\">task</th><th "
      "scope=\"col\">trusted?</th><th scope=\"col\" class=\"plot\"><span class=\"sr\">bias in points</span>{}</th><th "
      "scope=\"col\" class=\"num\">bias [{:.0f} %]</th><th scope=\"col\" class=\"num\">pairs</th><th scope=\"col\" "
      "class=\"num\">kappa</th><th scope=\"col\" class=\"num\">McNemar</th><th scope=\"col\">to "
      "decide</th></tr></thead><tbody>",
      BiasScale(), 100 * trust.options.confidence);
  for (const TaskTrust& task : trust.tasks) html += TaskRow(task, trust, world);
  return html + "</tbody></table></div>";
}

/// MOVER's value may lie outside [0, 1]; its interval does not.
std::string Predicted(const PredictedRate& rate) {
  if (!rate.predicted.value) return "as real alone: " + rate.predicted.value.reason();
  Estimate shown = rate.predicted;
  shown.value = std::clamp(*shown.value, 0.0, 1.0);
  return PercentWithInterval(shown);
}

/// Only where imagined episodes go beyond the real ones: else it would repeat the rates.
std::string PredictedRates(const TrustReport& trust) {
  std::string rows;
  for (const TaskTrust& task : trust.tasks) {
    for (const PredictedRate& rate : task.policies) {
      if (rate.further.trials == 0) continue;
      rows += fmt::format(
          "<tr><th scope=\"row\">{} <span class=\"quiet\">{}</span></th><td class=\"num\">{}</td><td "
          "class=\"num\">{}</td><td class=\"num\">{} of {}</td><td class=\"num\">{}</td></tr>",
          Breakable(rate.policy), Breakable(task.task), RateOrReason(rate.real), rate.pairs.n(), rate.further.successes,
          rate.further.trials, Escaped(Predicted(rate)));
    }
  }
  if (rows.empty()) return "";
  return "<h4>The real rate, from few real and many imagined trials</h4><div class=\"wide\"><table "
         "class=\"points\"><thead>"
         "<tr><th scope=\"col\">policy, task</th><th scope=\"col\" class=\"num\">real alone</th><th scope=\"col\" "
         "class=\"num\">pairs</th><th scope=\"col\" class=\"num\">further imagined</th><th scope=\"col\" "
         "class=\"num\">real, from both</th></tr></thead><tbody>" +
         rows + "</tbody></table></div>";
}

}  // namespace

std::string TrustPart(const ReportData& report) {
  std::string html = "<section id=\"trust\"><h2>Trust in the other worlds</h2>";
  if (report.trust.empty()) return html + "<p>No statement: " + Escaped(report.no_trust) + ".</p></section>";
  const WorldMarks marks = MarksOf(report.summary);
  for (const TrustReport& trust : report.trust) {
    html += fmt::format(
        "<h3>May {} stand for the real world?</h3><p class=\"quiet\">Held against {}. <b>Yes</b>: the whole interval "
        "of "
        "its bias lies within ±{} (shaded); <b>no</b>: all of it lies outside; else <b>unknown</b>. Left of "
        "0 {} is harder than real, right of it kinder. McNemar asks whether there is any bias at all.</p>",
        Escaped(trust.world), Escaped(trust.real), GivenPoints(trust.options.margin), Escaped(trust.world));
    html += TaskTable(trust, marks.at(trust.world)) + PredictedRates(trust);
  }
  for (const auto& [world, reason] : report.unsaid)
    html += fmt::format("<h3>May {} stand for the real world?</h3><p>No statement: {}.</p>", Escaped(world),
                        Escaped(reason));
  return html + "</section>";
}

}  // namespace evac
