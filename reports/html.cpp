#include "reports/html.h"

#include <fmt/format.h>

namespace evac {
namespace {

bool IsAsciiWord(unsigned char c) { return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9'); }

/// Length of the well-formed UTF-8 sequence at the front, 0 if there is none (overlong forms, surrogates, beyond
/// U+10FFFF).
std::size_t SequenceLength(std::string_view text) {
  const auto at = [text](std::size_t i) { return i < text.size() ? static_cast<unsigned char>(text[i]) : 0u; };
  const auto continues = [&at](std::size_t i) { return (at(i) & 0xC0u) == 0x80u; };
  const unsigned lead = at(0), next = at(1);
  if (lead < 0x80) return 1;
  if (lead >= 0xC2 && lead <= 0xDF) return continues(1) ? 2 : 0;
  if (lead >= 0xE0 && lead <= 0xEF) {
    if ((lead == 0xE0 && next < 0xA0) || (lead == 0xED && next > 0x9F)) return 0;
    return continues(1) && continues(2) ? 3 : 0;
  }
  if (lead >= 0xF0 && lead <= 0xF4) {
    if ((lead == 0xF0 && next < 0x90) || (lead == 0xF4 && next > 0x8F)) return 0;
    return continues(1) && continues(2) && continues(3) ? 4 : 0;
  }
  return 0;
}

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
    const std::size_t length = SequenceLength(text);
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
