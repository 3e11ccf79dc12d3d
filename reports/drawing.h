#pragma once

#include <string>
#include <string_view>

/// A chart between being computed and being shown: the same shapes stand in the page, in an SVG file, in a PNG.
namespace evac {

struct Drawing {
  double width = 0, height = 0;  ///< its own units; one is a CSS pixel where it is shown at full size
  std::string body;              ///< SVG elements with the classes of page/charts.css
  std::string words;             ///< what it shows, for those who do not see it; plain text
};

/// `<svg class="chart …" viewBox=…>`, for a page that has page/charts.css: as wide as its place.
std::string InPage(const Drawing& drawing, std::string_view classes = "");

/// A file of its own: white ground, title above (further lines, after '\n', smaller below it; the picture is wide enough
/// for them), the light colours written out, no variables, so that every program that reads SVG draws it alike.
std::string AsSvgFile(const Drawing& drawing, const std::string& title);

/// Whether AsSvgFile wrote it.
bool IsSvgFile(std::string_view bytes);

/// CSS with every var(--name) replaced by the value that the first block of `colours` gives it.
std::string WithoutVariables(std::string css, const std::string& colours);

}  // namespace evac
