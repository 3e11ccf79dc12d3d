#include "tests/architecture/source_text.h"

#include <algorithm>
#include <cctype>
#include <regex>
#include <sstream>

namespace evac::architecture {
namespace {

bool IsWord(char c) { return std::isalnum(static_cast<unsigned char>(c)) != 0 || c == '_'; }

/// Walks over the text and blanks what is no code.
class Blanker {
 public:
  explicit Blanker(const std::string& text) : text_(text) {}

  std::string Run() {
    while (at_ < text_.size()) Step();
    return text_;
  }

 private:
  void Step() {
    const char c = text_[at_];
    if (Looking("//")) return BlankLine();
    if (Looking("/*")) return BlankUpTo("*/", at_ + 2);
    if (c == '#' && at_line_start_) return BlankLine();
    if (Looking("R\"") && IsRawPrefix()) return BlankRawString();
    if (c == '"' || (c == '\'' && !IsDigitSeparator())) return BlankQuoted(c);
    if (c == '\n') at_line_start_ = true;
    if (std::isspace(static_cast<unsigned char>(c)) == 0) at_line_start_ = false;
    ++at_;
  }

  bool Looking(const char* token) const {
    return text_.compare(at_, std::char_traits<char>::length(token), token) == 0;
  }
  bool IsDigitSeparator() const {
    return at_ > 0 && at_ + 1 < text_.size() && IsWord(text_[at_ - 1]) && IsWord(text_[at_ + 1]) && InNumber();
  }
  bool InNumber() const {
    std::size_t start = at_;
    while (start > 0 && (IsWord(text_[start - 1]) || text_[start - 1] == '\'')) --start;
    return std::isdigit(static_cast<unsigned char>(text_[start])) != 0;
  }
  bool IsRawPrefix() const {
    std::size_t start = at_;
    while (start > 0 && IsWord(text_[start - 1])) --start;
    const std::string prefix = text_.substr(start, at_ - start);
    return prefix.empty() || prefix == "u8" || prefix == "u" || prefix == "U" || prefix == "L";
  }

  void Blank() {
    if (text_[at_] != '\n') text_[at_] = ' ';
    ++at_;
  }
  void BlankLine() {
    while (at_ < text_.size() && text_[at_] != '\n') {
      const bool joined = text_[at_] == '\\' && at_ + 1 < text_.size() && text_[at_ + 1] == '\n';
      Blank();
      if (joined) Blank();
    }
  }
  void BlankUpTo(const std::string& end, std::size_t from) {
    const std::size_t found = text_.find(end, from);
    const std::size_t stop = found == std::string::npos ? text_.size() : found + end.size();
    while (at_ < stop) Blank();
    at_line_start_ = false;
  }
  void BlankRawString() {
    const std::size_t open = text_.find('(', at_);
    if (open == std::string::npos) return Blank();
    std::string end(1, ')');
    end.append(text_, at_ + 2, open - at_ - 2).push_back('"');
    BlankUpTo(end, open);
  }
  void BlankQuoted(char quote) {
    Blank();
    while (at_ < text_.size() && text_[at_] != quote && text_[at_] != '\n') {
      if (text_[at_] == '\\' && at_ + 1 < text_.size()) Blank();
      Blank();
    }
    if (at_ < text_.size() && text_[at_] == quote) Blank();
    at_line_start_ = false;
  }

