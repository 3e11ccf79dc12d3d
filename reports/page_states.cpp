#include <fmt/format.h>

#include "reports/charts.h"
#include "reports/html.h"
#include "reports/page_parts.h"
#include "reports/wording.h"

namespace evac {
namespace {

/// Beyond these a list is no help: the strip and the clip browser have them all.
constexpr int kMostListed = 40;

bool IsFlip(const RunSummary& summary, const EpisodePair& pair) {
  return StateOutcomes{summary.episodes[pair.real].outcome, summary.episodes[pair.other].outcome}.IsFlip();
}

std::string VideoLink(const JudgedEpisode& judged, const PageOptions& options) {
  const std::string name = Escaped(judged.episode.key.world) + " " + OutcomeBadge(judged.outcome);
  if (judged.episode.video.empty()) return name;
  return fmt::format("<a class=\"play\" href=\"{}\">{}</a>", FileLink(judged.episode.video, options), name);
}

std::string Reason(const JudgedEpisode& judged) {
  return judged.verdict ? "<span class=\"quiet\">" + Escaped(judged.verdict->reason) + "</span>" : "";
}

/// One flip for those who read without script: both videos, and why the lost one was lost.
std::string FlipItem(const RunSummary& summary, const EpisodePair& pair, const PageOptions& options) {
  const JudgedEpisode& real = summary.episodes[pair.real];
  const JudgedEpisode& other = summary.episodes[pair.other];
  const JudgedEpisode& lost = real.outcome == Outcome::kFailure ? real : other;
  return fmt::format("<li><a href=\"#{}\">{}</a>: {}, {} {}</li>", ClipId(real.episode),
                     Escaped(fmt::format("{} s{}", real.episode.key.pair.initial_state, real.episode.key.pair.seed)),
                     VideoLink(real, options), VideoLink(other, options), Reason(lost));
}

std::string FlipList(const RunSummary& summary, const PairTable& table, const PageOptions& options) {
  std::string items;
  int listed = 0;
  for (const EpisodePair& pair : table.pairs) {
    if (IsFlip(summary, pair) && listed++ < kMostListed) items += FlipItem(summary, pair, options);
  }
  if (items.empty()) return "";
  const std::string more =
      listed > kMostListed
          ? fmt::format("<p class=\"quiet\">The first {}; select a cell of the strip for any.</p>", kMostListed)
          : "";
  return fmt::format("<details><summary>{}</summary><ul class=\"flips\">{}</ul>{}</details>",
                     Counted(table.real_only + table.other_only, "flipped pair"), items, more);
}

std::string Strip(const RunSummary& summary, const WorldComparison& comparison, const PairTable& table) {
  std::vector<StateOutcomes> states;
  for (const EpisodePair& pair : table.pairs)
    states.push_back({summary.episodes[pair.real].outcome, summary.episodes[pair.other].outcome});
  return fmt::format(
      "<div class=\"states\" role=\"group\" aria-label=\"{}\" data-task=\"{}\" data-policy=\"{}\" "
      "data-world=\"{}\">{}</div><p class=\"pointed\" aria-live=\"polite\"></p>",
      Escaped(fmt::format("{} of {}, {}", Counted(std::ssize(states), "pair"), table.task, table.policy)),
      Escaped(table.task), Escaped(table.policy), Escaped(comparison.other), StateStrip(states));
}

std::string TwoByTwo(const WorldComparison& comparison, const PairTable& table) {
  const std::string real = Escaped(comparison.real), other = Escaped(comparison.other);
  return fmt::format(
      "<table class=\"two\"><caption class=\"sr\">Paired outcomes of {} and {}</caption><thead><tr><td></td><th "
      "scope=\"col\">{} ✓</th>"
      "<th scope=\"col\">{} ✗</th></tr></thead><tbody><tr><th scope=\"row\">{} ✓</th><td>{}</td><td "
      "class=\"off\">{}</td></tr>"
      "<tr><th scope=\"row\">{} ✗</th><td class=\"off\">{}</td><td>{}</td></tr></tbody></table>",
      real, other, other, other, real, table.both_succeed, table.real_only, real, table.other_only, table.both_fail);
}

std::string TestInWords(const PairTable& table) {
  if (table.Counted() == 0) return "No pair is judged in both worlds: no test.";
  std::string words = fmt::format("Same outcome: {}, n = {}. {}: {}.", PercentWithInterval(table.agreement),
                                  Counted(table.Counted(), "pair"), OnPairs("Exact McNemar", {table.Counted(), table.effective_pairs}),
                                  PValue(table.test.p_exact));
  if (table.uncounted > 0)
    words +=
        fmt::format(" {} left out: an error, or no verdict of success or failure.", Counted(table.uncounted, "pair"));
  if (table.unpaired > 0) words += fmt::format(" {} without a partner.", Counted(table.unpaired, "episode"));
  return words;
}

std::string PolicyCard(const RunSummary& summary, const WorldComparison& comparison, const PairTable& table,
                       const PageOptions& options) {
  return fmt::format(
      "<article class=\"card\"><h4>{} <span class=\"quiet\">{}</span></h4>{}<div "
      "class=\"overview\">{}<p>{}</p></div>{}</article>",
      Breakable(table.policy), Breakable(table.task), Strip(summary, comparison, table), TwoByTwo(comparison, table),
      TestInWords(table), FlipList(summary, table, options));
}

std::string Key(const WorldComparison& comparison) {
  const auto cell = [](Outcome outcome) {
    return "<span class=\"keycell\">" + StateStrip({{outcome, outcome}}) + "</span>";
  };
  return fmt::format(
      "<p class=\"quiet\">One cell per initial state: upper half {}, lower half {}. {} both succeed, {} both fail, {} "
      "not "
      "counted; a bar below marks a flip: <span class=\"keycell\">{}</span>. Select a cell to see its videos side by "
      "side. The tests are one by one, not corrected for their number.</p>",
      Escaped(comparison.real), Escaped(comparison.other), cell(Outcome::kSuccess), cell(Outcome::kFailure),
      cell(Outcome::kError), StateStrip({{Outcome::kSuccess, Outcome::kFailure}}));
}

}  // namespace

std::string StatesPart(const RunSummary& summary, const PageOptions& options) {
  std::string html = "<section id=\"states\"><h2>Agreement, state by state</h2>";
  if (summary.comparisons.empty())
    return html + "<p>Flips need episodes in the real world and in another one.</p></section>";
  html += StateStripFrames();
  for (const WorldComparison& comparison : summary.comparisons) {
    html +=
        fmt::format("<h3>{} against {}</h3>", Escaped(comparison.other), Escaped(comparison.real)) + Key(comparison);
    if (comparison.tables.empty()) html += "<p>No (task, policy) has episodes in both worlds yet.</p>";
    html += "<div class=\"cards\">";
    for (const PairTable& table : comparison.tables) html += PolicyCard(summary, comparison, table, options);
    html += "</div>";
  }
  return html + "</section>";
}

}  // namespace evac
