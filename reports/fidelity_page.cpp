#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "reports/fidelity.h"
#include "reports/html.h"
#include "reports/wording.h"

namespace evac {
namespace {

constexpr const char* kStyle = R"css(
:root{color-scheme:light dark;--ground:#fff;--ink:#1a1e23;--quiet:#59626d;--rule:#dcdfe4;--real:#0072b2;--model:#c44e00}
@media(prefers-color-scheme:dark){:root{--ground:#14171b;--ink:#e7e9ec;--quiet:#9aa4af;--rule:#333942;--real:#56b4e9;--model:#f08a4b}}
*{box-sizing:border-box}body{margin:0 auto;max-width:64rem;padding:2rem 1.2rem 4rem;background:var(--ground);color:var(--ink);
font:15px/1.5 system-ui,-apple-system,"Segoe UI",Roboto,Arial,sans-serif;font-variant-numeric:tabular-nums}
h1{font-size:1.6rem;margin:0}h2{font-size:1.15rem;margin:2.2rem 0 .5rem}p{margin:.4rem 0}.quiet{color:var(--quiet)}
.wide{overflow-x:auto}table{border-collapse:collapse;width:100%}th,td{padding:.25rem .6rem;text-align:right;border-bottom:1px solid var(--rule)}
th:first-child,td:first-child,td.name,th.name{text-align:left}th{font-weight:600;color:var(--quiet)}
svg{max-width:100%;height:auto;display:block}svg text{fill:var(--ink);font-size:11px}.axis{stroke:var(--rule);fill:none}
.real{stroke:var(--real);fill:none;stroke-width:2}.model{stroke:var(--model);fill:none;stroke-width:2}.model.dash{stroke-dasharray:5 4}
.dot{fill:var(--model);fill-opacity:.75}.pair{display:grid;grid-template-columns:1fr;gap:.2rem;margin:0 0 1rem}
.clips{display:grid;grid-template-columns:repeat(auto-fill,minmax(20rem,1fr));gap:1rem}video{width:100%;background:#000;display:block}
figure{margin:0}figcaption{color:var(--quiet);font-size:.9em}
)css";

constexpr std::size_t kShown = 6;  ///< pairs of clips of each sort

std::string Percent(const Number& number) {
  return number ? fmt::format("{:.0f} %", 100 * *number)
                : fmt::format("<span class=\"quiet\" title=\"{}\">–</span>", Escaped(number.reason()));
}
std::string Decimal(const Number& number, int digits) {
  return number ? fmt::format("{:.{}f}", *number, digits)
                : fmt::format("<span class=\"quiet\" title=\"{}\">–</span>", Escaped(number.reason()));
}
std::string WithInterval(const Estimate& estimate, double factor, int digits, const char* unit) {
  std::string text = estimate.value ? fmt::format("{:.{}f}{}", factor * *estimate.value, digits, unit)
                                    : Decimal(estimate.value, digits);
  if (estimate.value && estimate.interval)
    text += fmt::format(" <span class=\"quiet\">[{:.{}f}, {:.{}f}]</span>", factor * estimate.interval->low, digits,
                        factor * estimate.interval->high, digits);
  return text;
}

std::string MatchRow(const std::string& name, const OutcomeMatch& match) {
  return fmt::format("<tr><td>{}</td><td>{}</td><td>{}</td><td>{}</td><td>{}</td><td>{}</td></tr>", Escaped(name), match.n,
                     WithInterval(match.agreement, 100, 0, " %"), WithInterval(match.hallucinated, 100, 0, " %"),
                     WithInterval(match.missed, 100, 0, " %"), WithInterval(match.kappa, 1, 2, ""));
}

std::string MatchTable(const Fidelity& fidelity) {
  std::string rows = MatchRow("closed loop: the policies act in the world model", fidelity.closed) +
                     MatchRow("reality against reality, other noise", fidelity.closed_again);
  if (fidelity.open.n > 0) rows += MatchRow("open loop: recorded actions replayed", fidelity.open);
  for (const Fidelity::Counterfactual& one : fidelity.counterfactuals) rows += MatchRow(one.kind, one.match);
  return "<div class=\"wide\"><table><thead><tr><th>what was asked</th><th>pairs</th><th>agreement</th><th>hallucinated</th>"
         "<th>missed</th><th>kappa</th></tr></thead><tbody>" + rows + "</tbody></table></div>"
         "<p class=\"quiet\">Hallucinated: imagined success of what truly failed. Missed: imagined failure of what truly "
         "succeeded. Intervals: Wilson, 95 %.</p>";
}

std::string CellTable(const Fidelity& fidelity) {
  std::string rows;
  for (const FidelityCell& cell : fidelity.cells)
    rows += fmt::format("<tr><td>{}</td><td class=\"name\">{}</td><td>{}</td><td>{}</td><td>{}</td><td>{}</td><td>{}</td></tr>",
                        Escaped(cell.task), Escaped(PolicyLabel(cell.policy, cell.checkpoint)), cell.n, Percent(cell.real),
                        Percent(cell.again), Percent(cell.model), Percent(cell.agreement));
  return "<div class=\"wide\"><table><thead><tr><th>task</th><th class=\"name\">policy</th><th>pairs</th><th>real</th><th>real "
         "again</th><th>imagined</th><th>agreement</th></tr></thead><tbody>" + rows + "</tbody></table></div>";
}

std::string Scatter(const Fidelity& fidelity) {
  const auto at = [](double rate) { return 40 + 260 * rate; };
  std::string dots;
  for (const FidelityCell& cell : fidelity.cells) {
    if (!cell.real || !cell.model) continue;
    dots += fmt::format("<circle class=\"dot\" cx=\"{:.1f}\" cy=\"{:.1f}\" r=\"5\"><title>{} {}: real {:.0f} %, imagined {:.0f} %</title></circle>",
                        at(*cell.real), 340 - at(*cell.model), Escaped(cell.task),
                        Escaped(PolicyLabel(cell.policy, cell.checkpoint)), 100 * *cell.real, 100 * *cell.model);
  }
  if (dots.empty()) return "<p class=\"quiet\">No cell has a rate in both worlds.</p>";
  return "<svg viewBox=\"0 0 340 340\" width=\"340\" role=\"img\" aria-label=\"Imagined success rate against the real one\">"
         "<rect class=\"axis\" x=\"40\" y=\"40\" width=\"260\" height=\"260\"/><line class=\"axis\" x1=\"40\" y1=\"300\" x2=\"300\" y2=\"40\"/>" +
         dots + "<text x=\"170\" y=\"330\" text-anchor=\"middle\">real success rate, 0 to 100 %</text>"
         "<text x=\"20\" y=\"170\" text-anchor=\"middle\" transform=\"rotate(-90 20 170)\">imagined</text></svg>";
}

/// One line of a chart: broken where the number is undefined.
std::string Line(const std::vector<ChunkDrift>& chunks, Number ChunkDrift::*what, double top, const char* classes) {
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
  return "<svg viewBox=\"0 0 600 210\" width=\"600\" role=\"img\" aria-label=\"Decibels by chunk\">" + marks +
         Line(chunks, &ChunkDrift::psnr, kTop_db, "real") + Line(chunks, &ChunkDrift::psnr_moving, kTop_db, "model") +
         Line(chunks, &ChunkDrift::psnr_moving_copy, kTop_db, "model dash") +
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
    pairs += fmt::format("<figure class=\"pair\"><video src=\"{}\" controls muted preload=\"metadata\"></video><video src=\"{}\" controls muted "
                         "preload=\"metadata\"></video><figcaption>{}, {}, state {}: real above, imagined below</figcaption></figure>",
                         Link(row.real_video), Link(row.model_video), Escaped(row.pair.task),
                         Escaped(PolicyLabel(row.pair.policy, row.pair.checkpoint)), Escaped(row.pair.initial_state));
  }
  return pairs.empty() ? "<p class=\"quiet\">None.</p>" : "<div class=\"clips\">" + pairs + "</div>";
}

std::string Headline(const Fidelity& fidelity) {
  const CorrelationGroup& correlation = fidelity.model.correlation;
  return fmt::format("<p>{} of a task and a policy. Pearson {}; MMRV {} (reality against itself {}); agreement {} (reality "
                     "against itself {}). {} s per chunk. Judge {}: kappa with the truth {}, with the object painted over {}.</p>",
                     Counted(static_cast<std::int64_t>(fidelity.cells.size()), "cell"), WithInterval(correlation.pearson, 1, 2, ""), Decimal(fidelity.mmrv, 3),
                     Decimal(fidelity.mmrv_again, 3), WithInterval(fidelity.closed.agreement, 100, 0, " %"),
                     WithInterval(fidelity.closed_again.agreement, 100, 0, " %"), Decimal(fidelity.input.seconds_per_chunk, 2),
                     fidelity.input.judge.name.empty() ? "nobody" : Escaped(fidelity.input.judge.name),
                     WithInterval(fidelity.input.judge.kappa, 1, 2, ""), Decimal(fidelity.input.judge.kappa_masked, 2));
}

/// Outcomes, and how pictures drift apart.
std::string WholeBody(const Fidelity& fidelity) {
  std::string page = "<h1>How true is the world model?</h1>" + Headline(fidelity);
  page += "<h2>Outcomes</h2>" + MatchTable(fidelity) + "<h2>Rates</h2>" + Scatter(fidelity) + CellTable(fidelity);
  if (!fidelity.input.open_loop.chunks.empty())
    page += "<h2>Pictures, recorded actions replayed</h2>" + DriftChart(fidelity.input.open_loop.chunks);
  if (!fidelity.input.horizon.empty()) page += "<h2>Pictures, long rollouts</h2>" + DriftChart(fidelity.input.horizon);
  const auto clips = [&](bool truth, bool said) { return Clips(fidelity, "closed_loop", truth, said); };
  return page + "<h2>Successes of both</h2>" + clips(true, true) + "<h2>Failures of both</h2>" + clips(false, false) +
         "<h2>Hallucinated</h2>" + clips(false, true) + "<h2>Missed</h2>" + clips(true, false);
}

std::string ChunkTable(const std::vector<ChunkDrift>& chunks) {
  std::string rows;
  for (std::size_t i = 0; i < chunks.size(); ++i)
    rows += fmt::format("<tr><td>{}</td><td>{}</td><td>{}</td><td>{}</td><td>{}</td><td>{}</td></tr>", i + 1, chunks[i].clips,
                        Decimal(chunks[i].psnr, 1), Decimal(chunks[i].psnr_moving, 1), Decimal(chunks[i].psnr_moving_copy, 1),
                        Decimal(chunks[i].gripper_px, 1));
  return "<div class=\"wide\"><table><thead><tr><th>chunk</th><th>clips</th><th>dB</th><th>dB of what moves</th><th>had it stood "
         "still</th><th>gripper off by, pixels</th></tr></thead><tbody>" + rows + "</tbody></table></div>";
}

/// Pictures alone: recordings that nobody says the end of.
std::string RecordedBody(const Fidelity& fidelity) {
  const std::vector<ChunkDrift>& chunks = fidelity.input.open_loop.chunks;
  const std::string usable = fidelity.usable_horizon_chunks
                                 ? Counted(*fidelity.usable_horizon_chunks, "chunk")
                                 : "not a single chunk";
  return fmt::format("<h1>How true is the world model to recordings?</h1><p>{} replayed, their actions given to the model from "
                     "the first picture on. What moves is at least 2 dB better than a picture that stands still for {}. {} s "
                     "per chunk.</p><p class=\"quiet\">Nobody says how recordings end: pictures are compared, not outcomes.</p>",
                     Counted(static_cast<std::int64_t>(fidelity.input.rows.size()), "recording"), usable,
                     Decimal(fidelity.input.seconds_per_chunk, 2)) +
         "<h2>Pictures</h2>" + DriftChart(chunks) + ChunkTable(chunks) + "<h2>Clips</h2>" +
         Clips(fidelity, "open_loop", std::nullopt, std::nullopt);
}

}  // namespace

std::string FidelityPage(const Fidelity& fidelity) {
  std::string page = "<!doctype html><html lang=\"en\"><head><meta charset=\"utf-8\"><meta name=\"viewport\" "
                     "content=\"width=device-width,initial-scale=1\"><title>Fidelity of the world model</title><style>";
  page += kStyle;
  page += "</style></head><body>" + (fidelity.cells.empty() ? RecordedBody(fidelity) : WholeBody(fidelity));
  page += fmt::format("<h2>Made from</h2><p class=\"quiet\">suite {:.16}…, world model {:.16}…</p></body></html>\n",
                      fidelity.input.suite_hash, fidelity.input.model_hash);
  return page;
}

}  // namespace evac
