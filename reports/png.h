#pragma once

#include <string>

namespace evac {

/// An SVG file's bytes as a PNG's, drawn by librsvg (the only place that knows it). The same SVG gives the same bytes
/// on one machine; letters come from its fonts.
/// @param scale  pixels per unit of the SVG, in (0, 16].
/// @throws InternalError naming what librsvg or cairo refuses.
std::string PngOf(const std::string& svg, double scale = 2);

}  // namespace evac
