#include <fmt/format.h>

#include <set>

#include "reports/html.h"
#include "reports/page_parts.h"
#include "reports/wording.h"

namespace evac {
namespace {

std::string Select(const std::string& name, const std::vector<std::pair<std::string, std::string>>& choices) {
  std::string html = fmt::format("<label>{}<select data-filter=\"{}\"><option value=\"\">all</option>", name, name);
  for (const auto& [value, words] : choices)
    html += fmt::format("<option value=\"{}\">{}</option>", Escaped(value), Escaped(words));
  return html + "</select></label>";
}

std::string Filters(const RunSummary& summary) {
  std::vector<std::pair<std::string, std::string>> tasks, policies, worlds, outcomes;
  for (const Task& task : summary.data.tasks) tasks.emplace_back(task.id, task.id);
  for (const std::string& policy : summary.policies) policies.emplace_back(policy, policy);
  for (const WorldInfo& world : summary.data.worlds) worlds.emplace_back(world.name, world.name);
  for (std::size_t i = 0; i < kOutcomes; ++i) {
    const auto outcome = static_cast<Outcome>(i);
    if (summary.Count(outcome) > 0) outcomes.emplace_back(Name(outcome), Words(outcome));
  }
  return "<form class=\"filters\" hidden>" + Select("task", tasks) + Select("policy", policies) +
         Select("world", worlds) + Select("outcome", outcomes) +
         fmt::format("<output>{}</output></form>", Counted(static_cast<std::int64_t>(summary.episodes.size()), "clip"));
}

/// A link to the video around its thumbnail; with script, a click plays it in place.
std::string Picture(const RunSummary& summary, const Episode& episode, const PageOptions& options) {
  if (episode.video.empty()) return "<p class=\"novideo\">no video</p>";
  const std::string ratio = AspectRatio(summary, episode.key.pair.task);
  const std::string style = ratio.empty() ? "" : " style=\"aspect-ratio:" + ratio + "\"";
  const std::string image = episode.thumbnail.empty() ? "video"
                                                      : fmt::format("<img loading=\"lazy\" src=\"{}\" alt=\"\"{}>",
                                                                    FileLink(episode.thumbnail, options), style);
  return fmt::format("<a class=\"play\" href=\"{}\" aria-label=\"{}\">{}</a>", FileLink(episode.video, options),
                     Escaped("Play " + episode.key.Id()), image);
}

std::string Clip(const RunSummary& summary, const JudgedEpisode& judged, const PageOptions& options) {
  const EpisodeKey& key = judged.episode.key;
  const std::string policy = PolicyLabel(key.pair.policy, key.pair.checkpoint);
  std::string why = judged.episode.failure;
  if (why.empty() && judged.verdict) why = judged.verdict->reason;
  return fmt::format(
      "<figure class=\"clip\" id=\"{}\" data-task=\"{}\" data-policy=\"{}\" data-world=\"{}\" data-outcome=\"{}\" "
      "title=\"{}\">{}<figcaption>"
      "<p>{} <b>{}</b></p><p>{}</p><p class=\"quiet\">{} · {} · s{}</p></figcaption></figure>",
      ClipId(judged.episode), Escaped(key.pair.task), Escaped(policy), Escaped(key.world), Name(judged.outcome),
      Escaped(why), Picture(summary, judged.episode, options), OutcomeBadge(judged.outcome), Escaped(key.world),
      Escaped(policy), Escaped(key.pair.task), Escaped(key.pair.initial_state), key.pair.seed);
}

std::string ErrorTable(const RunSummary& summary) {
  std::string rows;
  for (const JudgedEpisode& judged : summary.episodes) {
    if (judged.outcome != Outcome::kError) continue;
    rows += fmt::format("<tr><th scope=\"row\"><a href=\"#{}\">{}</a></th><td><code>{}</code></td><td>{}</td></tr>",
                        ClipId(judged.episode), Escaped(judged.episode.key.Id()), Name(judged.episode.stop),
                        Escaped(judged.episode.failure));
  }
  if (rows.empty()) return "<p>No episode stopped with an error.</p>";
  return "<div class=\"wide\"><table class=\"plain\"><thead><tr><th scope=\"col\">episode</th><th "
         "scope=\"col\">stop</th><th scope=\"col\">reason</th></tr></thead><tbody>" +
         rows + "</tbody></table></div>";
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

std::string ClipsPart(const RunSummary& summary, const PageOptions& options) {
  std::string html = "<section id=\"clips\"><h2>Clips</h2>" + Filters(summary) + "<div class=\"clips\">";
  for (const JudgedEpisode& judged : summary.episodes) html += Clip(summary, judged, options) + "\n";
  return html + "</div><button type=\"button\" class=\"more\" hidden>Show all</button></section>";
}

std::string ErrorsPart(const RunSummary& summary) {
  return "<section id=\"errors\"><h2>Errors</h2><p class=\"quiet\">Episodes that could not go on. They say nothing of "
         "a policy’s skill and are in no rate.</p>" +
         ErrorTable(summary) +
         "<h3>On the wire</h3><p class=\"quiet\">How often messages had to be repeated or were put aside: effort, no "
         "part of a result.</p>" +
         CounterTable(summary) + "</section>";
}

}  // namespace evac
