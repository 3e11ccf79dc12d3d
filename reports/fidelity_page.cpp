#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "reports/fidelity.h"
#include "reports/html.h"
#include "reports/page_parts.h"
#include "reports/wording.h"

namespace evac {
namespace {

constexpr const char* kStyle = R"css(
.drift{max-width:44rem;width:100%;height:auto;display:block}.drift text{font-size:12px;fill:var(--ink)}.drift .axis{stroke:var(--rule);fill:none}
.drift .all{stroke:var(--c0);fill:none;stroke-width:2}.drift .moving{stroke:var(--c1);fill:none;stroke-width:2}.drift .still{stroke:var(--c1);fill:none;stroke-width:2;stroke-dasharray:5 4}
.pairs{display:grid;grid-template-columns:repeat(auto-fill,minmax(20rem,1fr));gap:1rem;margin-top:.6rem}.pairs figure{margin:0;min-width:0}.pairs video{width:100%;background:#000;display:block;margin-bottom:2px}
.pairs figcaption{color:var(--quiet);font-size:.87rem}.stats td,.stats th{white-space:nowrap}
)css";

constexpr std::size_t kShown = 6;  ///< pairs of clips of each sort

std::string Percent(const Number& number) {
  return number ? evac::Percent(*number)
                : fmt::format("<span class=\"quiet\" title=\"{}\">–</span>", Escaped(number.reason()));
}
std::string Decimal(const Number& number, int digits) {
  if (!number) return fmt::format("<span class=\"quiet\" title=\"{}\">–</span>", Escaped(number.reason()));
  const std::string text = fmt::format("{:.{}f}", *number, digits);
  return text.find_first_not_of("-0.") == std::string::npos && text.starts_with('-') ? text.substr(1) : text;  // no "-0.00"
}
std::string WithInterval(const Estimate& estimate) {
  std::string text = Decimal(estimate.value, 2);
  if (estimate.value && estimate.interval)
    text += fmt::format(" <span class=\"quiet\">[{:.2f}, {:.2f}]</span>", estimate.interval->low,
                        estimate.interval->high);
  return text;
}
std::string ShareWithInterval(const Estimate& share) {
  std::string text = Percent(share.value);
  if (share.value && share.interval)
    text += fmt::format(" <span class=\"quiet\">[{}, {}]</span>", PercentDigits(share.interval->low),
                        PercentDigits(share.interval->high));
  return text;
}

std::string Section(const char* id, const char* title) {
  return fmt::format("\n<section id=\"{}\"><h2>{}</h2>", id, title);
}

/// The names of the columns, numbers to the right of the first.
std::string TableHead(const std::vector<std::string>& columns) {
  std::string html = "<div class=\"wide\"><table class=\"stats\"><thead><tr>";
  for (std::size_t i = 0; i < columns.size(); ++i)
    html += fmt::format("<th scope=\"col\"{}>{}</th>", i == 0 ? "" : " class=\"num\"", columns[i]);
  return html + "</tr></thead><tbody>";
}

std::string MatchRow(const std::string& name, const OutcomeMatch& match) {
  return fmt::format("<tr><th scope=\"row\">{}</th><td class=\"num\">{}</td><td class=\"num\">{}</td><td class=\"num\">{}</td>"
                     "<td class=\"num\">{}</td><td class=\"num\">{}</td></tr>", Escaped(name), PairsText(match),
                     ShareWithInterval(match.agreement), ShareWithInterval(match.hallucinated),
                     ShareWithInterval(match.missed), WithInterval(match.kappa));
}

/// Of the closed loop's wrong outcomes: the model's own, and those of policies that saw something else.
std::string WhereItGoesWrong(const Fidelity& fidelity) {
  const auto& [of_actions, led_astray] = fidelity.wrong;
  if (of_actions + led_astray == 0) return "";
  return fmt::format("<p>Of {} of the closed loop, {} wrong about the very actions that were chosen: done in reality they come to "
                     "something else. About the other {} the world model is right: the policy acted otherwise in reality, or chance decided.</p>",
                     Counted(of_actions + led_astray, "wrong outcome"), Counted(of_actions, "is", "are"), led_astray);
}

std::string MatchTable(const Fidelity& fidelity) {
  std::string rows = MatchRow("closed loop: the policies act in the world model", fidelity.closed) +
                     MatchRow("reality against reality, other noise", fidelity.closed_again);
  if (HasOtherPairs(fidelity)) rows += MatchRow("reality against reality, of the closed loop's pairs", fidelity.closed_again_told);
  if (fidelity.open.n > 0) rows += MatchRow("open loop: recorded actions replayed", fidelity.open);
  if (fidelity.executed.n > 0) rows += MatchRow("executed: what policies chose in the world model, done in reality", fidelity.executed);
  for (const Fidelity::Counterfactual& one : fidelity.counterfactuals) rows += MatchRow(one.kind, one.match);
  return TableHead({"what was asked", "pairs", "agreement", "hallucinated", "missed", "kappa"}) + rows + "</tbody></table></div>" +
         WhereItGoesWrong(fidelity) + "<p class=\"quiet\">Hallucinated: imagined success of what truly failed. Missed: imagined failure of what truly "
         "succeeded. Intervals: 95 %, Wilson on as many trials as the initial states are worth; of kappa, by initial state.</p>";
}

std::string CellTable(const Fidelity& fidelity) {
  std::string rows;
  for (const FidelityCell& cell : fidelity.cells)
    rows += fmt::format("<tr><th scope=\"row\">{} <span class=\"quiet\">{}</span></th><td class=\"num\">{}</td><td class=\"num\">{}</td>"
                        "<td class=\"num\">{}</td><td class=\"num\">{}</td><td class=\"num\">{}</td></tr>",
                        Breakable(PolicyLabel(cell.policy, cell.checkpoint)), Breakable(cell.task), cell.n, Percent(cell.real),
                        Percent(cell.again) + OfOtherPairs(cell), Percent(cell.model), Percent(cell.agreement));
  return TableHead({"policy, task", "pairs", "real", "real again", "imagined", "agreement"}) + rows + "</tbody></table></div>";
}

std::string Rates(const Fidelity& fidelity) {
  const std::string title = Section("rates", "Rates");
  if (fidelity.model.points.empty()) return title + "<p>No cell has a rate in both worlds.</p>" + CellTable(fidelity) + "</section>";
  return title + ComparisonPart(fidelity.model, StylesOf(fidelity.model)) + "<h3>Against reality asked again</h3>" +
         CellTable(fidelity) + "</section>";
}

/// One line of a chart: broken where the number is undefined.
std::string DriftLine(const std::vector<ChunkDrift>& chunks, Number ChunkDrift::*what, double top, const char* classes) {
  std::string path;
  bool pen = false;
  for (std::size_t i = 0; i < chunks.size(); ++i) {
    const Number& value = chunks[i].*what;
    if (value) {
      const double x = 40 + 520.0 * (static_cast<double>(i) + 0.5) / static_cast<double>(chunks.size());
      path += fmt::format("{}{:.1f} {:.1f}", pen ? "L" : "M", x, 180 - 160 * std::clamp(*value / top, 0.0, 1.0));
    }
    pen = static_cast<bool>(value);
  }
  return fmt::format("<path class=\"{}\" d=\"{}\"/>", classes, path);
}

std::string DriftChart(const std::vector<ChunkDrift>& chunks) {
  constexpr double kTop_db = 40;
  std::string marks;
  for (const int level_db : {10, 20, 30, 40}) {
    const double y = 180 - 160 * level_db / kTop_db;
    marks += fmt::format("<line class=\"axis\" x1=\"40\" x2=\"560\" y1=\"{0}\" y2=\"{0}\"/><text x=\"34\" y=\"{1}\" text-anchor=\"end\">{2}</text>",
                         y, y + 4, level_db);
  }
  return "<svg class=\"drift\" viewBox=\"0 0 600 210\" role=\"img\" aria-label=\"Decibels by chunk\">" + marks +
         DriftLine(chunks, &ChunkDrift::psnr, kTop_db, "all") + DriftLine(chunks, &ChunkDrift::psnr_moving, kTop_db, "moving") +
         DriftLine(chunks, &ChunkDrift::psnr_moving_copy, kTop_db, "still") +
         "<text x=\"300\" y=\"202\" text-anchor=\"middle\">chunks from the first to the last</text></svg>"
         "<p class=\"quiet\">dB. Blue: all pixels. Orange: pixels that move in reality. Dashed: those, had the first picture stood still.</p>";
}

/// Pairs of one kind of which it is so known, or not known, how they ended.
std::string Clips(const Fidelity& fidelity, const char* kind, std::optional<bool> truth, std::optional<bool> said) {
  std::string pairs;
  std::size_t shown = 0;
  for (const FidelityRow& row : fidelity.input.rows) {
    if (row.kind != kind || row.real != truth || row.model != said) continue;
    if (row.real_video.empty() || row.model_video.empty() || ++shown > kShown) continue;
    pairs += fmt::format("<figure><video src=\"{}\" controls muted preload=\"metadata\"></video><video src=\"{}\" controls muted "
                         "preload=\"metadata\"></video><figcaption>{}, {}, state {}: real above, imagined below</figcaption></figure>",
                         Link(row.real_video), Link(row.model_video), Escaped(row.pair.task),
                         Escaped(PolicyLabel(row.pair.policy, row.pair.checkpoint)), Escaped(row.pair.initial_state));
  }
  return pairs.empty() ? "<p class=\"quiet\">None.</p>" : "<div class=\"pairs\">" + pairs + "</div>";
}

std::string Headline(const Fidelity& fidelity) {
  const CorrelationGroup& correlation = fidelity.model.correlation;
  return fmt::format("<p>{} of a task and a policy. Pearson {}; MMRV within tasks, the mean over them, {} (reality against itself {}); agreement "
                     "{} (reality against itself {}). {} s per chunk. Judge {}: kappa with the truth {}, with the object painted over {}.</p>",
                     Counted(static_cast<std::int64_t>(fidelity.cells.size()), "cell"), WithInterval(correlation.pearson), Decimal(fidelity.mmrv, 3),
                     Decimal(fidelity.mmrv_again, 3), ShareWithInterval(fidelity.closed.agreement),
                     ShareWithInterval(fidelity.closed_again.agreement), Decimal(fidelity.input.seconds_per_chunk, 2),
                     fidelity.input.judge.name.empty() ? "nobody" : Escaped(fidelity.input.judge.name),
                     WithInterval(fidelity.input.judge.kappa), Decimal(fidelity.input.judge.kappa_masked, 2));
}

/// Outcomes, and how pictures drift apart.
std::string WholeBody(const Fidelity& fidelity) {
  std::string page = Section("outcomes", "Outcomes") + MatchTable(fidelity) + "</section>" + Rates(fidelity);
  if (!fidelity.input.open_loop.chunks.empty())
    page += Section("pictures", "Pictures, recorded actions replayed") + DriftChart(fidelity.input.open_loop.chunks) + "</section>";
  if (!fidelity.input.horizon.empty())
    page += Section("horizon", "Pictures, long rollouts") + DriftChart(fidelity.input.horizon) + "</section>";
  const auto clips = [&](const char* title, bool truth, bool said) {
    return "<h3>" + std::string(title) + "</h3>" + Clips(fidelity, "closed_loop", truth, said);
  };
  return page + Section("clips", "Clips") + clips("Hallucinated", false, true) + clips("Missed", true, false) +
         clips("Successes of both", true, true) + clips("Failures of both", false, false) + "</section>";
}

std::string ChunkTable(const std::vector<ChunkDrift>& chunks) {
  std::string rows;
  for (std::size_t i = 0; i < chunks.size(); ++i) {
    rows += fmt::format("<tr><th scope=\"row\">{}</th><td class=\"num\">{}</td>", i + 1, chunks[i].clips);
    for (const Number& number : {chunks[i].psnr, chunks[i].psnr_moving, chunks[i].psnr_moving_copy, chunks[i].gripper_px})
      rows += "<td class=\"num\">" + Decimal(number, 1) + "</td>";
    rows += "<td class=\"num\">" + Percent(chunks[i].gripper_found) + "</td></tr>";
  }
  return TableHead({"chunk", "clips", "dB", "dB of what moves", "had it stood still", "gripper off by, pixels", "gripper found"}) + rows +
         "</tbody></table></div>";
}

/// Pictures alone: recordings that nobody says the end of.
std::string RecordedBody(const Fidelity& fidelity) {
  const std::vector<ChunkDrift>& chunks = fidelity.input.open_loop.chunks;
  return Section("pictures", "Pictures") + DriftChart(chunks) + ChunkTable(chunks) + "</section>" + Section("clips", "Clips") +
         Clips(fidelity, "open_loop", std::nullopt, std::nullopt) + "</section>";
}

/// A line per part in which episodes failed.
std::string Failed(const Fidelity& fidelity) {
  std::string html;
  for (const std::string& sentence : FailedSentences(fidelity.input.parts)) html += "<p>" + Escaped(sentence) + "</p>";
  return html;
}

std::string RecordedHeadline(const Fidelity& fidelity) {
  const std::vector<FidelityRow>& rows = fidelity.input.rows;
  const auto replayed =
      std::ranges::count_if(rows, [](const FidelityRow& row) { return !row.real_video.empty() && !row.model_video.empty(); });
  std::string usable = "Nothing could be compared.";
  if (fidelity.usable_horizon_chunks) {
    usable = fmt::format("What moves is at least 2 dB better than a picture that stands still for {}.",
                         *fidelity.usable_horizon_chunks > 0 ? Counted(*fidelity.usable_horizon_chunks, "chunk")
                                                             : "not a single chunk");
  }
  return fmt::format("<p>{} of {} replayed, their actions given to the model from the first picture on. {} {} s per chunk.</p>"
                     "<p class=\"quiet\">Nobody says how recordings end: pictures are compared, not outcomes.</p>",
                     replayed, Counted(std::ssize(rows), "recording"), usable, Decimal(fidelity.input.seconds_per_chunk, 2));
}

}  // namespace

std::string FidelityPage(const Fidelity& fidelity) {
  const bool has_outcomes = !fidelity.cells.empty();
  return PageHead("Fidelity of the world model", PageScripts::kNone, kStyle) + "<body><header><h1>How true is the world model?</h1></header>\n<main>" +
         (has_outcomes ? Headline(fidelity) + Failed(fidelity) + WholeBody(fidelity)
                       : RecordedHeadline(fidelity) + Failed(fidelity) + RecordedBody(fidelity)) +
         fmt::format("<section id=\"provenance\"><h2>Made from</h2><p class=\"quiet\">suite {:.16}…, world model "
                     "{:.16}…</p></section></main></body></html>\n",
                     fidelity.input.suite_hash, fidelity.input.model_hash);
}

}  // namespace evac
