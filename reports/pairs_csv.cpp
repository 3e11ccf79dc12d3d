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
#include "reports/csv.h"

namespace evac {
namespace {

constexpr std::array<const char*, 5> kColumns = {"group", "task", "policy", "real_sr", "sim_sr"};
enum Column { kGroup, kTask, kPolicy, kRealSr, kSimSr };

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

Places PlacesOf(const CsvRow& header, const std::string& file) {
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

void WarnOfUnreadColumns(const CsvRow& header, const std::string& file, std::vector<std::string>& warnings) {
  for (const std::string& cell : header.cells) {
    if (std::ranges::find(kColumns, Trimmed(cell)) == kColumns.end()) {
      warnings.push_back(fmt::format("{}:{}: column {} is not read", file, header.line, Quoted(cell)));
    }
  }
}

double Rate(const CsvRow& row, const Places& places, Column column, const std::string& file) {
  const std::string& cell = row.cells[places[column]];
  const std::optional<double> rate = FiniteNumber(cell);
  if (!rate) {
    throw InvalidInput("{}:{}: column {}: found {}, wanted a finite number such as 0.85", file, row.line,
                       kColumns[column], Quoted(cell));
  }
  return *rate;
}

void WarnOutsideRange(const CsvRow& row, Column column, double rate, const std::string& file,
                      std::vector<std::string>& warnings) {
  if (rate >= 0 && rate <= 1) return;
  warnings.push_back(fmt::format("{}:{}: column {} is {}, a rate is in [0, 1]; used as it is", file, row.line,
                                 kColumns[column], rate));
}

CorrelationPoint Point(const CsvRow& row, const Places& places, const std::string& file) {
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
  const std::optional<CsvRow> header = reader.Next();
  if (!header) throw InvalidInput("{}:1: found an empty file, wanted a header: {}", file, fmt::join(kColumns, ","));
  const Places places = PlacesOf(*header, file);
  PairsCsv result;
  WarnOfUnreadColumns(*header, file, result.warnings);
  while (const std::optional<CsvRow> row = reader.Next()) {
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
