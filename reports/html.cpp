#include "reports/html.h"

#include <fmt/format.h>

#include "core/utf8.h"

namespace evac {
namespace {

bool IsAsciiWord(unsigned char c) { return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9'); }

constexpr std::string_view kReplacement = "\xEF\xBF\xBD";

void AppendEscaped(std::string_view sequence, std::string& escaped) {
  switch (sequence.front()) {
    case '&':
      escaped += "&amp;";
      return;
    case '<':
      escaped += "&lt;";
      return;
    case '>':
      escaped += "&gt;";
      return;
    case '"':
      escaped += "&quot;";
      return;
    case '\'':
      escaped += "&#39;";
      return;
    default:
      break;
  }
  const auto first = static_cast<unsigned char>(sequence.front());
  const bool control = (first < 0x20 && first != '\n' && first != '\t') || first == 0x7F;
  escaped += control ? kReplacement : sequence;
}

}  // namespace

std::string Escaped(std::string_view text) {
  std::string escaped;
  while (!text.empty()) {
    const std::size_t length = Utf8Length(text);
    if (length == 0) {
      escaped += kReplacement;
    } else {
      AppendEscaped(text.substr(0, length), escaped);
    }
    text.remove_prefix(length == 0 ? 1 : length);
  }
  return escaped;
}

std::string Breakable(std::string_view text) {
  std::string breakable;
  for (const char c : Escaped(text)) {
    breakable += c;
    if (c == '_' || c == '@' || c == '/') breakable += "<wbr>";
  }
  return breakable;
}

std::string Link(std::string_view relative_path) {
  std::string link;
  for (const char c : relative_path) {
    const auto byte = static_cast<unsigned char>(c);
    const bool plain = IsAsciiWord(byte) || std::string_view("-._~/@").find(c) != std::string_view::npos;
    link += plain ? std::string(1, c) : fmt::format("%{:02X}", byte);
  }
  return link;
}

std::string Anchor(std::string_view text) {
  std::string anchor;
  for (const char c : text) {
    const auto byte = static_cast<unsigned char>(c);
    anchor += IsAsciiWord(byte) || c == '-' ? std::string(1, c) : fmt::format("_{:02x}", byte);
  }
  return anchor;
}

}  // namespace evac
