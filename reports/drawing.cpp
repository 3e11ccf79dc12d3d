#include "reports/drawing.h"

#include <fmt/format.h>

#include <algorithm>
#include <map>
#include <sstream>
#include <vector>

#include "reports/html.h"
#include "reports/page_assets.h"

namespace evac {
namespace {

/// "--ink:#1a1e23;…" → {"--ink": "#1a1e23"}.
std::map<std::string, std::string> VariablesOf(const std::string& colours) {
  const std::size_t begin = colours.find('{') + 1, end = colours.find('}');
  std::map<std::string, std::string> variables;
  for (std::size_t at = begin; at < end;) {
    const std::size_t stop = std::min(colours.find(';', at), end), colon = colours.find(':', at);
    if (colon < stop && colours.compare(at, 2, "--") == 0)
      variables[colours.substr(at, colon - at)] = colours.substr(colon + 1, stop - colon - 1);
    at = colours.find_first_not_of(" \n", stop + 1);
  }
  return variables;
}

constexpr double kMargin = 14, kTitle = 26, kNote = 18;
constexpr double kTitleLetter = 10.5, kNoteLetter = 7.5;  ///< of DejaVu Sans, bold 15 px and 12 px: rather too wide

/// Of UTF-8.
std::ptrdiff_t LettersOf(const std::string& text) {
  return std::ranges::count_if(text, [](char c) { return (static_cast<unsigned char>(c) & 0xC0) != 0x80; });
}

constexpr std::string_view kSvgHead =
    "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n<svg xmlns=\"http://www.w3.org/2000/svg\" class=\"chart\" ";

}  // namespace

std::string InPage(const Drawing& drawing, std::string_view classes) {
  return fmt::format("<svg class=\"chart{}{}\" role=\"img\" viewBox=\"0 0 {:g} {:g}\" aria-label=\"{}\">{}</svg>",
                     classes.empty() ? "" : " ", classes, drawing.width, drawing.height, Escaped(drawing.words),
                     drawing.body);
}

std::string WithoutVariables(std::string css, const std::string& colours) {
  const std::map<std::string, std::string> variables = VariablesOf(colours);
  for (std::size_t at = css.find("var("); at != std::string::npos; at = css.find("var(", at)) {
    const std::size_t end = css.find(')', at);
    const auto value = variables.find(css.substr(at + 4, end - at - 4));
    css.replace(at, end - at + 1, value == variables.end() ? "#000" : value->second);
  }
  return css;
}

bool IsSvgFile(std::string_view bytes) { return bytes.starts_with(kSvgHead); }

std::string AsSvgFile(const Drawing& drawing, const std::string& title) {
  std::vector<std::string> lines;
  std::istringstream text(title);
  for (std::string line; std::getline(text, line);) lines.push_back(line);
  double widest = drawing.width;
  for (std::size_t i = 0; i < lines.size(); ++i)
    widest = std::max(widest, (i == 0 ? kTitleLetter : kNoteLetter) * static_cast<double>(LettersOf(lines[i])));
  const double head = kTitle + kNote * (std::max(1.0, static_cast<double>(lines.size())) - 1);
  const double width = widest + 2 * kMargin, height = drawing.height + 2 * kMargin + head;
  std::string svg = std::string(kSvgHead);
  svg += fmt::format(
      "width=\"{0:g}\" height=\"{1:g}\" viewBox=\"0 0 {0:g} {1:g}\">\n<title>{2}</title>\n<desc>{3}</desc>\n",
      width, height, Escaped(title), Escaped(drawing.words));
  svg += "<style>" + WithoutVariables(ChartsCss(), ColoursCss()) +
         "svg{color:#1a1e23;font-family:\"DejaVu Sans\",Arial,sans-serif}</style>\n";
  svg += "<rect width=\"100%\" height=\"100%\" fill=\"#fff\"/>";
  for (std::size_t i = 0; i < lines.size(); ++i)
    svg += fmt::format("<text{} x=\"{:g}\" y=\"{:g}\">{}</text>", i == 0 ? " class=\"title\"" : "", kMargin,
                       kMargin + 12 + kNote * static_cast<double>(i), Escaped(lines[i]));
  return svg +
         fmt::format("\n<g transform=\"translate({:g} {:g})\">{}</g>\n</svg>\n", kMargin, kMargin + head, drawing.body);
}

}  // namespace evac
