#include <fmt/format.h>

#include "reports/html.h"
#include "reports/page_parts.h"
#include "reports/wording.h"

namespace evac {
namespace {

constexpr std::size_t kMostExamples = 12;

std::string Example(const CounterExample& example, const PageOptions& options) {
  const auto link = [&options](const std::string& video, const char* words) {
    return video.empty() ? std::string(words) : fmt::format("<a href=\"{}\">{}</a>", FileLink(video, options), words);
  };
  return fmt::format("<li>{}, {} s{}: {}</li>", Escaped(example.task), Escaped(example.initial_state), example.seed,
                     link(example.candidate_video, "candidate failed"));
}

std::string Examples(const RuleDecision& rule, const PageOptions& options) {
  if (rule.counter_examples.empty()) return "";
  std::string items;
  for (std::size_t i = 0; i < rule.counter_examples.size() && i < kMostExamples; ++i)
    items += Example(rule.counter_examples[i], options);
  return fmt::format("<details><summary>{}</summary><ul class=\"flips\">{}</ul></details>",
                     Counted(static_cast<std::int64_t>(rule.counter_examples.size()), "counter-example"), items);
}

std::string Rule(const RuleDecision& rule, const PageOptions& options) {
  return fmt::format("<div><dt>{} <span class=\"quiet\">{}</span></dt><dd>{}<div><p>{}</p>{}{}</div></dd></div>",
                     Breakable(rule.name), Escaped(rule.test), Tag(Name(rule.outcome)), Escaped(rule.statement),
                     rule.more.empty() ? "" : "<p class=\"quiet\">" + Escaped(rule.more) + "</p>",
                     Examples(rule, options));
}

}  // namespace

std::string GatesPart(const ReportData& report, const PageOptions& options) {
  if (report.gates.empty()) return "";
  std::string html = "<section id=\"gates\" class=\"findings\"><h2>Gates</h2>";
  for (const ShownGate& gate : report.gates) {
    html += fmt::format("<h3>{} {}</h3>", Breakable(gate.decision.name), Tag(Name(gate.decision.outcome)));
    if (!gate.is_current)
      html += "<p class=\"notice\">The run has changed since: this decision speaks of older data.</p>";
    html += "<dl>";
    for (const RuleDecision& rule : gate.decision.rules) html += Rule(rule, options);
    html +=
        fmt::format("</dl><p class=\"quiet\">Rules <code>{}</code>, data <code>{}</code></p>",
                    Escaped(gate.decision.rules_hash.substr(0, 12)), Escaped(gate.decision.data_hash.substr(0, 12)));
  }
  return html + "</section>";
}

}  // namespace evac
