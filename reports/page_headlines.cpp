#include <fmt/format.h>

#include "reports/headlines.h"
#include "reports/html.h"
#include "reports/page_parts.h"

namespace evac {
namespace {

std::string Item(const HeadlineItem& item) {
  const std::string text = item.link.empty()
                               ? Breakable(item.text)
                               : fmt::format("<a href=\"{}\">{}</a>", Escaped(item.link), Breakable(item.text));
  return fmt::format("<li{}>{}<span>{}</span></li>", item.tag.empty() ? " class=\"untagged\"" : "", Tag(item.tag),
                     text);
}

}  // namespace

std::string HeadlinesPart(const ReportData& report) {
  std::string html = "<section class=\"headlines\" aria-label=\"In short\">";
  for (const Headline& headline : HeadlinesOf(report)) {
    html += "<div><h2>" + Breakable(headline.question) + "</h2><ul>";
    for (const HeadlineItem& item : headline.items) html += Item(item);
    html += "</ul></div>";
  }
  return html + "</section>";
}

std::string FindingsPart(const RunSummary& summary) {
  std::string html = "<section id=\"findings\" class=\"findings\"><h2>Findings</h2><dl>";
  for (const Finding& finding : FindingsOf(summary)) {
    html += fmt::format("<div><dt>{}</dt><dd>{}<p>{}</p></dd></div>", Escaped(finding.question),
                        Tag(Name(finding.decision)), Escaped(finding.answer));
  }
  return html + "</dl></section>";
}

}  // namespace evac
