#include "reports/csv.h"

#include <fmt/format.h>

#include <algorithm>

#include "core/error.h"

namespace evac {
namespace {

constexpr std::size_t kMaxQuotedBytes = 60;  // of a cell in a message

}  // namespace

CsvReader::CsvReader(std::string_view text, const std::string& file) : text_(text), file_(file) {
  constexpr std::string_view kByteOrderMark = "\xEF\xBB\xBF";
  if (text_.starts_with(kByteOrderMark)) text_.remove_prefix(kByteOrderMark.size());
}

std::optional<CsvRow> CsvReader::Next() {
  while (place_ < text_.size() && AtLineEnd()) SkipLineEnd();
  if (place_ == text_.size()) return std::nullopt;
  CsvRow row{line_, {}};
  row.cells.push_back(Cell(row));
  while (place_ < text_.size() && text_[place_] == ',') {
    ++place_;
    row.cells.push_back(Cell(row));
  }
  if (place_ < text_.size()) SkipLineEnd();
  return row;
}

void CsvReader::SkipLineEnd() {
  place_ += text_.substr(place_).starts_with("\r\n") ? 2 : 1;
  ++line_;
}

std::string CsvReader::Cell(const CsvRow& row) {
  if (place_ < text_.size() && text_[place_] == '"') return QuotedCell(row);
  const std::size_t end = std::min(text_.find_first_of(",\r\n", place_), text_.size());
  const std::string_view cell = text_.substr(place_, end - place_);
  place_ = end;
  return std::string(cell);
}

std::string CsvReader::QuotedCell(const CsvRow& row) {
  const int first_line = line_;
  std::string cell;
  for (++place_;; ++place_) {
    const std::size_t end = text_.find('"', place_);
    if (end == std::string_view::npos) {
      throw InvalidInput("{}:{}: column {}: found a quote that is never closed, wanted a closing \"", file_, first_line,
                         row.cells.size() + 1);
    }
    const std::string_view part = text_.substr(place_, end - place_);
    cell += part;
    line_ += static_cast<int>(std::ranges::count(part, '\n'));
    place_ = end + 1;
    if (place_ == text_.size() || text_[place_] != '"') break;
    cell += '"';  // "" inside quotes is one quote
  }
  if (place_ < text_.size() && text_[place_] != ',' && !AtLineEnd()) {
    throw InvalidInput("{}:{}: column {}: found {} after the closing quote, wanted a comma or the end of the line",
                       file_, line_, row.cells.size() + 1, Quoted(text_.substr(place_, 1)));
  }
  return cell;
}

std::string CsvLine(const std::vector<std::string>& cells) {
  std::string line;
  for (const std::string& cell : cells) {
    if (&cell != &cells.front()) line += ',';
    const bool is_plain = cell.find_first_of(",\"\r\n") == std::string::npos && Trimmed(cell).size() == cell.size();
    if (is_plain && !(cell.empty() && cells.size() == 1)) {
      line += cell;
      continue;
    }
    line += '"';
    for (const char c : cell) line += c == '"' ? std::string("\"\"") : std::string(1, c);
    line += '"';
  }
  return line + "\n";
}

std::string_view Trimmed(std::string_view cell) {
  const std::size_t first = cell.find_first_not_of(" \t");
  if (first == std::string_view::npos) return {};
  return cell.substr(first, cell.find_last_not_of(" \t") - first + 1);
}

std::string Quoted(std::string_view cell) {
  return fmt::format("\"{}{}\"", cell.substr(0, kMaxQuotedBytes), cell.size() > kMaxQuotedBytes ? "…" : "");
}

}  // namespace evac
