#include "reports/xml.h"

#include "reports/html.h"

namespace evac {
namespace {

void ReplaceAll(const std::string& what, const std::string& with, std::string& text) {
  for (std::size_t at = 0; (at = text.find(what, at)) != std::string::npos; at += with.size())
    text.replace(at, what.size(), with);
}

}  // namespace

std::string XmlText(std::string_view text) {
  std::string escaped = Escaped(text);
  ReplaceAll("\xEF\xBF\xBE", "\xEF\xBF\xBD", escaped);  // U+FFFE and U+FFFF are UTF-8, but no characters of XML
  ReplaceAll("\xEF\xBF\xBF", "\xEF\xBF\xBD", escaped);
  return escaped;
}

std::string XmlAttribute(std::string_view text) {
  std::string escaped = XmlText(text);
  ReplaceAll("\n", "&#10;", escaped);
  ReplaceAll("\t", "&#9;", escaped);
  return escaped;
}

}  // namespace evac
