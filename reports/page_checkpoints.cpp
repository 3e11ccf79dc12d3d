#include <fmt/format.h>

#include "reports/charts.h"
#include "reports/html.h"
#include "reports/page_parts.h"

namespace evac {
namespace {

std::string Curve(const CheckpointCurve& curve, const WorldMarks& marks) {
  std::string keys, words;
  for (std::size_t world = 0; world < curve.worlds.size(); ++world) {
    keys += WorldKey(marks.at(curve.worlds[world]), curve.worlds[world]);
    words += "<p>" + Escaped(TrendInWords(curve, world)) + "</p>";
  }
  return fmt::format(
      "<figure><figcaption><b>{}</b> <span class=\"keys\">{}</span></figcaption>{}<div "
      "class=\"quiet\">{}</div></figure>",
      Breakable(curve.task), keys, InPage(CheckpointDrawing(curve, marks)), words);
}

}  // namespace

std::string CheckpointsPart(const ReportData& report) {
  if (report.checkpoints.empty()) return "";
  std::string html =
      "<section id=\"checkpoints\"><h2>Checkpoints</h2><p class=\"quiet\">Success rate by checkpoint, Wilson "
      "intervals. "
      "The sentence compares the last checkpoint with the first one, on the same initial states where at least 80 % of "
      "them are shared; else it says “unpaired”.</p>";
  const WorldMarks marks = MarksOf(report.summary);
  std::string policy;
  for (const CheckpointCurve& curve : report.checkpoints) {
    if (curve.policy != policy) {
      html += policy.empty() ? "" : "</div>";
      html += fmt::format("<h3>{}</h3><p class=\"quiet\">{}</p><div class=\"multiples\">", Breakable(curve.policy),
                          curve.has_steps ? "In the order of the numbers that end their names."
                                          : "In the order of the suite: their names differ by more than a number at the end.");
      policy = curve.policy;
    }
    html += Curve(curve, marks);
  }
  return html + "</div></section>";
}

}  // namespace evac
