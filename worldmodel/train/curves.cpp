#include "worldmodel/train/curves.h"

#include <algorithm>
#include <cerrno>
#include <cmath>
#include <cstdarg>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <fstream>
#include <limits>
#include <system_error>
#include <vector>

#include "core/tensor_file.h"

namespace evac::train {
namespace {

constexpr double kLeft = 70, kRight = 780, kPanel = 170;
constexpr std::size_t kParts = 240;  // of the steps, each a point of the line

struct Row {
  double step = 0, value = 0;
};
using Rows = std::vector<Row>;

/// The first two columns.
Rows Read(const std::filesystem::path& path) {
  Rows rows;
  std::ifstream file(path);
  std::string line;
  std::getline(file, line);  // the header
  while (std::getline(file, line)) {
    char* end = nullptr;
    const double step = std::strtod(line.c_str(), &end);
    if (*end != ',') continue;
    const char* second = end + 1;
    const double value = std::strtod(second, &end);
    if (end != second && std::isfinite(step) && step >= 0 && std::isfinite(value)) rows.push_back({step, value});
  }
  return rows;
}

__attribute__((format(printf, 1, 2))) std::string Text(const char* format, ...) {
  char text[512];
  va_list arguments;
  va_start(arguments, format);
  std::vsnprintf(text, sizeof text, format, arguments);
  va_end(arguments);
  return text;
}

/// Where numbers lie in a panel.
struct Panel {
  double top = 0, low = 0, high = 1, last_step = 1;
  bool is_logarithmic = false;

