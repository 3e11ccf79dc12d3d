#include <fmt/format.h>

#include <set>

#include "reports/html.h"
#include "reports/page_parts.h"
#include "reports/wording.h"

namespace evac {
namespace {

/// Beyond these the clip browser's filter is the better list.
constexpr int kMostErrors = 200;

std::string ErrorTable(const RunSummary& summary) {
  std::string rows;
  int listed = 0;
  for (const JudgedEpisode& judged : summary.episodes) {
    if (judged.outcome != Outcome::kError || ++listed > kMostErrors) continue;
    rows += fmt::format("<tr><th scope=\"row\"><a href=\"#{}\">{}</a></th><td><code>{}</code></td><td>{}</td></tr>",
                        ClipId(judged.episode), Escaped(judged.episode.key.Id()), Name(judged.episode.stop),
                        Escaped(judged.episode.failure));
  }
  if (rows.empty()) return "<p>No episode stopped with an error.</p>";
  return "<div class=\"wide\"><table class=\"plain\"><thead><tr><th scope=\"col\">episode</th><th "
         "scope=\"col\">stop</th><th scope=\"col\">reason</th></tr></thead><tbody>" +
         rows + "</tbody></table></div>" +
         (listed > kMostErrors ? fmt::format("<p class=\"quiet\">The first {} of {}.</p>", kMostErrors, listed) : "");
}

std::string CounterTable(const RunSummary& summary) {
  std::set<std::string> names;
  for (const auto& [policy, counters] : summary.data.counters) {
    for (const auto& [name, value] : counters) names.insert(name);
  }
  if (names.empty()) return "<p>Nothing was counted on the wire.</p>";
  std::string html = "<div class=\"wide\"><table class=\"plain counters\"><thead><tr><th scope=\"col\">policy</th>";
  for (const std::string& name : names) html += "<th scope=\"col\" class=\"num\">" + Escaped(name) + "</th>";
  html += "</tr></thead><tbody>";
  for (const auto& [policy, counters] : summary.data.counters) {
    html += "<tr><th scope=\"row\">" + Escaped(policy) + "</th>";
    for (const std::string& name : names)
      html += fmt::format("<td class=\"num\">{}</td>", counters.count(name) > 0 ? counters.at(name) : 0);
    html += "</tr>";
  }
  return html + "</tbody></table></div>";
}

}  // namespace

std::string ErrorsPart(const RunSummary& summary) {
  return "<section id=\"errors\"><h2>Errors</h2><p class=\"quiet\">Episodes that could not go on. They say nothing of "
         "a policy’s skill and are in no rate.</p>" +
         ErrorTable(summary) +
         "<h3>On the wire</h3><p class=\"quiet\">How often messages had to be repeated or were put aside: effort, no "
         "part of a result.</p>" +
         CounterTable(summary) + "</section>";
}

}  // namespace evac