  std::string text_;
  std::size_t at_ = 0;
  bool at_line_start_ = true;
};

std::size_t CloseOf(const std::string& code, std::size_t open) {
  int depth = 0;
  for (std::size_t i = open; i < code.size(); ++i) {
    if (code[i] == '{') ++depth;
    if (code[i] == '}' && --depth == 0) return i;
  }
  return code.size() - 1;
}

std::string Collapsed(const std::string& text) {
  std::istringstream words(text);
  std::string word, joined;
  while (words >> word) {
    if (!joined.empty()) joined += ' ';
    joined += word;
  }
  return joined;
}

/// `template <...>` taken off the front: its defaults may hold '=' and its bounds may hold "class".
std::string WithoutTemplate(std::string head) {
  while (head.rfind("template", 0) == 0) {
    int depth = 0;
    std::size_t i = head.find('<');
    for (; i < head.size(); ++i) {
      if (head[i] == '<') ++depth;
      if (head[i] == '>' && --depth == 0) break;
    }
    if (i >= head.size()) return head;
    head = Collapsed(head.substr(i + 1));
  }
  return head;
}

/// The head with what stands in parentheses taken out: "void f()" for "void f(int a = g())".
std::string OutsideParentheses(const std::string& head) {
  std::string outside;
  int depth = 0;
  for (const char c : head) {
    if (c == ')') --depth;
    if (depth == 0) outside += c;
    if (c == '(') ++depth;
  }
  return outside;
}

enum class Opens { kScope, kFunction, kInitialiser };

/// What the brace after `head` opens, at namespace or class scope.
Opens WhatOpens(const std::string& raw_head) {
  static const std::regex kScopeWord("^(inline +)?(namespace|class|struct|union|enum|extern|typedef)\\b");
  static const std::regex kOperator("operator *[-=<>!+*/%&|^~]+");
  static const std::regex kMemberInitialiser("\\)[^:]*[^:]:[^:].*[A-Za-z0-9_>]$");
  if (std::count(raw_head.begin(), raw_head.end(), '(') != std::count(raw_head.begin(), raw_head.end(), ')'))
    return Opens::kInitialiser;
  const std::string head = WithoutTemplate(raw_head);
  if (std::regex_search(head, kScopeWord) && head.find(") {") == std::string::npos) {
    if (head.find('(') == std::string::npos || head.back() != ')') return Opens::kScope;
  }
  const std::string outside = std::regex_replace(OutsideParentheses(head), kOperator, "operator");
  if (outside.find('(') == std::string::npos) return head.empty() ? Opens::kScope : Opens::kInitialiser;
  if (outside.find('=') != std::string::npos) return Opens::kInitialiser;
  return std::regex_search(outside, kMemberInitialiser) ? Opens::kInitialiser : Opens::kFunction;
}

int LineOf(const std::string& text, std::size_t at) {
  return 1 + static_cast<int>(std::count(text.begin(), text.begin() + static_cast<std::ptrdiff_t>(at), '\n'));
}

/// Where the head really begins: after white space and `public:` and its like.
std::size_t HeadStart(const std::string& code, std::size_t from, std::size_t to) {
  static const std::regex kAccess("^\\s*((public|private|protected)\\s*:)?\\s*");
  std::smatch match;
  const std::string head = code.substr(from, to - from);
  std::regex_search(head, match, kAccess);
  return from + static_cast<std::size_t>(match.length());
}

}  // namespace

std::string CodeOnly(const std::string& text) { return Blanker(text).Run(); }

std::vector<FunctionSpan> FindFunctions(const std::string& text) {
  const std::string code = CodeOnly(text);
  std::vector<FunctionSpan> functions;
  std::size_t head_from = 0;
  int parentheses = 0;
  for (std::size_t i = 0; i < code.size(); ++i) {
    if (code[i] == '(') ++parentheses;
    if (code[i] == ')') --parentheses;
    if (parentheses == 0 && (code[i] == ';' || code[i] == '}')) head_from = i + 1;
    if (code[i] != '{') continue;
    const std::size_t start = HeadStart(code, head_from, i);
    const std::string head = Collapsed(code.substr(start, i - start));
    const Opens opens = WhatOpens(head);
    if (opens == Opens::kScope) head_from = i + 1;
    if (opens == Opens::kScope) continue;
    const std::size_t close = CloseOf(code, i);
    if (opens == Opens::kFunction) {
      functions.push_back({head, LineOf(code, start), LineOf(code, close)});
      head_from = close + 1;
    }
    i = close;
  }
  return functions;
}

std::vector<Include> FindIncludes(const std::string& text) {
  static const std::regex kInclude("^\\s*#\\s*include\\s*([<\"])([^>\"]+)[>\"]");
  std::vector<Include> includes;
  std::istringstream lines(text);
  std::string line;
  for (int number = 1; std::getline(lines, line); ++number) {
    std::smatch match;
    if (std::regex_search(line, match, kInclude)) includes.push_back({match[2], match[1] == "\"", number});
  }
  return includes;
}

}  // namespace evac::architecture
