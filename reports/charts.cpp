#include "reports/charts.h"

#include <fmt/format.h>

#include <array>
#include <cmath>
#include <limits>

#include "reports/html.h"
#include "reports/wording.h"

namespace evac {
namespace {

constexpr std::array<const char*, 8> kShapes = {
    "M-5 0a5 5 0 1 0 10 0a5 5 0 1 0-10 0z",                         // circle
    "M-4.5-4.5h9v9h-9z",                                            // square
    "M0-5.8L5.6 4.2H-5.6z",                                         // triangle
    "M0-6.2L6.2 0L0 6.2L-6.2 0z",                                   // diamond
    "M0 5.8L5.6-4.2H-5.6z",                                         // inverted triangle
    "M-1.8-5.5h3.6v3.7h3.7v3.6h-3.7v3.7h-3.6v-3.7h-3.7v-3.6h3.7z",  // plus
    "M-5.2-2.7L-2.7-5.2L0-2.5L2.7-5.2L5.2-2.7L2.5 0L5.2 2.7L2.7 5.2L0 2.5L-2.7 5.2L-5.2 2.7L-2.5 0z",  // cross
    "M-5.6 0L-2.8-4.9H2.8L5.6 0L2.8 4.9H-2.8z",                                                        // hexagon
};

// The scatter's square, in its own units.
constexpr double kLeft = 50, kTop = 14, kSide = 336, kBottom = kTop + kSide;
constexpr double kWidth = kLeft + kSide + 14, kHeight = kBottom + 46;

struct Place {
  double x = 0, y = 0;
};

double X(double share) { return kLeft + kSide * share; }
double Y(double share) { return kBottom - kSide * share; }
Place At(const ComparedPoint& point) { return {X(*point.real.value), Y(*point.other.value)}; }
double Distance(const Place& a, const Place& b) { return std::hypot(a.x - b.x, a.y - b.y); }

std::string StyleClasses(const PointStyle& style) {
  return fmt::format("mark p{} t{}", style.policy % 8, style.task % 4);
}

double DistanceToSegment(const Place& p, double low, double high, double across, bool horizontal) {
  const double along = horizontal ? p.x : p.y, side = horizontal ? p.y : p.x;
  const double beyond = std::max({low - along, along - high, 0.0});
  return std::hypot(beyond, side - across);
}

/// How crowded a label would be at `label`: marks, intervals and the labels placed before it push it away.
double Crowding(const Place& label, const WorldComparison& comparison, const std::vector<Place>& labels) {
  double crowding = 0;
  const auto push = [&crowding](double distance, double reach, double weight) {
    if (distance < reach) crowding += weight * (reach - distance) / reach;
  };
  for (const ComparedPoint& point : comparison.points) {
    const Place mark = At(point);
    push(Distance(label, mark), 13, 4);
    if (point.real.interval)
      push(DistanceToSegment(label, X(point.real.interval->low), X(point.real.interval->high), mark.y, true), 8, 1);
    if (point.other.interval)
      push(DistanceToSegment(label, Y(point.other.interval->high), Y(point.other.interval->low), mark.x, false), 8, 1);
  }
  for (const Place& other : labels) push(Distance(label, other), 15, 6);
  const double edge = std::min({label.x - kLeft, kLeft + kSide - label.x, label.y - kTop, kBottom - label.y});
  push(edge, 8, 5);
  return crowding;
}

/// Where each point's letter stands: the least crowded of places around it.
std::vector<Place> PlaceLabels(const WorldComparison& comparison) {
  std::vector<Place> labels;
  for (const ComparedPoint& point : comparison.points) {
    const Place mark = At(point);
    Place best = mark;
    double least = std::numeric_limits<double>::infinity();
    for (const double radius : {13.0, 18.0, 25.0}) {
      for (int k = 0; k < 16; ++k) {
        const double angle = (k + 0.5) * 3.14159265358979 / 8;
        const Place place{mark.x + radius * std::cos(angle), mark.y - radius * std::sin(angle)};
        const double crowding = Crowding(place, comparison, labels) + 0.03 * radius;
        if (crowding < least) {
          least = crowding;
          best = place;
        }
      }
    }
    labels.push_back(best);
  }
  return labels;
}

std::string Axes(const WorldComparison& comparison) {
  std::string svg =
      fmt::format("<rect class=\"frame\" x=\"{}\" y=\"{}\" width=\"{}\" height=\"{}\"/>", kLeft, kTop, kSide, kSide);
  for (const int tick : {0, 25, 50, 75, 100}) {
    const double x = X(tick / 100.0), y = Y(tick / 100.0);
    if (tick > 0 && tick < 100) {
      svg += fmt::format("<path class=\"grid\" d=\"M{} {}V{}M{} {}H{}\"/>", x, kTop, kBottom, kLeft, y, kLeft + kSide);
    }
    svg += fmt::format("<text x=\"{}\" y=\"{}\" text-anchor=\"middle\">{}</text>", x, kBottom + 17, tick);
    svg += fmt::format("<text x=\"{}\" y=\"{}\" text-anchor=\"end\">{}</text>", kLeft - 7, y + 4.5, tick);
  }
  svg += fmt::format("<path class=\"identity\" d=\"M{} {}L{} {}\"/>", X(0), Y(0), X(1), Y(1));
  svg += fmt::format("<text class=\"axis\" x=\"{}\" y=\"{}\" text-anchor=\"middle\">success in {}, %</text>",
                     kLeft + kSide / 2, kBottom + 38, Escaped(comparison.real));
  svg += fmt::format(
      "<text class=\"axis\" transform=\"translate(14 {}) rotate(-90)\" text-anchor=\"middle\">success in {}, %</text>",
      kTop + kSide / 2, Escaped(comparison.other));
  return svg;
}

std::string Whiskers(const ComparedPoint& point, const PointStyle& style) {
  const Place mark = At(point);
  std::string path;
  if (point.real.interval)
    path += fmt::format("M{:.1f} {:.1f}H{:.1f}", X(point.real.interval->low), mark.y, X(point.real.interval->high));
  if (point.other.interval)
    path += fmt::format("M{:.1f} {:.1f}V{:.1f}", mark.x, Y(point.other.interval->low), Y(point.other.interval->high));
  return fmt::format("<path class=\"whisker p{}\" d=\"{}\"/>", style.policy % 8, path);
}

std::string ScatterInWords(const WorldComparison& comparison) {
  std::string words = fmt::format("Success in {} against success in {}, one point per task and policy.",
                                  comparison.other, comparison.real);
  for (const ComparedPoint& point : comparison.points) {
    const auto rate = [](const Estimate& of) {
      return of.value && !of.interval ? Percent(*of.value) : PercentWithInterval(of);
    };
    words += fmt::format(" {}: {}, {}: {} {}, {} {}.", point.letter, point.task, point.policy, comparison.real,
                         rate(point.real), comparison.other, rate(point.other));
  }
  return words;
}

}  // namespace

std::string Marker(std::size_t shape, const std::string& classes) {
  return fmt::format("<path class=\"{}\" d=\"{}\"/>", classes, kShapes[shape % kShapes.size()]);
}

std::string MarkerIcon(std::size_t shape, const std::string& classes) {
  return "<svg class=\"icon\" viewBox=\"-8 -8 16 16\" width=\"16\" height=\"16\" aria-hidden=\"true\">" +
         Marker(shape, classes) + "</svg>";
}

std::string PointIcon(const PointStyle& style) { return MarkerIcon(style.policy, StyleClasses(style)); }

std::string RateStrip(const Estimate& rate, std::size_t world) {
  std::string svg = fmt::format("<svg class=\"strip\" role=\"img\" aria-label=\"{}\" height=\"24\">",
                                Escaped(PercentWithInterval(rate)));
  for (const int tick : {0, 25, 50, 75, 100})
    svg += fmt::format("<line class=\"grid\" x1=\"{0}%\" x2=\"{0}%\" y1=\"0\" y2=\"24\"/>", tick);
  if (rate.value && rate.interval) {
    const double low = 100 * rate.interval->low, high = 100 * rate.interval->high;
    svg += fmt::format("<g class=\"w{}\">", world % 4);
    svg += fmt::format("<line class=\"range\" x1=\"{:.2f}%\" x2=\"{:.2f}%\" y1=\"12\" y2=\"12\"/>", low, high);
    for (const double end : {low, high})
      svg += fmt::format("<line class=\"range\" x1=\"{0:.2f}%\" x2=\"{0:.2f}%\" y1=\"8\" y2=\"16\"/>", end);
    svg += fmt::format("<svg x=\"{:.2f}%\" y=\"12\" overflow=\"visible\">{}</svg></g>", 100 * *rate.value,
                       Marker(WorldShape(world), "dot"));
  }
  return svg + "</svg>";
}

std::string RateScale() {
  std::string svg = "<svg class=\"strip scale\" aria-hidden=\"true\" height=\"18\">";
  for (const int tick : {0, 50, 100}) {
    svg += fmt::format("<text x=\"{0}%\" y=\"13\" text-anchor=\"middle\">{0}</text>", tick);
  }
  return svg + "</svg>";
}

Drawing ScatterDrawing(const WorldComparison& comparison, const std::vector<PointStyle>& styles) {
  Drawing drawing{kWidth, kHeight, Axes(comparison), ScatterInWords(comparison)};
  std::string& svg = drawing.body;
  for (std::size_t i = 0; i < comparison.points.size(); ++i) svg += Whiskers(comparison.points[i], styles.at(i));
  const std::vector<Place> labels = PlaceLabels(comparison);
  for (std::size_t i = 0; i < comparison.points.size(); ++i) {
    const Place mark = At(comparison.points[i]);
    svg += fmt::format("<g transform=\"translate({:.1f} {:.1f})\">{}</g>", mark.x, mark.y,
                       Marker(styles.at(i).policy, StyleClasses(styles.at(i))));
  }
  for (std::size_t i = 0; i < comparison.points.size(); ++i) {
    svg += fmt::format("<text class=\"letter\" x=\"{:.1f}\" y=\"{:.1f}\" text-anchor=\"middle\">{}</text>", labels[i].x,
                       labels[i].y + 4.5, comparison.points[i].letter);
  }
  return drawing;
}

std::string Scatter(const WorldComparison& comparison, const std::vector<PointStyle>& styles) {
  return InPage(ScatterDrawing(comparison, styles), "scatter");
}

}  // namespace evac
