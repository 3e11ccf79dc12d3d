#pragma once

#include <string>

/// The rating page, as it lies in judges/rating_page/ when the program is built.
namespace evac {

std::string RatingHtml();
std::string RatingCss();
std::string RatingJs();    ///< the scripts, in the order they depend on each other
std::string RatingIcon();  ///< SVG

}  // namespace evac