  Panel(double top_px, const Rows& rows, double last) : top(top_px), last_step(std::max(last, 1.0)) {
    low = std::numeric_limits<double>::infinity();
    high = -low;
    for (const Row& row : rows) {
      low = std::min(low, row.value);
      high = std::max(high, row.value);
    }
    is_logarithmic = low > 0;
    if (!(high > low)) high = low + std::max(std::abs(low) * 0.1, 1e-9);
  }
  double Scaled(double value) const { return is_logarithmic ? std::log10(value) : value; }
  double X(double step) const { return kLeft + (kRight - kLeft) * step / last_step; }
  double Y(double value) const {
    const double part = (Scaled(value) - Scaled(low)) / (Scaled(high) - Scaled(low));
    return top + kPanel * (1 - part);
  }
};

/// Frame, name, and three numbers at the side.
std::string Frame(const Panel& panel, const char* name) {
  std::string svg = Text("<rect x=\"%g\" y=\"%g\" width=\"%g\" height=\"%g\" fill=\"none\" stroke=\"#c8ccd2\"/>", kLeft,
                         panel.top, kRight - kLeft, kPanel);
  svg += Text("<text x=\"%g\" y=\"%g\" font-weight=\"600\">%s</text>", kLeft, panel.top - 8, name);
  const double low = panel.Scaled(panel.low), high = panel.Scaled(panel.high);
  for (const double part : {0.0, 0.5, 1.0}) {
    const double at = low + part * (high - low);
    svg += Text("<text x=\"%g\" y=\"%g\" text-anchor=\"end\">%.3g</text>", kLeft - 6,
                panel.top + kPanel * (1 - part) + 4, panel.is_logarithmic ? std::pow(10, at) : at);
  }
  for (const double part : {0.0, 0.5, 1.0})
    svg += Text("<text x=\"%g\" y=\"%g\" text-anchor=\"middle\">%.0f</text>", kLeft + part * (kRight - kLeft),
                panel.top + kPanel + 15, part * panel.last_step);
  return svg + "\n";
}

struct Part {
  double step = 0, mean = 0, low = 0, high = 0;
};

/// Rows in so many parts of the steps; a part without rows is left out.
std::vector<Part> PartsOf(const Rows& rows, double last_step) {
  std::vector<Rows> shared(kParts);
  for (const Row& row : rows) {
    const auto part = static_cast<std::size_t>(row.step / std::max(last_step, 1.0) * static_cast<double>(kParts));
    shared[std::min(part, kParts - 1)].push_back(row);
  }
  std::vector<Part> parts;
  for (const Rows& some : shared) {
    if (some.empty()) continue;
    Part part{0, 0, some.front().value, some.front().value};
    for (const Row& row : some) {
      part.step += row.step / static_cast<double>(some.size());
      part.mean += row.value / static_cast<double>(some.size());
      part.low = std::min(part.low, row.value);
      part.high = std::max(part.high, row.value);
    }
    parts.push_back(part);
  }
  return parts;
}

std::string LossLine(const Panel& panel, const std::vector<Part>& parts) {
  std::string above, below, line;
  for (const Part& part : parts) {
    const double x = panel.X(part.step);
    above += Text("%.1f,%.1f ", x, panel.Y(part.high));
    below = Text("%.1f,%.1f ", x, panel.Y(part.low)) + below;
    line += Text("%.1f,%.1f ", x, panel.Y(part.mean));
  }
  return "<polygon points=\"" + above + below + "\" fill=\"#0072b2\" fill-opacity=\".15\"/>\n<polyline points=\"" + line +
         "\" fill=\"none\" stroke=\"#0072b2\" stroke-width=\"1.5\"/>\n";
}

std::string HoldoutLine(const Panel& panel, const Rows& rows) {
  std::string line, dots;
  const Row* best = &rows.front();
  for (const Row& row : rows) {
    line += Text("%.1f,%.1f ", panel.X(row.step), panel.Y(row.value));
    dots += Text("<circle cx=\"%.1f\" cy=\"%.1f\" r=\"2\" fill=\"#c44e00\"/>", panel.X(row.step), panel.Y(row.value));
    if (row.value < best->value) best = &row;
  }
  return "<polyline points=\"" + line + "\" fill=\"none\" stroke=\"#c44e00\"/>" + dots +
         Text("<circle cx=\"%.1f\" cy=\"%.1f\" r=\"6\" fill=\"none\" stroke=\"#c44e00\"/>", panel.X(best->step),
              panel.Y(best->value)) +
         Text("<text x=\"%g\" y=\"%g\" text-anchor=\"end\">best %.5g at step %.0f</text>\n", kRight, panel.top - 8,
              best->value, best->step);
}

}  // namespace

std::string CurvesSvg(const std::filesystem::path& folder) {
  const Rows losses = Read(folder / "metrics.csv"), holdouts = Read(folder / "holdout.csv");
  double last = 1;
  for (const Rows* rows : {&losses, &holdouts}) {
    for (const Row& row : *rows) last = std::max(last, row.step);
  }
  std::string svg =
      "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"800\" height=\"450\" viewBox=\"0 0 800 450\" role=\"img\" "
      "aria-label=\"Loss and hold-out by step\" font-family=\"sans-serif\" font-size=\"12\" fill=\"#1a1e23\">\n"
      "<rect width=\"800\" height=\"450\" fill=\"#fff\"/>\n";
  if (!losses.empty()) {
    const Panel panel(30, losses, last);
    svg += Frame(panel, "loss, by step") + LossLine(panel, PartsOf(losses, last));
  }
  if (!holdouts.empty()) {
    const Panel panel(245, holdouts, last);
    svg += Frame(panel, "hold-out, by step") + HoldoutLine(panel, holdouts);
  }
  return svg + "</svg>\n";
}

void WriteCurves(const std::filesystem::path& folder) {
  const std::filesystem::path path = folder / "curves.svg", beside = folder / "curves.svg.part";
  std::ofstream file(beside, std::ios::trunc);
  if (!(file << CurvesSvg(folder)).flush()) throw TensorWriteError(beside.string() + ": cannot be written: " + std::strerror(errno));
  file.close();
  std::error_code error;
  std::filesystem::rename(beside, path, error);
  if (error) throw TensorWriteError(path.string() + ": cannot be written: " + error.message());
}

}  // namespace evac::train
