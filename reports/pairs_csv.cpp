#include "reports/pairs_csv.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <cstdlib>
#include <optional>

#include "core/error.h"

namespace evac {
namespace {

constexpr std::array<const char*, 5> kColumns = {"group", "task", "policy", "real_sr", "sim_sr"};
enum Column { kGroup, kTask, kPolicy, kRealSr, kSimSr };

constexpr std::size_t kMaxQuotedBytes = 60;  // of a cell in a message

struct Row {
  int line = 0;  // where it begins, from 1
  std::vector<std::string> cells;
};

std::string Quoted(std::string_view cell) {
  return fmt::format("\"{}{}\"", cell.substr(0, kMaxQuotedBytes), cell.size() > kMaxQuotedBytes ? "…" : "");
}

/// Splits text into rows of cells (RFC 4180; a line may also end with CR alone).
class CsvReader {
 public:
  CsvReader(std::string_view text, const std::string& file) : text_(text), file_(file) {
    constexpr std::string_view kByteOrderMark = "\xEF\xBB\xBF";
    if (text_.starts_with(kByteOrderMark)) text_.remove_prefix(kByteOrderMark.size());
  }

  /// The next row that is not an empty line, or nothing at the end.
  std::optional<Row> Next() {
    while (place_ < text_.size() && AtLineEnd()) SkipLineEnd();
    if (place_ == text_.size()) return std::nullopt;
    Row row{line_, {}};
    row.cells.push_back(Cell(row));
    while (place_ < text_.size() && text_[place_] == ',') {
      ++place_;
      row.cells.push_back(Cell(row));
    }
    if (place_ < text_.size()) SkipLineEnd();
    return row;
  }

 private:
  bool AtLineEnd() const { return text_[place_] == '\n' || text_[place_] == '\r'; }

  void SkipLineEnd() {
    place_ += text_.substr(place_).starts_with("\r\n") ? 2 : 1;
    ++line_;
  }

  std::string Cell(const Row& row) {
    if (place_ < text_.size() && text_[place_] == '"') return QuotedCell(row);
    const std::size_t end = std::min(text_.find_first_of(",\r\n", place_), text_.size());
    const std::string_view cell = text_.substr(place_, end - place_);
    place_ = end;
    return std::string(cell);
  }

  std::string QuotedCell(const Row& row) {
    const int first_line = line_;
    std::string cell;
    for (++place_;; ++place_) {
      const std::size_t end = text_.find('"', place_);
      if (end == std::string_view::npos) {
        throw InvalidInput("{}:{}: column {}: found a quote that is never closed, wanted a closing \"", file_,
                           first_line, row.cells.size() + 1);
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

  std::string_view text_;
  const std::string& file_;
  std::size_t place_ = 0;
  int line_ = 1;
};

std::string_view Trimmed(std::string_view cell) {
  const std::size_t first = cell.find_first_not_of(" \t");
  if (first == std::string_view::npos) return {};
  return cell.substr(first, cell.find_last_not_of(" \t") - first + 1);
}

std::optional<double> FiniteNumber(std::string_view cell) {
  std::string_view text = Trimmed(cell);
  if (text.starts_with('+') && !text.starts_with("+-")) text.remove_prefix(1);
  double value = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error == std::errc::invalid_argument || end != text.data() + text.size()) return std::nullopt;
  if (error == std::errc::result_out_of_range)
    value = std::strtod(std::string(text).c_str(), nullptr);  // inf, or near 0
  return std::isfinite(value) ? std::optional(value) : std::nullopt;
}

/// Where each of kColumns stands in a row.
using Places = std::array<std::size_t, kColumns.size()>;

Places PlacesOf(const Row& header, const std::string& file) {
  Places places;
  for (std::size_t column = 0; column < kColumns.size(); ++column) {
    const auto is_it = [&](const std::string& cell) { return Trimmed(cell) == kColumns[column]; };
    const auto found = std::ranges::find_if(header.cells, is_it);
    const auto times = std::ranges::count_if(header.cells, is_it);
    if (times != 1) {
      throw InvalidInput("{}:{}: column {}: found it {} in the header {}, wanted once: {}", file, header.line,
                         kColumns[column], times == 0 ? "not" : "more than once",
                         Quoted(fmt::format("{}", fmt::join(header.cells, ","))), fmt::join(kColumns, ","));
    }
    places[column] = static_cast<std::size_t>(found - header.cells.begin());
  }
  return places;
}

void WarnOfUnreadColumns(const Row& header, const std::string& file, std::vector<std::string>& warnings) {
  for (const std::string& cell : header.cells) {
    if (std::ranges::find(kColumns, Trimmed(cell)) == kColumns.end()) {
      warnings.push_back(fmt::format("{}:{}: column {} is not read", file, header.line, Quoted(cell)));
    }
  }
}

double Rate(const Row& row, const Places& places, Column column, const std::string& file) {
  const std::string& cell = row.cells[places[column]];
  const std::optional<double> rate = FiniteNumber(cell);
  if (!rate) {
    throw InvalidInput("{}:{}: column {}: found {}, wanted a finite number such as 0.85", file, row.line,
                       kColumns[column], Quoted(cell));
  }
  return *rate;
}

void WarnOutsideRange(const Row& row, Column column, double rate, const std::string& file,
                      std::vector<std::string>& warnings) {
  if (rate >= 0 && rate <= 1) return;
  warnings.push_back(fmt::format("{}:{}: column {} is {}, a rate is in [0, 1]; used as it is", file, row.line,
                                 kColumns[column], rate));
}

CorrelationPoint Point(const Row& row, const Places& places, const std::string& file) {
  CorrelationPoint point;
  const std::string& group = row.cells[places[kGroup]];
  point.group = Trimmed(group).empty() ? "all" : group;
  point.task = row.cells[places[kTask]];
  point.policy = row.cells[places[kPolicy]];
  point.real_sr = Rate(row, places, kRealSr, file);
  point.sim_sr = Rate(row, places, kSimSr, file);
  return point;
}

}  // namespace

PairsCsv ReadPairsCsv(std::string_view text, const std::string& file) {
  CsvReader reader(text, file);
  const std::optional<Row> header = reader.Next();
  if (!header) throw InvalidInput("{}:1: found an empty file, wanted a header: {}", file, fmt::join(kColumns, ","));
  const Places places = PlacesOf(*header, file);
  PairsCsv result;
  WarnOfUnreadColumns(*header, file, result.warnings);
  while (const std::optional<Row> row = reader.Next()) {
    if (row->cells.size() != header->cells.size()) {
      const std::size_t wrong =
          std::min(row->cells.size(), header->cells.size());  // the first missing, or the last there is
      throw InvalidInput(
          "{}:{}: column {}: found {} cells, wanted {}, as in the header", file, row->line,
          wrong < header->cells.size() ? std::string(Trimmed(header->cells[wrong])) : fmt::format("{}", wrong + 1),
          row->cells.size(), header->cells.size());
    }
    const CorrelationPoint& point = result.points.emplace_back(Point(*row, places, file));
    WarnOutsideRange(*row, kRealSr, point.real_sr, file, result.warnings);
    WarnOutsideRange(*row, kSimSr, point.sim_sr, file, result.warnings);
  }
  if (result.points.empty())
    throw InvalidInput("{}:{}: found no row after the header, wanted at least one point", file, header->line);
  return result;
}

}  // namespace evac
