#include "judges/json_text.h"

#include <algorithm>

namespace evac {
namespace {

constexpr int kMaxDepth = 32;
constexpr std::size_t kExcerpt = 200;

/// Walks over JSON-like text, aware of strings.
class Walker {
 public:
  /// @returns how deep the text stands after `c`; braces and brackets in strings do not count.
  int Step(char c) {
    if (escaped_) {
      escaped_ = false;
    } else if (in_string_) {
      escaped_ = c == '\\';
      in_string_ = c != '"';
    } else if (c == '"') {
      in_string_ = true;
    } else if (c == '{' || c == '[') {
      ++depth_;
    } else if (c == '}' || c == ']') {
      --depth_;
    }
    return depth_;
  }

 private:
  int depth_ = 0;
  bool in_string_ = false, escaped_ = false;
};

bool IsTooDeep(std::string_view text) {
  Walker walker;
  return std::any_of(text.begin(), text.end(), [&](char c) { return walker.Step(c) > kMaxDepth; });
}

}  // namespace

std::optional<nlohmann::json> ParseJson(std::string_view text) {
  if (IsTooDeep(text)) return std::nullopt;
  nlohmann::json value = nlohmann::json::parse(text, nullptr, false);
  if (value.is_discarded()) return std::nullopt;
  return value;
}

std::optional<std::string> FirstBalancedObject(std::string_view text) {
  const std::size_t begin = text.find('{');
  if (begin == std::string_view::npos) return std::nullopt;
  Walker walker;
  for (std::size_t at = begin; at < text.size(); ++at) {
    if (walker.Step(text[at]) == 0) return std::string(text.substr(begin, at + 1 - begin));
  }
  return std::nullopt;
}

std::string WithoutThinking(std::string_view text) {
  constexpr std::string_view kMark = "\xEF\xBB\xBF", kOpen = "<think>", kClose = "</think>";
  if (text.starts_with(kMark)) text.remove_prefix(kMark.size());
  std::string plain;
  while (!text.empty()) {
    const std::size_t open = text.find(kOpen), close = text.find(kClose);
    if (close != std::string_view::npos && close < open) {  // its beginning stands in the prompt
      plain.clear();
      text.remove_prefix(close + kClose.size());
    } else if (open == std::string_view::npos) {
      plain += text;
      break;
    } else {
      plain += text.substr(0, open);
      if (close == std::string_view::npos) break;
      text.remove_prefix(close + kClose.size());
    }
  }
  return plain;
}

std::string Excerpt(std::string_view text) {
  std::string line(text.substr(0, kExcerpt));
  for (char& c : line) {
    if (static_cast<unsigned char>(c) < 0x20 || static_cast<unsigned char>(c) > 0x7e) c = ' ';
  }
  return line + (text.size() > kExcerpt ? "…" : "");
}

}  // namespace evac
