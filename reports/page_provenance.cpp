#include <fmt/format.h>

#include <algorithm>
#include <map>
#include <set>

#include "core/config.h"
#include "reports/counted_judges.h"
#include "reports/findings.h"
#include "reports/html.h"
#include "reports/page_parts.h"
#include "reports/wording.h"

namespace evac {
namespace {

std::string Row(const std::string& name, const std::string& html) {
  return fmt::format("<div><dt>{}</dt><dd>{}</dd></div>", name, html.empty() ? "–" : html);
}

std::string Code(const std::string& text) { return text.empty() ? "none" : "<code>" + Escaped(text) + "</code>"; }

std::string Folded(const std::string& title, const std::string& text) {
  if (text.empty()) return "";
  return fmt::format("<details class=\"folded\"><summary>{}</summary><pre>{}</pre></details>", Escaped(title),
                     Escaped(text));
}

std::string Worlds(const RunSummary& summary) {
  std::string html;
  for (const WorldInfo& world : summary.data.worlds) {
    html += fmt::format("<p><b>{}</b>, {}{}; profile {}</p>", Escaped(world.name), Escaped(world.type),
                        world.is_real ? ", the reference" : "", Code(world.profile_hash));
  }
  return html;
}

std::string Tasks(const RunSummary& summary) {
  std::string html;
  for (const Task& task : summary.data.tasks) {
    std::set<std::string> states;
    std::set<std::uint64_t> seeds;
    for (const JudgedEpisode& judged : summary.episodes) {
      if (judged.episode.key.pair.task != task.id) continue;
      states.insert(judged.episode.key.pair.initial_state);
      seeds.insert(judged.episode.key.pair.seed);
    }
    std::string seed_list;
    for (const std::uint64_t seed : seeds) seed_list += (seed_list.empty() ? "" : ", ") + std::to_string(seed);
    html += fmt::format(
        "<p><b>{}</b>, {}{}; seeds {}; rubric {}: {}</p>", Escaped(task.id),
        Counted(static_cast<std::int64_t>(states.size()), "initial state"),
        states.size() < 2 ? "" : fmt::format(", {} … {}", Escaped(*states.begin()), Escaped(*states.rbegin())),
        seed_list.empty() ? "none" : seed_list, Code(task.rubric.version), Escaped(task.rubric.success));
  }
  return html;
}

std::string Policies(const RunSummary& summary) {
  std::string html;
  for (const PolicyInfo& policy : summary.data.policies) {
    const std::string label = PolicyLabel(policy.name, policy.checkpoint);
    html += policy.declaration.empty() ? "<p><b>" + Escaped(label) + "</b>: nothing declared</p>"
                                       : Folded(label, policy.declaration);
  }
  return html;
}

/// As the suite says: results are only comparable where it is the same.
std::string Latency(const RunSummary& summary) try {
  const Config suite = Config::FromText(summary.data.run.suite_text, "suite");
  const std::string latency = suite.Has("policy") ? suite.Section("policy").Get<std::string>("latency", "off") : "off";
  if (latency == "off") return "off: the worlds wait while a policy thinks";
  if (latency == "measured") return "measured: the worlds move on while a policy thinks, and no two runs are alike";
  return fmt::format("{} s: the worlds move on for that long while a policy thinks", Escaped(latency));
} catch (const Error&) {
  return "";
}

std::string Judges(const RunSummary& summary) {
  std::string html = fmt::format("<p>Counted: <b>{}</b>.</p>", Escaped(JudgeWords(summary.options.judge)));
  std::map<std::string, std::int64_t> rubrics;
  for (const JudgedEpisode& judged : summary.episodes) {
    if (judged.verdict) ++rubrics[judged.verdict->rubric_version];
  }
  for (const auto& [rubric, count] : rubrics)
    html += fmt::format("<p>{} by rubric {}.</p>", Counted(count, "verdict"), Code(rubric));
  for (const std::string& judge : summary.judges) {
    if (!IsCounted(judge, summary.options.judge))
      html += fmt::format("<p>Also in the store, not counted here: {}.</p>", Escaped(judge));
  }
  return html;
}

std::string Exclusions(const RunSummary& summary) {
  std::string html;
  for (const Outcome outcome : {Outcome::kError, Outcome::kCannotTell, Outcome::kInvalid, Outcome::kUnjudged}) {
    if (summary.Count(outcome) > 0)
      html += fmt::format("<p>{}: {}.</p>", Counted(summary.Count(outcome), "episode"), Words(outcome));
  }
  for (const WorldComparison& comparison : summary.comparisons) {
    std::int64_t uncounted = 0, unpaired = 0;
    for (const PairTable& table : comparison.tables) {
      uncounted += table.uncounted;
      unpaired += table.unpaired;
    }
    if (uncounted > 0)
      html += fmt::format("<p>{} of {} and {} where one side does not count.</p>", Counted(uncounted, "pair"),
                          Escaped(comparison.real), Escaped(comparison.other));
    if (unpaired > 0)
      html += fmt::format("<p>{} of {} or {} without a partner.</p>", Counted(unpaired, "episode"),
                          Escaped(comparison.real), Escaped(comparison.other));
  }
  return html.empty() ? "none" : html;
}

}  // namespace

std::string ProvenancePart(const RunSummary& summary, const PageOptions& options) {
  const RunInfo& run = summary.data.run;
  std::string html = "<section id=\"provenance\"><h2>Provenance</h2><dl class=\"facts\">";
  html += Row("Suite", "SHA-256 " + Code(run.suite_hash) + Folded("The effective suite", run.suite_text));
  html +=
      Row("Versions", fmt::format("run by evac {}, page by {}", Escaped(run.evac_version), Escaped(options.program)));
  html += Row("Worlds", Worlds(summary)) + Row("Tasks", Tasks(summary)) + Row("Policies", Policies(summary)) +
          Row("Policy latency", Latency(summary)) + Row("Judges", Judges(summary));
  html += Row("Not counted", Exclusions(summary));
  return html +
         "</dl><p class=\"quiet\">The same numbers for programs: <code>report.json</code> beside this "
         "page.</p></section>";
}

}  // namespace evac
