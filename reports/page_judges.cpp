#include <fmt/format.h>

#include <cmath>

#include "reports/counted_judges.h"
#include "reports/html.h"
#include "reports/page_parts.h"
#include "reports/wording.h"

namespace evac {
namespace {

std::string Points(double share) {
  const double points = std::round(100 * share);
  return points == 0 ? "0" : fmt::format("{:+.0f}", points);
}

/// Brier's score and ECE, of the probabilities that it gives.
std::string CalibrationCells(const Calibration& calibration) {
  if (!calibration.ece) return "<td class=\"num\" colspan=\"2\">it gives none</td>";
  return StackedCell(calibration.brier) + fmt::format("<td class=\"num\">{}<small>n = {}</small></td>",
                                                      Plain(*calibration.ece), calibration.brier.n);
}

std::string ConfusionCell(const Confusion& confusion) {
  return fmt::format(
      "<td class=\"num\" title=\"both success, only the judge, only the truth, both failure\">{} · {} · "
      "{} · {}</td>",
      confusion.both_success, confusion.only_judge_success, confusion.only_human_success, confusion.both_failure);
}

std::string JudgeRow(const JudgeAgreement& judge) {
  std::string html = fmt::format("<tr><th scope=\"row\">{}</th><td>{}</td><td class=\"num\">{}</td>",
                                 Breakable(judge.judge), Breakable(judge.world), judge.judged);
  if (!judge.IsCalibrated()) {
    const std::string why =
        judge.apart > 0 ? fmt::format("of {} that both judged one of the two could tell nothing", Counted(judge.apart, "episode"))
                        : "no episode was judged by " + judge.against + " too";
    return html + fmt::format("<td colspan=\"9\">{} {}</td></tr>", Tag("uncalibrated"), Escaped(why));
  }
  return html + fmt::format("<td class=\"num\">{}</td>", judge.statistics.n) + ConfusionCell(judge.confusion) +
         fmt::format("<td class=\"num\">{}</td>", judge.apart) + StackedCell(judge.statistics.kappa) +
         StackedCell(judge.bias, Points) + StackedCell(judge.statistics.sensitivity) +
         StackedCell(judge.statistics.specificity) + CalibrationCells(judge.calibration) + "</tr>";
}

std::string Heading() {
  const auto number = [](const std::string& name, const std::string& more = "") {
    const std::string title = more.empty() ? "" : fmt::format(" title=\"{}\"", more);
    return fmt::format("<th scope=\"col\" class=\"num\"{}>{}</th>", title, name);
  };
  return "<div class=\"wide\"><table class=\"points\"><thead><tr><th scope=\"col\">judge</th><th "
         "scope=\"col\">world</th>" +
         number("judged") + number("compared") + number("matrix") +
         number("neither", "one of the two could not tell, or gave no verdict that can be read") + number("kappa") +
         number("kinder by", "share that the judge calls a success, less the truth’s, in points") +
         number("sensitivity") + number("specificity") + number("Brier", "of the probabilities of success") +
         number("ECE", "expected calibration error, in ten bins") + "</tr></thead><tbody>";
}

std::string Raters(const JudgeReport& judges) {
  if (judges.raters.empty()) return "";
  if (judges.raters.size() < 2) return "<p>One human rater: nobody to agree with.</p>";
  return fmt::format(
      "<p>{} human raters, {} judged by two or more: Krippendorff’s alpha, of success and failure alone, {}.</p>",
      judges.raters.size(), Counted(judges.rated_twice, "episode"),
      judges.alpha ? Plain(*judges.alpha) : "undefined: " + Escaped(judges.alpha.reason()));
}

/// "312 ok, 3 timeout, 1 parse_error"
std::string CallsByStatus(const CallTotals& totals) {
  std::string text;
  for (const auto& [status, count] : totals.calls)
    text += fmt::format("{}{} {}", text.empty() ? "" : ", ", count, Escaped(status));
  return text;
}

/// What asking model servers took. The money is the server's owner's business: prices are in nobody's reply.
std::string Calls(const std::vector<CallTotals>& all) {
  if (all.empty()) return "";
  std::string html =
      "<h3>Calls to model servers</h3><div class=\"wide\"><table class=\"points\"><thead><tr><th "
      "scope=\"col\">judge</th>"
      "<th scope=\"col\">calls by how they ended</th><th scope=\"col\" class=\"num\" title=\"tries again "
      "included\">requests</th><th scope=\"col\" class=\"num\">prompt tokens</th><th scope=\"col\" "
      "class=\"num\">completion tokens</th><th scope=\"col\" class=\"num\" title=\"the sum; calls may have run "
      "side by side\">seconds waited</th></tr></thead><tbody>";
  for (const CallTotals& totals : all) {
    html += fmt::format(
        "<tr><th scope=\"row\">{}</th><td>{}</td><td class=\"num\">{}</td><td class=\"num\">{}</td><td "
        "class=\"num\">{}</td><td class=\"num\">{:.1f}</td></tr>",
        Breakable(totals.judge), CallsByStatus(totals), totals.attempts, totals.prompt_tokens, totals.completion_tokens,
        static_cast<double>(totals.latency_ms) / 1000);
  }
  return html + "</tbody></table></div>";
}

}  // namespace

std::string JudgesPart(const ReportData& report) {
  const JudgeReport& judges = report.judges;
  std::string html = fmt::format("<section id=\"judges\"><h2>Judges</h2><p>Counted on this page: <b>{}</b>.</p>",
                                 Escaped(JudgeWords(report.summary.options.judge)));
  if (judges.judges.empty()) {
    return html +
           fmt::format("<p>{} No other judge has spoken, so nothing says how often {} errs.{}</p>", Tag("uncalibrated"),
                       Escaped(JudgeWords(report.summary.options.judge)),
                       report.summary.options.judge == "oracle"
                           ? " It reads the simulator’s physics against the rubric; whether people would call the same "
                             "episodes a success is not measured."
                           : "") +
           Raters(judges) + Calls(report.summary.data.judge_calls) + "</section>";
  }
  const std::string against = HeldAgainst(judges);
  const bool is_one = judges.judges.front().against == against;
  html += fmt::format(
      "<p class=\"quiet\">Each judge held against the best there is in its world: <b>{}</b>. Matrix: both success · "
      "only the judge · only {} · both failure. In brackets what is believed with {:.0f} %, over other initial "
      "states.</p>",
      Escaped(against), is_one ? Escaped(against) : "that one", 100 * report.summary.options.confidence);
  html += Heading();
  for (const JudgeAgreement& judge : judges.judges) html += JudgeRow(judge);
  return html + "</tbody></table></div>" + Raters(judges) + Calls(report.summary.data.judge_calls) + "</section>";
}

}  // namespace evac
