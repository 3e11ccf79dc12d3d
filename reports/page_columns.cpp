#include "reports/page_columns.h"

#include <algorithm>

namespace evac {
namespace {

constexpr std::string_view kDigits = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789-_";
constexpr char kNumber = '\x01';  // stands where a number was
constexpr std::size_t kLongestClause = 80;

bool IsDigit(char c) { return c >= '0' && c <= '9'; }

/// Where the number that begins at `at` ends.
std::size_t EndOfNumber(std::string_view text, std::size_t at) {
  while (at < text.size() && IsDigit(text[at])) ++at;
  if (at + 1 < text.size() && text[at] == '.' && IsDigit(text[at + 1])) {
    ++at;
    while (at < text.size() && IsDigit(text[at])) ++at;
  }
  return at;
}

/// Up to the first ';', ':' or '(': what a reason is about.
std::string ClauseOf(const std::string& words) {
  std::size_t end = std::min({words.find_first_of(";:("), words.size(), kLongestClause});
  while (end < words.size() && end > 0 && (static_cast<unsigned char>(words[end]) & 0xC0) == 0x80)
    --end;  // whole letters
  std::string clause = words.substr(0, end);
  while (!clause.empty() && clause.back() == ' ') clause.pop_back();
  return clause;
}

/// Digits per row; of one value alone every row is known.
std::size_t WidthOf(const Column& column) {
  std::size_t width = 0;
  for (std::size_t room = 1; room < column.values().size(); room *= kDigits.size()) ++width;
  return width;
}

std::size_t Size(const Column& column) {
  std::size_t bytes = 0;
  for (const std::string& value : column.values()) bytes += value.size() + 3;
  return bytes + column.rows().size() * WidthOf(column);
}

}  // namespace

void Column::Add(const std::string& value) {
  const auto [entry, is_new] = index_.try_emplace(value, static_cast<std::uint32_t>(values_.size()));
  if (is_new) values_.push_back(value);
  rows_.push_back(entry->second);
}

nlohmann::ordered_json Column::Json() const {
  const std::size_t width = WidthOf(*this);
  std::string digits;
  digits.reserve(rows_.size() * width);
  for (const std::uint32_t row : rows_) {
    for (std::size_t place = width; place > 0; --place) digits += kDigits[(row >> (6 * (place - 1))) & 63];
  }
  return {{"v", values_}, {"w", width}, {"s", digits}};
}

void TextColumn::Add(std::string_view text) {
  std::string words;
  bool is_first = true;
  for (std::size_t at = 0; at < text.size();) {
    if (!IsDigit(text[at])) {
      if (text[at] != kNumber) words += text[at];
      ++at;
      continue;
    }
    const std::size_t end = EndOfNumber(text, at);
    words += kNumber;
    numbers_.append(is_first ? "" : " ").append(text.substr(at, end - at));
    is_first = false;
    at = end;
  }
  numbers_ += '\n';
  words_.Add(words);
  clauses_.Add(ClauseOf(words));
}

nlohmann::ordered_json TextColumn::Json(std::size_t most_bytes) const {
  if (Size(words_) + numbers_.size() <= most_bytes)
    return {{"column", words_.Json()}, {"numbers", numbers_}, {"cut", ""}};
  if (Size(words_) <= most_bytes) return {{"column", words_.Json()}, {"numbers", nullptr}, {"cut", "numbers"}};
  if (Size(clauses_) <= most_bytes) return {{"column", clauses_.Json()}, {"numbers", nullptr}, {"cut", "clauses"}};
  Column none;
  none.Add("");
  return {{"column", none.Json()}, {"numbers", nullptr}, {"cut", "all"}};
}

std::string ForScript(const nlohmann::ordered_json& json) {
  const std::string text = json.dump(-1, ' ', false, nlohmann::ordered_json::error_handler_t::replace);
  std::string safe;
  safe.reserve(text.size());
  for (const char c : text) c == '<' ? safe += "\\u003c" : safe += c;
  return safe;
}

}  // namespace evac
