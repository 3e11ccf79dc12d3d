#include "reports/dashboard_pages.h"

#include <fmt/format.h>

#include <algorithm>
#include <map>

#include "reports/charts.h"
#include "reports/estimate_json.h"
#include "reports/headlines.h"
#include "reports/html.h"
#include "reports/page_parts.h"
#include "reports/wording.h"

namespace evac {
namespace {

/// Over all tasks: each (policy, world) once, clustered by (task, initial state).
std::vector<RateCell> PooledRates(const RunSummary& summary) {
  std::map<std::pair<std::string, std::string>, std::vector<const JudgedEpisode*>> members;
  for (const JudgedEpisode& judged : summary.episodes) {
    const auto& [pair, world] = judged.episode.key;
    members[{PolicyLabel(pair.policy, pair.checkpoint), world}].push_back(&judged);
  }
  std::vector<RateCell> rates;
  for (const auto& [key, episodes] : members) {
    RateCell cell;
    cell.policy = key.first;
    cell.world = key.second;
    for (const JudgedEpisode* judged : episodes) ++cell.counts[static_cast<std::size_t>(judged->outcome)];
    cell.rate = RateOf(episodes, summary.options.confidence);
    rates.push_back(std::move(cell));
  }
  return rates;
}

std::string RunRow(const DashboardRun& run, std::size_t index) {
  if (!run.problem.empty())
    return fmt::format("<tr><th scope=\"row\">{}</th><td colspan=\"5\">{}</td></tr>", Breakable(run.name),
                       Escaped(run.problem));
  return fmt::format(
      "<tr><th scope=\"row\"><a href=\"runs/{}/\">{}</a></th><td class=\"num\">{}</td><td class=\"num\">{}</td><td "
      "class=\"num\">{}</td><td>{}</td><td><code>{}</code></td></tr>",
      index, Breakable(run.name), run.episodes, run.judged, run.errors, Breakable(run.verdict),
      Escaped(run.suite_hash.substr(0, 12)));
}

const RateCell* Find(const DashboardRun& run, const std::string& policy, const std::string& world) {
  const auto found = std::ranges::find_if(
      run.rates, [&](const RateCell& cell) { return cell.policy == policy && cell.world == world; });
  return found == run.rates.end() ? nullptr : &*found;
}

/// The runs in place of checkpoints.
CheckpointCurve CurveOf(const std::vector<DashboardRun>& runs, const std::string& policy) {
  CheckpointCurve curve;
  curve.task = "all tasks";
  curve.policy = policy;
  for (const DashboardRun& run : runs) {
    for (const RateCell& cell : run.rates) {
      if (cell.policy != policy || std::ranges::find(curve.worlds, cell.world) != curve.worlds.end()) continue;
      curve.worlds.insert(cell.world == run.reference ? curve.worlds.begin() : curve.worlds.end(), cell.world);
    }
  }
  for (std::size_t i = 0; i < runs.size(); ++i) {
    CheckpointPoint point{std::to_string(i + 1), static_cast<double>(i), {}};
    for (const std::string& world : curve.worlds) {
      const RateCell* cell = Find(runs[i], policy, world);
      Estimate none;
      none.value = Undefined{"no episode"};
      point.rate.push_back(cell == nullptr ? none : cell->rate);
    }
    curve.points.push_back(std::move(point));
  }
  return curve;
}

/// One mark for a world in all charts: the first real one's is that of a real world.
WorldMarks MarksOfAll(const std::vector<DashboardRun>& runs) {
  std::string real;
  std::vector<std::string> worlds;
  for (const DashboardRun& run : runs) {
    if (real.empty()) real = run.reference;
    worlds.insert(worlds.end(), run.worlds.begin(), run.worlds.end());
  }
  return MarksOf(real, worlds);
}

std::string History(const std::vector<DashboardRun>& runs) {
  std::vector<std::string> policies;
  for (const DashboardRun& run : runs) {
    for (const RateCell& cell : run.rates) {
      if (std::ranges::find(policies, cell.policy) == policies.end()) policies.push_back(cell.policy);
    }
  }
  if (policies.empty()) return "<p>No episode yet.</p>";
  const WorldMarks marks = MarksOfAll(runs);
  std::string html = "<div class=\"multiples\">";
  for (const std::string& policy : policies) {
    const CheckpointCurve curve = CurveOf(runs, policy);
    std::string keys;
    for (const std::string& world : curve.worlds) keys += WorldKey(marks.at(world), world);
    html += fmt::format("<figure><figcaption><b>{}</b> <span class=\"keys\">{}</span></figcaption>{}</figure>",
                        Breakable(policy), keys, InPage(CheckpointDrawing(curve, marks)));
  }
  return html + "</div>";
}

}  // namespace

DashboardRun DashboardRunOf(const std::string& name, const ReportData& report) {
  const RunSummary& summary = report.summary;
  DashboardRun run;
  run.name = name;
  run.suite_hash = summary.data.run.suite_hash;
  run.episodes = static_cast<std::int64_t>(summary.episodes.size());
  run.judged = run.episodes - summary.Count(Outcome::kUnjudged) - summary.Count(Outcome::kError);
  run.errors = summary.Count(Outcome::kError);
  run.reference = summary.reference;
  for (const WorldInfo& world : summary.data.worlds) run.worlds.push_back(world.name);
  run.rates = PooledRates(summary);
  const HeadlineItem worse = HeadlinesOf(report).front().items.front();
  run.verdict = worse.tag.empty() ? worse.text : worse.tag + ": " + worse.text;
  return run;
}

std::string DashboardIndex(const std::vector<DashboardRun>& runs, const std::string& program) {
  std::string rows;
  nlohmann::ordered_json stamps = nlohmann::ordered_json::array();
  for (std::size_t i = 0; i < runs.size(); ++i) {
    rows += RunRow(runs[i], i);
    stamps.push_back(runs[i].stamp);
  }
  return PageHead("evac dashboard", PageScripts::kLive) +
         "<body data-events=\"events\" data-stamp=\"" + Escaped(stamps.dump()) +
         "\"><header><h1>Runs</h1><p class=\"subtitle\">" +
         Counted(static_cast<std::int64_t>(runs.size()), "run") + " · " + Escaped(program) +
         "</p></header>\n<main><p class=\"live\" role=\"status\"></p><div class=\"wide\"><table "
         "class=\"plain\"><thead><tr><th "
         "scope=\"col\">run</th><th scope=\"col\" class=\"num\">episodes</th><th scope=\"col\" "
         "class=\"num\">judged</th><th "
         "scope=\"col\" class=\"num\">errors</th><th scope=\"col\">against its baseline</th><th "
         "scope=\"col\">suite</th></tr></thead><tbody>" +
         rows +
         "</tbody></table></div>\n<section id=\"history\"><h2>History</h2><p class=\"quiet\">Success rate over all "
         "tasks, run by run "
         "in the order given (1 is the first), with Wilson intervals. Suites may differ: look at their hashes.</p>" +
         History(runs) + "</section></main>\n<script>" + PageScript(PageScripts::kLive) + "</script></body></html>\n";
}

nlohmann::ordered_json DashboardHistory(const std::vector<DashboardRun>& runs) {
  nlohmann::ordered_json json = {{"schema", 1}, {"runs", nlohmann::ordered_json::array()}};
  for (const DashboardRun& run : runs) {
    nlohmann::ordered_json row = {{"name", run.name},         {"problem", run.problem}, {"suite_hash", run.suite_hash},
                                  {"episodes", run.episodes}, {"judged", run.judged},   {"errors", run.errors}};
    row["rates"] = nlohmann::ordered_json::array();
    for (const RateCell& cell : run.rates)
      row["rates"].push_back({{"policy", cell.policy}, {"world", cell.world}, {"success_rate", JsonOf(cell.rate)}});
    json["runs"].push_back(std::move(row));
  }
  return json;
}

}  // namespace evac
