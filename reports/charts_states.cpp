#include <fmt/format.h>

#include <algorithm>
#include <span>

#include "reports/charts.h"
#include "reports/html.h"
#include "reports/wording.h"

namespace evac {
namespace {

// One cell: 14 wide, two halves of 12; a bar below marks a flip.
constexpr double kStep = 16, kRow = 36;
constexpr std::size_t kTen = 10, kTensInARow = 3;

struct Paths {
  std::string filled, apart, flips;
};

void AddHalf(Outcome outcome, double x, double y, Paths& paths) {
  if (outcome == Outcome::kSuccess) paths.filled += fmt::format("M{:g} {:g}h12", x, y);
  if (outcome != Outcome::kSuccess && outcome != Outcome::kFailure)
    paths.apart += fmt::format("M{:g} {:g}l12-8", x, y + 4);
}

Paths PathsOf(std::span<const StateOutcomes> states) {
  Paths paths;
  for (std::size_t i = 0; i < states.size(); ++i) {
    const double x = kStep * static_cast<double>(i) + 2;
    AddHalf(states[i].real, x, 7, paths);
    AddHalf(states[i].other, x, 19, paths);
    if (states[i].IsFlip()) paths.flips += fmt::format("M{:g} 30h12", x);
  }
  return paths;
}

std::string PathOf(const char* name, const std::string& d) {
  return d.empty() ? "" : fmt::format("<path class=\"{}\" d=\"{}\"/>", name, d);
}

std::string Frames(std::size_t count) {
  std::string d;
  for (std::size_t i = 0; i < count; ++i)
    d += fmt::format("M{:g} 1h14v24h-14zm0 12h14", kStep * static_cast<double>(i) + 1);
  return d;
}

std::string Cells(std::span<const StateOutcomes> states) {
  const Paths paths = PathsOf(states);
  return PathOf("s-yes", paths.filled) + PathOf("s-out", paths.apart) + PathOf("s-flip", paths.flips);
}

std::span<const StateOutcomes> Ten(const std::vector<StateOutcomes>& states, std::size_t first) {
  return std::span(states).subspan(first, std::min(kTen, states.size() - first));
}

}  // namespace

std::string StateStripFrames() {
  std::string svg = "<svg class=\"sr\" aria-hidden=\"true\"><defs>";
  for (std::size_t count = 1; count <= kTen; ++count)
    svg += fmt::format("<path id=\"t{}\" class=\"s-frame\" d=\"{}\"/>", count, Frames(count));
  return svg + "</defs></svg>";
}

std::string StateStrip(const std::vector<StateOutcomes>& states) {
  std::string html;
  for (std::size_t first = 0; first < states.size(); first += kTen) {
    const std::span<const StateOutcomes> ten = Ten(states, first);
    html += fmt::format(
        "<svg{}><use href=\"#t{}\"/>{}</svg>",
        ten.size() == kTen ? "" : fmt::format(" style=\"width:{}px\"", kStep * static_cast<double>(ten.size())),
        ten.size(), Cells(ten));
  }
  return html;
}

Drawing StatesDrawing(const std::vector<StateOutcomes>& states, const std::string& words) {
  const std::size_t tens = (states.size() + kTen - 1) / kTen, rows = (tens + kTensInARow - 1) / kTensInARow;
  Drawing drawing{kTensInARow * (kTen * kStep + 10), kRow * static_cast<double>(rows), "", words};
  for (std::size_t i = 0; i < tens; ++i) {
    const std::span<const StateOutcomes> ten = Ten(states, i * kTen);
    drawing.body += fmt::format("<g transform=\"translate({:g} {:g})\"><path class=\"s-frame\" d=\"{}\"/>{}</g>",
                                static_cast<double>(i % kTensInARow) * (kTen * kStep + 10),
                                static_cast<double>(i / kTensInARow) * kRow, Frames(ten.size()), Cells(ten));
  }
  return drawing;
}

}  // namespace evac
