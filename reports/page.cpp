#include "reports/page.h"

#include <fmt/format.h>

#include <algorithm>
#include <set>

#include "core/base64.h"
#include "core/hash.h"
#include "reports/charts.h"
#include "reports/counted_judges.h"
#include "reports/html.h"
#include "reports/page_assets.h"
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
      Counted(static_cast<std::int64_t>(summary.episodes.size()), "episode"), Escaped(JudgeWords(summary.options.judge)));
}

std::string Navigation(const ReportData& report) {
  std::string html = "<nav aria-label=\"Sections\">";
  for (const auto& [id, name] :
       std::initializer_list<std::pair<const char*, const char*>>{{"gates", "Gates"},
                                                                  {"rates", "Rates"},
                                                                  {"findings", "Findings"},
                                                                  {"trust", "Trust"},
                                                                  {"worlds", "Worlds"},
                                                                  {"states", "States"},
                                                                  {"stages", "Stages"},
                                                                  {"checkpoints", "Checkpoints"},
                                                                  {"judges", "Judges"},
                                                                  {"clips", "Clips"},
                                                                  {"errors", "Errors"},
                                                                  {"methods", "Methods"},
                                                                  {"provenance", "Provenance"}}) {
    if (std::string_view(id) == "checkpoints" && report.checkpoints.empty()) continue;
    if (std::string_view(id) == "gates" && report.gates.empty()) continue;
    html += fmt::format("<a href=\"#{}\">{}</a>", id, name);
  }
  return html + "</nav>";
}

/// Said first where a judge has not spoken: without verdicts there is nothing to count.
std::string MissingVerdicts(const RunSummary& summary) {
  const std::int64_t unjudged = summary.Count(Outcome::kUnjudged);
  if (unjudged == 0) return "";
  std::string others;
  for (const std::string& judge : summary.judges) {
    if (!IsCounted(judge, summary.options.judge)) others += (others.empty() ? "" : ", ") + Escaped(judge);
  }
  const std::string with_small = CountedWithSmall(summary);
  if (!with_small.empty())
    return fmt::format(
        "<p class=\"notice\" role=\"note\"><strong>{} no verdict by {}.</strong> No rate counts such. Some were judged "
        "from smaller pictures: <code>evac report RUN --judge {}</code> counts these.</p>",
        unjudged == 1 ? "1 episode has" : fmt::format("{} episodes have", unjudged),
        Escaped(JudgeWords(summary.options.judge)), Escaped(with_small));
  const std::string judge = LastJudge(summary.options.judge), never = NeverJudged(judge);
  std::string commands;
  for (const std::string& command : JudgingCommands(judge))
    commands += "<code>" + Escaped(command) + "</code>, then ";
  return fmt::format(
      "<p class=\"notice\" role=\"note\"><strong>{} no verdict by {}.</strong> No rate counts such. "
      "{}<code>evac report RUN</code>, adds them.{}{}</p>",
      unjudged == 1 ? "1 episode has" : fmt::format("{} episodes have", unjudged), Escaped(JudgeWords(summary.options.judge)),
      commands, never.empty() ? "" : " But " + never + ".",
      others.empty() ? "" : " Other judges have spoken: " + others + ".");
}

/// "sha256-…" of a script, as a policy names it: base64 of the hash's bytes.
std::string HashOf(const std::string& script) {
  const std::string hex = Sha256Hex(script);
  std::string bytes;
  for (std::size_t at = 0; at < hex.size(); at += 2)
    bytes += static_cast<char>(std::stoul(hex.substr(at, 2), nullptr, 16));
  return "sha256-" + Base64(bytes);
}

}  // namespace

std::string StackedCell(const Estimate& estimate, std::string (*written)(double)) {
  if (!estimate.value)
    return "<td class=\"num\">undefined<small class=\"why\">" + Escaped(estimate.value.reason()) + "</small></td>";
  const Defined<Interval>& interval = estimate.interval;
  return fmt::format("<td class=\"num\">{}{}</td>", written(*estimate.value),
                     interval ? fmt::format("<small>[{}, {}]</small>", written(interval->low), written(interval->high))
                              : fmt::format("<small class=\"why\">{}</small>", Escaped(interval.reason())));
}

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

