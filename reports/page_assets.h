#pragma once

#include <string>

/// The page's styles and script, as they lie in reports/page/ when the program is built.
namespace evac {

std::string ColoursCss();  ///< variables, light first, then dark
std::string ChartsCss();   ///< what drawings need, in the page and in files of their own
std::string PageCss();     ///< the rest
std::string PageJs();      ///< the scripts of a report, in the order they depend on each other
std::string LiveJs();      ///< what a page inside a dashboard has more

}  // namespace evac
