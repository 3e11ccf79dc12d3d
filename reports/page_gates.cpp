#include <fmt/format.h>

#include <algorithm>
#include <string_view>
#include <utility>

#include "reports/counted_judges.h"
#include "reports/html.h"
#include "reports/page_parts.h"
#include "reports/wording.h"

namespace evac {
namespace {

constexpr std::size_t kMostExamples = 12;

/// A decision names clips as whoever asked for it named the run ("out/candidate/videos/…"); the page lies beside the
/// run, wherever that is by now. @returns the path from the run; empty if the run has no such clip.
std::string ClipInRun(std::string_view clip, const RunSummary& summary) {
  const auto is_it = [&](const JudgedEpisode& judged) {
    const std::string& video = judged.episode.video;
    if (video.empty() || !clip.ends_with(video)) return false;
    return clip.size() == video.size() || clip[clip.size() - video.size() - 1] == '/';
  };
  const auto found = std::ranges::find_if(summary.episodes, is_it);
  return found == summary.episodes.end() ? "" : found->episode.video;
}

std::string Example(const CounterExample& example, const RunSummary& summary, const PageOptions& options) {
  const std::string video = ClipInRun(example.candidate_video, summary);
  const std::string words = "candidate failed";
  return fmt::format("<li>{}, {} s{}: {}</li>", Escaped(example.task), Escaped(example.initial_state), example.seed,
                     video.empty() ? words : fmt::format("<a href=\"{}\">{}</a>", FileLink(video, options), words));
}

std::string Examples(const RuleDecision& rule, const RunSummary& summary, const PageOptions& options) {
  if (rule.counter_examples.empty()) return "";
  std::string items;
  const std::size_t shown = std::min(rule.counter_examples.size(), kMostExamples);
  for (std::size_t i = 0; i < shown; ++i) items += Example(rule.counter_examples[i], summary, options);
  const std::int64_t all = std::max(rule.flips_worse, std::ssize(rule.counter_examples));  // a bet is on fewer
  return fmt::format("<details><summary>{}{}</summary><ul class=\"flips\">{}</ul></details>",
                     Counted(all, "counter-example"),
                     std::cmp_less(shown, all) ? fmt::format(", the first {}", shown) : "", items);
}

std::string Rule(const RuleDecision& rule, const RunSummary& summary, const PageOptions& options) {
  return fmt::format("<div><dt>{} <span class=\"quiet\">{}</span></dt><dd>{}<div><p>{}</p>{}{}</div></dd></div>",
                     Breakable(rule.name), Escaped(rule.test), Tag(Name(rule.outcome)), Escaped(rule.statement),
                     rule.more.empty() ? "" : "<p class=\"quiet\">" + Escaped(rule.more) + "</p>",
                     Examples(rule, summary, options));
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
    for (const RuleDecision& rule : gate.decision.rules) html += Rule(rule, report.summary, options);
    html +=
        fmt::format("</dl><p class=\"quiet\">{}Rules <code>{}</code>, data <code>{}</code></p>",
                    gate.decision.judge.empty() ? "" : "Judge " + Escaped(JudgeWords(gate.decision.judge)) + ". ",
                    Escaped(gate.decision.rules_hash.substr(0, 12)), Escaped(gate.decision.data_hash.substr(0, 12)));
  }
  return html + "</section>";
}

}  // namespace evac