std::string PageScript(PageScripts scripts) {
  switch (scripts) {
    case PageScripts::kNone:
      return "";
    case PageScripts::kReport:
      return PageJs();
    case PageScripts::kLive:
      return LiveJs();
    case PageScripts::kLiveReport:
      return PageJs() + LiveJs();
  }
  return "";
}

std::string PageHead(const std::string& title, PageScripts scripts, const std::string& more) {
  const bool is_live = scripts == PageScripts::kLive || scripts == PageScripts::kLiveReport;
  const std::string script = scripts == PageScripts::kNone ? "none" : HashOf(PageScript(scripts));
  const std::string served = is_live ? "connect-src 'self'; " : "";  // a page on a disk has nobody to connect to
  const std::string icon = is_live ? "<link rel=\"icon\" href=\"data:,\">" : "";  // else a browser asks for one
  return "<!doctype html>\n<html lang=\"en\"><head><meta charset=\"utf-8\">"
         "<meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">"
         "<meta name=\"color-scheme\" content=\"light dark\"><meta name=\"referrer\" content=\"no-referrer\">"
         "<meta http-equiv=\"Content-Security-Policy\" content=\"default-src 'none'; img-src 'self' file: data:; "
         "media-src 'self' file:; style-src 'unsafe-inline'; " +
         served + "script-src '" + script + "'\">" + icon + "<title>" + Escaped(title) +
         "</title>\n<style>" + ColoursCss() + ChartsCss() + PageCss() + more + "</style></head>\n";
}

std::string LiveBody(const PageOptions& options) {
  return fmt::format("<body data-events=\"{}\" data-run=\"{}\" data-stamp=\"{}\">", Escaped(options.events), options.run,
                     Escaped(options.stamp));
}

std::string Tag(const std::string& word) {
  if (word.empty()) return "";
  std::string name = word;
  std::replace(name.begin(), name.end(), ' ', '-');
  return fmt::format("<span class=\"tag {}\">{}</span>", Escaped(name), Escaped(word));
}

std::string WorldKey(std::size_t index, const std::string& world) {
  return fmt::format("<span class=\"key\">{}{}</span>",
                     MarkerIcon(WorldShape(index), fmt::format("dot w{}", index % 4)), Escaped(world));
}

std::string ReportPage(const ReportData& report, const PageOptions& options) {
  const RunSummary& summary = report.summary;
  const PageScripts scripts = options.events.empty() ? PageScripts::kReport : PageScripts::kLiveReport;
  std::string html = PageHead("Policy evaluation report", scripts);
  html += options.events.empty() ? "<body>" : LiveBody(options);
  html += "<header><h1>Policy evaluation</h1><p class=\"subtitle\">" + Subtitle(summary) + "</p></header>\n<main>\n";
  if (!options.events.empty()) html += "<p class=\"live\" role=\"status\"></p>";
  html += MissingVerdicts(summary) + HeadlinesPart(report) + "\n" + Navigation(report) + "\n";
  for (const std::string& part :
       {GatesPart(report, options), RatesPart(report), FindingsPart(summary), TrustPart(report), ScatterPart(summary),
        StatesPart(summary, options), StagesPart(report), CheckpointsPart(report), JudgesPart(report),
        ClipsPart(summary), ErrorsPart(summary), MethodsPart(report), ProvenancePart(summary, options)}) {
    html += part + "\n";
  }
  return html + "</main>\n" + DataPart(summary, options) + "\n<script>" + PageScript(scripts) +
         "</script></body></html>\n";
}

std::string ReportPage(const RunSummary& summary, const PageOptions& options) {
  return ReportPage(ReportDataOf(summary), options);
}

}  // namespace evac
