#include "reports/benchmark.h"

#include <fmt/format.h>

#include <nlohmann/json.hpp>

#include "reports/wording.h"

namespace evac {
namespace {

using Json = nlohmann::ordered_json;

Json EntryOf(const RateCell& cell, const std::string& judge) {
  const Estimate& rate = cell.rate;
  Json entry = {{"name", cell.task + " / " + cell.policy + " / " + cell.world},
                {"unit", "% success"},
                {"value", 100 * *rate.value}};
  if (rate.interval) entry["range"] = fmt::format("± {:.1f}", 50 * (rate.interval->high - rate.interval->low));
  entry["extra"] = fmt::format("{}\nn = {}, {:g} % {}\njudge {}, {}", PercentWithInterval(rate), rate.n,
                               100 * rate.confidence, rate.method, judge, Counted(cell.Apart(), "episode") + " apart");
  return entry;
}

}  // namespace

std::string BenchmarkJson(const RunSummary& summary) {
  Json entries = Json::array();
  for (const RateCell& cell : summary.rates) {
    if (cell.rate.value) entries.push_back(EntryOf(cell, summary.options.judge));
  }
  return entries.dump(1, ' ', false, Json::error_handler_t::replace) + "\n";
}

}  // namespace evac
