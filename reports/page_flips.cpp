#include <fmt/format.h>

#include "reports/html.h"
#include "reports/page_parts.h"
#include "reports/wording.h"

namespace evac {
namespace {

bool IsFlip(const JudgedEpisode& real, const JudgedEpisode& other) {
  return real.Counts() && other.Counts() && real.outcome != other.outcome;
}

/// What was reached, in the rubric's order: "reach ✓ grasp ✓ lift ✗".
std::string Stages(const RunSummary& summary, const JudgedEpisode& judged) {
  if (!judged.verdict || judged.verdict->stages.empty()) return "";
  std::string html;
  for (const Task& task : summary.data.tasks) {
    if (task.id != judged.episode.key.pair.task) continue;
    for (const Stage& stage : task.rubric.stages) {
      const auto reached = judged.verdict->stages.find(stage.name);
      if (reached == judged.verdict->stages.end()) continue;
      html +=
          fmt::format("<li class=\"{}\">{} <span aria-label=\"{}\">{}</span></li>", reached->second ? "yes" : "no",
                      Escaped(stage.name), reached->second ? "reached" : "not reached", reached->second ? "✓" : "✗");
    }
  }
  return html.empty() ? "" : "<ul class=\"stages\">" + html + "</ul>";
}

std::string Video(const RunSummary& summary, const JudgedEpisode& judged, const PageOptions& options) {
  const Episode& episode = judged.episode;
  if (episode.video.empty()) return "<p class=\"novideo\">no video</p>";
  const std::string ratio = AspectRatio(summary, episode.key.pair.task);
  return fmt::format(
      "<video controls muted loop playsinline preload=\"none\"{}{} src=\"{}\" aria-label=\"{}\"></video>",
      episode.thumbnail.empty() ? "" : " poster=\"" + FileLink(episode.thumbnail, options) + "\"",
      ratio.empty() ? "" : " style=\"aspect-ratio:" + ratio + "\"", FileLink(episode.video, options),
      Escaped("Video of " + episode.key.Id()));
}

std::string Side(const RunSummary& summary, const JudgedEpisode& judged, const PageOptions& options) {
  const std::string reason = judged.verdict ? judged.verdict->reason : "";
  return fmt::format(
      "<figure>{}<figcaption><p><b>{}</b> {}</p>{}{}<p class=\"quiet\">Stopped: {}</p></figcaption></figure>",
      Video(summary, judged, options), Escaped(judged.episode.key.world), OutcomeBadge(judged.outcome),
      Stages(summary, judged), reason.empty() ? "" : "<p>" + Escaped(reason) + "</p>",
      Escaped(judged.episode.stop_reason.empty() ? Name(judged.episode.stop) : judged.episode.stop_reason));
}

std::string Flip(const RunSummary& summary, const EpisodePair& pair, const PageOptions& options) {
  const JudgedEpisode& real = summary.episodes[pair.real];
  const JudgedEpisode& other = summary.episodes[pair.other];
  const PairKey& key = real.episode.key.pair;
  return fmt::format(
      "<div class=\"pair\" id=\"{}\"><h5>{}, seed {}: only {} succeeds</h5><button type=\"button\" hidden>Play "
      "both</button>"
      "<div class=\"sides\">{}{}</div></div>",
      PairId(key, other.episode.key.world), Escaped(key.initial_state), key.seed,
      Escaped(real.outcome == Outcome::kSuccess ? real.episode.key.world : other.episode.key.world),
      Side(summary, real, options), Side(summary, other, options));
}

const char* HalfOf(const JudgedEpisode& judged) {
  if (judged.outcome == Outcome::kSuccess) return "yes";
  return judged.outcome == Outcome::kFailure ? "no" : "out";
}

/// One cell per initial state: its upper half is the real world, its lower half the other; filled where it succeeded.
std::string Strip(const RunSummary& summary, const PairTable& table) {
  std::string html = "<ol class=\"states\">";
  for (const EpisodePair& pair : table.pairs) {
    const JudgedEpisode& real = summary.episodes[pair.real];
    const JudgedEpisode& other = summary.episodes[pair.other];
    const std::string words = fmt::format("{}, seed {}: {} {}, {} {}", Escaped(real.episode.key.pair.initial_state),
                                          real.episode.key.pair.seed, Escaped(real.episode.key.world),
                                          Words(real.outcome), Escaped(other.episode.key.world), Words(other.outcome));
    const bool flip = IsFlip(real, other);
    html += fmt::format(
        "<li><a href=\"#{}\" title=\"{}\" aria-label=\"{}\"{}><i class=\"{}\"></i><i class=\"{}\"></i></a></li>",
        flip ? PairId(real.episode.key.pair, other.episode.key.world) : ClipId(real.episode), words, words,
        flip ? " class=\"flip\"" : "", HalfOf(real), HalfOf(other));
  }
  return html + "</ol>";
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
  std::string words = fmt::format("Same outcome: {}, n = {} pairs. Exact McNemar: {}.",
                                  PercentWithInterval(table.agreement), table.Counted(), PValue(table.test.p_exact));
  if (table.uncounted > 0)
    words +=
        fmt::format(" {} left out: an error, or no verdict of success or failure.", Counted(table.uncounted, "pair"));
  if (table.unpaired > 0) words += fmt::format(" {} without a partner.", Counted(table.unpaired, "episode"));
  return words;
}

std::string PolicyCard(const RunSummary& summary, const WorldComparison& comparison, const PairTable& table,
                       const PageOptions& options) {
  std::string flips;
  for (const EpisodePair& pair : table.pairs) {
    if (IsFlip(summary.episodes[pair.real], summary.episodes[pair.other])) flips += Flip(summary, pair, options);
  }
  std::string html = fmt::format(
      "<article class=\"card\"><h4>{} <span class=\"quiet\">{}</span></h4>{}<div class=\"overview\">{}<p>{}</p></div>",
      Escaped(table.policy), Escaped(table.task), Strip(summary, table), TwoByTwo(comparison, table),
      TestInWords(table));
  if (!flips.empty()) {
    html += fmt::format("<details><summary>{}: watch both videos</summary><div class=\"pairs\">{}</div></details>",
                        Counted(table.real_only + table.other_only, "flipped state"), flips);
  }
  return html + "</article>";
}

}  // namespace

std::string FlipsPart(const RunSummary& summary, const PageOptions& options) {
  std::string html = "<section id=\"flips\"><h2>Flips, state by state</h2>";
  if (summary.comparisons.empty())
    return html + "<p>Flips need episodes in the real world and in another one.</p></section>";
  for (const WorldComparison& comparison : summary.comparisons) {
    html += fmt::format(
        "<h3>{} against {}</h3><p class=\"quiet\">One cell per initial state: upper half {}, lower half {}; "
        "<span class=\"states key\"><i class=\"yes\"></i></span> success, <span class=\"states key\"><i "
        "class=\"no\"></i></span> failure, "
        "<span class=\"states key\"><i class=\"out\"></i></span> not counted. Select a flipped cell to see both "
        "videos. "
        "The tests are one by one, not corrected for their number.</p>",
        Escaped(comparison.other), Escaped(comparison.real), Escaped(comparison.real), Escaped(comparison.other));
    if (comparison.tables.empty()) html += "<p>No (task, policy) has episodes in both worlds yet.</p>";
    html += "<div class=\"cards\">";
    for (const PairTable& table : comparison.tables) html += PolicyCard(summary, comparison, table, options);
    html += "</div>";
  }
  return html + "</section>";
}

}  // namespace evac
