#include <fmt/format.h>

#include <algorithm>

#include "reports/charts.h"
#include "reports/html.h"
#include "reports/wording.h"

namespace evac {
namespace {

constexpr double kWidth = 340, kHeight = 190, kLeft = 34, kRight = 8, kTop = 10, kBottom = 160;

double Y(double share) { return kBottom - (kBottom - kTop) * share; }

std::string Scale() {
  std::string svg;
  for (const int tick : {0, 50, 100}) {
    svg += fmt::format("<path class=\"grid\" d=\"M{} {:g}H{:g}\"/>", kLeft, Y(tick / 100.0), kWidth - kRight);
    svg +=
        fmt::format("<text x=\"{:g}\" y=\"{:g}\" text-anchor=\"end\">{}</text>", kLeft - 6, Y(tick / 100.0) + 4, tick);
  }
  return svg;
}

/// Dots with their intervals, joined by a thin line: whole for the real world, dashed for the others.
std::string Series(const std::vector<Estimate>& rates, const std::vector<double>& places, std::size_t world) {
  std::string line, whiskers, dots;
  for (std::size_t i = 0; i < rates.size(); ++i) {
    if (!rates[i].value || !rates[i].interval) continue;
    const double x = places[i], y = Y(*rates[i].value);
    line += fmt::format("{}{:.1f} {:.1f}", line.empty() ? "M" : "L", x, y);
    const double low = Y(rates[i].interval->low), high = Y(rates[i].interval->high);
    whiskers +=
        fmt::format("M{:.1f} {:.1f}V{:.1f}M{:.1f} {:.1f}h6M{:.1f} {:.1f}h6", x, low, high, x - 3, low, x - 3, high);
    dots += fmt::format("<g transform=\"translate({:.1f} {:.1f})\">{}</g>", x, y, Marker(WorldShape(world), "dot"));
  }
  return fmt::format("<g class=\"w{}\"><path class=\"trend\" d=\"{}\"/><path class=\"range\" d=\"{}\"/>{}</g>",
                     world % 4, line, whiskers, dots);
}

/// Places of one series: columns side by side, series a little apart so that no interval hides another.
std::vector<double> Places(std::size_t columns, std::size_t series, std::size_t of) {
  const double step = (kWidth - kLeft - kRight) / static_cast<double>(columns);
  const double shift = (static_cast<double>(series) - (static_cast<double>(of) - 1) / 2) * std::min(12.0, step / 4);
  std::vector<double> places;
  for (std::size_t i = 0; i < columns; ++i) places.push_back(kLeft + step * (static_cast<double>(i) + 0.5) + shift);
  return places;
}

/// Letters that fit between one named column and the next; names of neighbours stand on two lines.
std::size_t Room(std::size_t every, std::size_t columns) { return 300 * every / (7 * columns); }

/// 1, or where too little would be left of a name: 2, 3, … so that every second column, third, … has its whole name.
std::size_t NamedEvery(const std::vector<std::string>& names) {
  constexpr std::size_t kLegible = 5;
  std::size_t longest = 0, every = 1;
  for (const std::string& name : names) longest = std::max(longest, name.size());
  if (2 * Room(1, names.size()) >= std::min(longest, kLegible)) return 1;
  while (every < names.size() && 2 * Room(every, names.size()) < longest) ++every;
  return every;
}

std::string ColumnNames(const std::vector<std::string>& names) {
  if (names.empty()) return "";
  const std::vector<double> places = Places(names.size(), 0, 1);
  const std::size_t every = NamedEvery(names), room = Room(every, names.size());
  std::string svg;
  for (std::size_t i = 0; i < names.size(); i += every) {
    const bool lower = names.size() > 1 && (i / every) % 2 == 1 && names[i].size() > room;
    svg += fmt::format("<text x=\"{:.1f}\" y=\"{:g}\" text-anchor=\"middle\">{}</text>", places[i],
                       kBottom + (lower ? 28 : 16), Escaped(Shortened(names[i], 2 * room)));
  }
  return svg;
}

}  // namespace

WorldMarks MarksOf(const std::string& real, const std::vector<std::string>& worlds) {
  WorldMarks marks{{real, 0}};
  for (const std::string& world : worlds) marks.emplace(world, marks.size());
  return marks;
}

WorldMarks MarksOf(const RunSummary& summary) {
  std::vector<std::string> worlds;
  for (const WorldInfo& world : summary.data.worlds) worlds.push_back(world.name);
  return MarksOf(summary.reference, worlds);
}

std::size_t WorldShape(std::size_t world) { return world == 0 ? 0 : 3 + (world - 1) % 5; }

std::string WorldSign(std::size_t world) {
  static constexpr const char* kOthers[] = {"◇", "▽", "✚", "✖", "⬡"};
  return world == 0 ? "●" : kOthers[(world - 1) % 5];
}

Drawing StageDrawing(const StageFunnel& funnel, const WorldMarks& marks) {
  Drawing drawing{kWidth, kHeight, Scale() + ColumnNames(funnel.stages), ""};
  drawing.words = fmt::format("Share of episodes of {} on {} that reached each stage.", funnel.policy, funnel.task);
  for (std::size_t i = 0; i < funnel.worlds.size(); ++i) {
    drawing.body += Series(funnel.worlds[i].reached, Places(funnel.stages.size(), i, funnel.worlds.size()),
                           marks.at(funnel.worlds[i].world));
    drawing.words += " " + funnel.worlds[i].world + ":";
    for (std::size_t stage = 0; stage < funnel.stages.size(); ++stage) {
      drawing.words +=
          fmt::format(" {} {}{}", funnel.stages[stage], PercentWithInterval(funnel.worlds[i].reached[stage]),
                      stage + 1 == funnel.stages.size() ? "." : ",");
    }
  }
  return drawing;
}

Drawing CheckpointDrawing(const CheckpointCurve& curve, const WorldMarks& marks) {
  std::vector<std::string> names;
  for (const CheckpointPoint& point : curve.points) names.push_back(point.checkpoint);
  Drawing drawing{kWidth, kHeight, Scale() + ColumnNames(names), ""};
  drawing.words = fmt::format("Success rate of {} on {} by checkpoint.", curve.policy, curve.task);
  for (std::size_t world = 0; world < curve.worlds.size(); ++world) {
    std::vector<Estimate> rates;
    drawing.words += " " + curve.worlds[world] + ":";
    for (const CheckpointPoint& point : curve.points) {
      rates.push_back(point.rate[world]);
      drawing.words += fmt::format(" {} {}{}", point.checkpoint, PercentWithInterval(point.rate[world]),
                                   &point == &curve.points.back() ? "." : ",");
    }
    drawing.body += Series(rates, Places(names.size(), world, curve.worlds.size()), marks.at(curve.worlds[world]));
  }
  return drawing;
}

}  // namespace evac
