#include <fmt/format.h>

#include "reports/findings.h"
#include "reports/html.h"
#include "reports/methods.h"
#include "reports/page_parts.h"
#include "reports/wording.h"

namespace evac {
namespace {

std::string Notes(const RunSummary& summary) {
  const double confidence = 100 * summary.options.confidence;
  std::string html = fmt::format(
      "<p>Rates: Wilson score interval, {:.0f} %, on the effective number of trials where an initial state was tried "
      "with several seeds.</p>",
      confidence);
  for (const WorldComparison& comparison : summary.comparisons) {
    html += fmt::format(
        "<p>{} against {}: Pearson, Spearman and MMRV ({}) over {}; {:.0f} % intervals by {}.</p>",
        Escaped(comparison.other), Escaped(comparison.real), Escaped(Name(comparison.correlation.options.convention)),
        Counted(comparison.correlation.pearson.n, "point"), confidence, Escaped(comparison.correlation.pearson.method));
  }
  html += fmt::format(
      "<p>Pairs share task, initial state, policy, checkpoint and seed. McNemar’s test is exact and two-sided, on the "
      "effective number of pairs where initial states repeat (seeds, policies); decided below p = {}; not corrected "
      "for the number of tests.</p>",
      kAlpha);
  html += fmt::format(
      "<p>“Follows closely” means that the whole interval of Pearson lies above {}; “in direction”, above 0. Fewer "
      "than {} points give no correlation.</p>",
      kCloseCorrelation, kMinCorrelationPoints);
  return html;
}

}  // namespace

std::string MethodsPart(const ReportData& report) {
  return "<section id=\"methods\"><h2>Methods</h2><p class=\"quiet\">For a paper: written from the tests behind this "
         "page, "
         "and no others.</p><blockquote class=\"paragraph\">" +
         Escaped(MethodsParagraph(report)) + "</blockquote><details><summary>In detail</summary>" +
         Notes(report.summary) + "</details></section>";
}

}  // namespace evac
