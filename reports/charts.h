#pragma once

#include <map>
#include <optional>
#include <string>
#include <vector>

#include "reports/checkpoints.h"
#include "reports/comparison.h"
#include "reports/drawing.h"
#include "reports/stages.h"

/// Charts as SVG, for a page that has the classes of page/charts.css or, as a Drawing, for a file of its own. Shape and
/// fill say what colour says, so that a black-and-white print reads the same. Every chart has a text alternative.
namespace evac {

/// Shapes, by index: circle, square, triangle, diamond, inverted triangle, plus, cross, hexagon; then from the start
/// again.
std::string Marker(std::size_t shape, const std::string& classes);

/// A small drawing of one marker, for tables and keys.
std::string MarkerIcon(std::size_t shape, const std::string& classes);

/// Dot and interval on a scale from 0 to 100 %, as wide as its place: one row of the grid of rates.
/// @param world  index of the world: 0 is drawn as a filled circle, the others hollow.
std::string RateStrip(const Estimate& rate, std::size_t world);

/// The scale above a column of strips.
std::string RateScale();

/// How a point is drawn: the policy chooses shape and colour, the task the fill.
struct PointStyle {
  std::size_t policy = 0, task = 0;
};
std::string PointIcon(const PointStyle& style);
/// One per point of the comparison: the same policy looks the same in every chart of a run.
std::vector<PointStyle> StylesOf(const RunSummary& summary, const WorldComparison& comparison);

/// The index of each world, by name, that every chart of a page draws it by: 0 is the real one's alone.
using WorldMarks = std::map<std::string, std::size_t>;
/// The others count from 1 in this order; a name may come again.
/// @param real  may be empty, and may be among the worlds
WorldMarks MarksOf(const std::string& real, const std::vector<std::string>& worlds);
WorldMarks MarksOf(const RunSummary& summary);

/// The shape of a world's markers: a circle for the real one, for the others one of five.
std::size_t WorldShape(std::size_t world);
/// The letter that looks like it, for texts: "●".
std::string WorldSign(std::size_t world);

/// A text of at most so many letters, "…" after what is left of a longer one.
std::string Shortened(const std::string& text, std::size_t letters);

/// The other world's rate minus the real one's on a scale from -50 to +50 points, with the zone of ± margin; as wide as
/// its place. A bar that goes on beyond the scale ends in an arrow's head; a bias beyond it has no dot.
/// @param world  index of the other world
std::string BiasStrip(const Estimate& bias, double margin, std::size_t world);
/// The scale above a column of them.
std::string BiasScale();

/// Names left, dots with intervals in the middle, numbers right. What lies beyond [low, high] is drawn as in BiasStrip.
struct RowChart {
  struct Row {
    std::string name, numbers;
    Estimate estimate;
    std::size_t world = 0;  ///< 0: the real one
    bool is_group = false;  ///< a heading: no numbers, no dot
  };
  std::string words;  ///< what it is, in a sentence
  double low = 0, high = 1;
  std::vector<double> ticks = {0, 0.25, 0.5, 0.75, 1};
  std::optional<double> zone;  ///< ± this around 0 is shaded
  std::vector<Row> rows;
};
Drawing RowsDrawing(const RowChart& chart);

/// Share of episodes that reached each stage, one series per world, every dot with its interval.
/// @param marks  of all worlds of the funnel
Drawing StageDrawing(const StageFunnel& funnel, const WorldMarks& marks);
/// Success rate by checkpoint, one series per world, every dot with its interval.
/// @param marks  of all worlds of the curve
Drawing CheckpointDrawing(const CheckpointCurve& curve, const WorldMarks& marks);

/// One initial state in two worlds.
struct StateOutcomes {
  Outcome real = Outcome::kUnjudged, other = Outcome::kUnjudged;
  bool IsFlip() const {
    const auto counts = [](Outcome outcome) { return outcome == Outcome::kSuccess || outcome == Outcome::kFailure; };
    return counts(real) && counts(other) && real != other;
  }
};
/// A cell per state, upper half real, lower half the other world; filled: success, empty: failure, struck: not counted;
/// a bar below a flip. In SVGs of ten cells that wrap where the line ends. Needs StateStripFrames once in the page.
std::string StateStrip(const std::vector<StateOutcomes>& states);
std::string StateStripFrames();
/// The same, thirty in a row.
Drawing StatesDrawing(const std::vector<StateOutcomes>& states, const std::string& words);

/// The world under test (up) against the real one (right), both intervals, the identity line, a letter at each point.
/// @param styles  one per point of the comparison.
Drawing ScatterDrawing(const WorldComparison& comparison, const std::vector<PointStyle>& styles);
std::string Scatter(const WorldComparison& comparison, const std::vector<PointStyle>& styles);

}  // namespace evac
