#include <fmt/format.h>

#include <algorithm>

#include "reports/charts.h"
#include "reports/html.h"
#include "reports/wording.h"

namespace evac {
namespace {

constexpr double kNames = 210, kPlot = 330, kNumbers = 200, kRow = 22, kHead = 24;

/// A straight map from [low, high] to the plot.
struct Axis {
  double low = 0, high = 1;
  bool Holds(double value) const { return low <= value && value <= high; }
  double X(double value) const { return kNames + kPlot * (std::clamp(value, low, high) - low) / (high - low); }
};

/// How a bar's end is drawn, from where it is: a cap; where the axis ends before the bar does, an arrow's head.
const char* EndOf(double value, const Axis& axis) {
  if (value < axis.low) return "m5-4l-5 4l5 4";
  return value > axis.high ? "m-5-4l5 4l-5 4" : "m0-4v8";
}

std::string Ticks(const RowChart& chart, const Axis& axis, double bottom) {
  std::string svg;
  for (const double tick : chart.ticks) {
    svg += fmt::format("<path class=\"grid\" d=\"M{:.1f} {:g}V{:g}\"/>", axis.X(tick), kHead, bottom);
    svg += fmt::format("<text x=\"{:.1f}\" y=\"{:g}\" text-anchor=\"middle\">{}{:g}</text>", axis.X(tick), kHead - 8,
                       chart.low < 0 && tick > 0 ? "+" : "", 100 * tick);
  }
  if (chart.zone) {
    svg += fmt::format("<rect class=\"zone\" x=\"{:.1f}\" y=\"{:g}\" width=\"{:.1f}\" height=\"{:g}\"/>",
                       axis.X(-*chart.zone), kHead, axis.X(*chart.zone) - axis.X(-*chart.zone), bottom - kHead);
  }
  return svg;
}

std::string RowOf(const RowChart::Row& row, const Axis& axis, double y) {
  std::string svg = fmt::format("<text class=\"{}\" x=\"{}\" y=\"{:.1f}\">{}</text>", row.is_group ? "group" : "",
                                row.is_group ? 0 : 14, y + 4, Escaped(Shortened(row.name, 34)));
  if (row.is_group) return svg;
  svg += fmt::format("<text x=\"{:g}\" y=\"{:.1f}\">{}</text>", kNames + kPlot + 14, y + 4, Escaped(row.numbers));
  if (!row.estimate.value || !row.estimate.interval) return svg;
  const auto [low, high] = *row.estimate.interval;
  svg += fmt::format("<g class=\"w{0}\"><path class=\"range\" d=\"M{1:.1f} {2:.1f}H{3:.1f}M{1:.1f} {2:.1f}{4}M{3:.1f} "
                     "{2:.1f}{5}\"/>",
                     row.world % 4, axis.X(low), y, axis.X(high), EndOf(low, axis), EndOf(high, axis));
  if (axis.Holds(*row.estimate.value))
    svg += fmt::format("<g transform=\"translate({:.1f} {:.1f})\">{}</g>", axis.X(*row.estimate.value), y,
                       Marker(WorldShape(row.world), "dot"));
  return svg + "</g>";
}

}  // namespace

Drawing RowsDrawing(const RowChart& chart) {
  const double bottom = kHead + kRow * static_cast<double>(chart.rows.size());
  const Axis axis{chart.low, chart.high};
  Drawing drawing{kNames + kPlot + kNumbers, bottom + 8, Ticks(chart, axis, bottom), chart.words};
  double y = kHead + kRow / 2;
  for (const RowChart::Row& row : chart.rows) {
    drawing.body += RowOf(row, axis, y);
    drawing.words += fmt::format(" {}{}", row.name, row.is_group ? ":" : " " + row.numbers + ".");
    y += kRow;
  }
  return drawing;
}

std::string BiasStrip(const Estimate& bias, double margin, std::size_t world) {
  constexpr Axis kAxis{-0.5, 0.5};
  const auto place = [&](double share) { return 50 + 100 * std::clamp(share, kAxis.low, kAxis.high); };
  std::string svg = fmt::format("<svg class=\"strip\" role=\"img\" aria-label=\"{}\" height=\"24\">",
                                Escaped("bias " + PointsWithInterval(bias)));
  svg += fmt::format("<rect class=\"zone\" x=\"{:.2f}%\" width=\"{:.2f}%\" y=\"0\" height=\"24\"/>", place(-margin),
                     place(margin) - place(-margin));
  for (const int tick : {0, 50, 100})
    svg += fmt::format("<line class=\"grid\" x1=\"{0}%\" x2=\"{0}%\" y1=\"0\" y2=\"24\"/>", tick);
  if (bias.value && bias.interval) {
    const auto [low, high] = *bias.interval;
    const auto at = [&](double share, const std::string& shape) {
      return fmt::format("<svg x=\"{:.2f}%\" y=\"12\" overflow=\"visible\">{}</svg>", place(share), shape);
    };
    svg += fmt::format("<g class=\"w{}\"><line class=\"range\" x1=\"{:.2f}%\" x2=\"{:.2f}%\" y1=\"12\" y2=\"12\"/>",
                       world % 4, place(low), place(high));
    for (const double end : {low, high})
      svg += at(end, fmt::format("<path class=\"range\" d=\"M0 0{}\"/>", EndOf(end, kAxis)));
    if (kAxis.Holds(*bias.value)) svg += at(*bias.value, Marker(WorldShape(world), "dot"));
    svg += "</g>";
  }
  return svg + "</svg>";
}

std::string BiasScale() {
  std::string svg = "<svg class=\"strip scale\" aria-hidden=\"true\" height=\"18\">";
  for (const int tick : {-50, 0, 50})
    svg += fmt::format("<text x=\"{}%\" y=\"13\" text-anchor=\"middle\">{}{}</text>", tick + 50, tick > 0 ? "+" : "",
                       tick);
  return svg + "</svg>";
}

std::string Shortened(const std::string& text, std::size_t letters) {
  std::size_t seen = 0, at = 0;
  for (; at < text.size(); ++at) {
    const bool begins = (static_cast<unsigned char>(text[at]) & 0xC0) != 0x80;
    if (begins && ++seen > letters) break;
  }
  return at >= text.size() ? text : text.substr(0, at) + "…";
}

}  // namespace evac
