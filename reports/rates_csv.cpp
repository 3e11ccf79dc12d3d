#include "reports/rates_csv.h"

#include <fmt/format.h>

#include "reports/csv.h"

namespace evac {
namespace {

std::string Shown(const Number& number) { return number ? fmt::format("{}", *number) : ""; }

std::vector<std::string> Row(const RateCell& cell, const std::string& judge) {
  std::vector<std::string> row = {cell.task, cell.policy, cell.world, judge};
  for (const std::int64_t count : cell.counts) row.push_back(std::to_string(count));
  const Estimate& rate = cell.rate;
  const auto end = [&](double Interval::*which) { return rate.interval ? Shown((*rate.interval).*which) : ""; };
  for (const std::string& number : {std::to_string(cell.states), std::to_string(rate.n), Shown(rate.value),
                                    end(&Interval::low), end(&Interval::high), Shown(rate.confidence), rate.method})
    row.push_back(number);
  return row;
}

}  // namespace

std::string RatesCsv(const RunSummary& summary) {
  std::vector<std::string> header = {"task", "policy", "world", "judge"};
  for (std::size_t i = 0; i < kOutcomes; ++i) header.emplace_back(Name(static_cast<Outcome>(i)));
  for (const char* name : {"initial_states", "n", "rate", "low", "high", "confidence", "method"})
    header.emplace_back(name);
  std::string csv = CsvLine(header);
  for (const RateCell& cell : summary.rates) csv += CsvLine(Row(cell, summary.options.judge));
  return csv;
}

}  // namespace evac
