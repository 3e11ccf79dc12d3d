#pragma once

#include <string>
#include <vector>

#include "reports/comparison.h"

/// Charts as SVG text, to be put inside a page that has the classes of page_style.cpp. Shape and fill say what colour
/// says, so that a black-and-white print reads the same. Every chart has a text alternative.
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

/// The world under test (up) against the real one (right), both intervals, the identity line, a letter at each point.
/// @param styles  one per point of the comparison.
std::string Scatter(const WorldComparison& comparison, const std::vector<PointStyle>& styles);

}  // namespace evac
