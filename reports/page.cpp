#include "reports/page.h"

#include <fmt/format.h>

#include <algorithm>
#include <set>

#include "reports/findings.h"
#include "reports/html.h"
#include "reports/page_parts.h"
#include "reports/wording.h"

namespace evac {
namespace {

std::string Subtitle(const RunSummary& summary) {
  std::set<std::pair<std::string, std::string>> states;
  for (const JudgedEpisode& judged : summary.episodes)
    states.insert({judged.episode.key.pair.task, judged.episode.key.pair.initial_state});
  return fmt::format(
      "{} · {} · {} · {} · {} · judge {}", Counted(static_cast<std::int64_t>(summary.data.tasks.size()), "task"),
      Counted(static_cast<std::int64_t>(summary.policies.size()), "policy", "policies"),
      Counted(static_cast<std::int64_t>(summary.data.worlds.size()), "world"),
      Counted(static_cast<std::int64_t>(states.size()), "initial state"),
      Counted(static_cast<std::int64_t>(summary.episodes.size()), "episode"), Escaped(summary.options.judge));
}

std::string Navigation() {
  return "<nav aria-label=\"Sections\"><a href=\"#rates\">Rates</a><a href=\"#worlds\">Worlds</a><a "
         "href=\"#flips\">Flips</a>"
         "<a href=\"#clips\">Clips</a><a href=\"#errors\">Errors</a><a href=\"#provenance\">Provenance</a></nav>";
}

/// Said first where a judge has not spoken: without verdicts there is nothing to count.
std::string MissingVerdicts(const RunSummary& summary) {
  const std::int64_t unjudged = summary.Count(Outcome::kUnjudged);
  if (unjudged == 0) return "";
  std::string others;
  for (const std::string& judge : summary.judges) {
    if (judge != summary.options.judge) others += (others.empty() ? "" : ", ") + Escaped(judge);
  }
  return fmt::format(
      "<p class=\"notice\" role=\"note\"><strong>{} no verdict by {}.</strong> No rate counts such. "
      "<code>evac judge RUN --judge {}</code>, then <code>evac report RUN</code>, adds them.{}</p>",
      unjudged == 1 ? "1 episode has" : fmt::format("{} episodes have", unjudged), Escaped(summary.options.judge),
      Escaped(summary.options.judge), others.empty() ? "" : " Other judges have spoken: " + others + ".");
}

}  // namespace

std::string OutcomeBadge(Outcome outcome) {
  static constexpr const char* kSigns[] = {"✓", "✗", "?", "⊘", "!", "–"};
  return fmt::format("<span class=\"outcome {}\"><span aria-hidden=\"true\">{}</span> {}</span>", Name(outcome),
                     kSigns[static_cast<std::size_t>(outcome)], Words(outcome));
}

std::string FileLink(const std::string& file, const PageOptions& options) {
  const bool beside = options.run_folder.empty() || options.run_folder == ".";
  return Link(beside ? file : options.run_folder + "/" + file);
}

std::string AspectRatio(const RunSummary& summary, const std::string& task) {
  for (const Task& candidate : summary.data.tasks) {
    if (candidate.id != task || candidate.cameras.empty()) continue;
    int width_px = 0, height_px = 0;
    for (const Camera& camera : candidate.cameras) {
      width_px += camera.width_px;
      height_px = std::max(height_px, camera.height_px);
    }
    return fmt::format("{} / {}", width_px, height_px);
  }
  return "";
}

std::string ClipId(const Episode& episode) { return "clip-" + Anchor(episode.key.Id()); }

std::string PairId(const PairKey& pair, const std::string& world) {
  return "flip-" + Anchor(EpisodeKey{pair, world}.Id());
}

std::string FindingsPart(const RunSummary& summary) {
  std::string html = "<section class=\"findings\" aria-label=\"Findings\"><dl>";
  for (const Finding& finding : FindingsOf(summary)) {
    std::string tag_class = Name(finding.decision);
    std::replace(tag_class.begin(), tag_class.end(), ' ', '-');
    html += fmt::format("<div><dt>{}</dt><dd><span class=\"tag {}\">{}</span><p>{}</p></dd></div>",
                        Escaped(finding.question), tag_class, Name(finding.decision), Escaped(finding.answer));
  }
  return html + "</dl></section>";
}

std::string ReportPage(const RunSummary& summary, const PageOptions& options) {
  std::string html =
      "<!doctype html>\n<html lang=\"en\"><head><meta charset=\"utf-8\">"
      "<meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">"
      "<meta name=\"color-scheme\" content=\"light dark\"><meta name=\"referrer\" content=\"no-referrer\">"
      "<title>Policy evaluation report</title>\n<style>" +
      PageStyle() + "</style></head>\n<body>";
  html += "<header><h1>Policy evaluation</h1><p class=\"subtitle\">" + Subtitle(summary) + "</p></header>\n<main>\n";
  html += MissingVerdicts(summary) + FindingsPart(summary) + "\n" + Navigation() + "\n";
  html += RatesPart(summary) + "\n" + ScatterPart(summary) + "\n" + FlipsPart(summary, options) + "\n";
  html += ClipsPart(summary, options) + "\n" + ErrorsPart(summary) + "\n" + ProvenancePart(summary, options);
  html += "\n</main>\n<script>" + PageScript() + "</script></body></html>\n";
  return html;
}

}  // namespace evac
