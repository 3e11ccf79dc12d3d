#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <nlohmann/json.hpp>

#include "core/error.h"
#include "reports/correlation_output.h"
#include "reports/pairs_csv.h"

/// Whatever the bytes: the file is refused with one clear message, or its points are finite, its statistics are in
/// their ranges and its JSON can be read again.
namespace {

void Require(bool holds) {
  if (!holds) std::abort();
}

void CheckCorrelation(const evac::Estimate& estimate) {
  if (estimate.value) Require(std::abs(*estimate.value) <= 1);
  Require(static_cast<bool>(estimate.value) != !estimate.value.reason().empty());
  if (estimate.interval)
    Require(-1 <= estimate.interval->low && estimate.interval->low <= estimate.interval->high &&
            estimate.interval->high <= 1);
}

void Check(const std::vector<evac::CorrelationGroup>& groups) {
  for (const evac::CorrelationGroup& group : groups) {
    CheckCorrelation(group.pearson);
    CheckCorrelation(group.spearman);
    if (group.mmrv.value) Require(*group.mmrv.value >= 0);
    if (group.ranks.over_range) Require(*group.ranks.over_range >= 0);
  }
  Require(nlohmann::json::parse(evac::CorrelationJson(groups)).at("groups").size() == groups.size());
  Require(!evac::CorrelationText(groups).empty());
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  try {
    const evac::PairsCsv csv = evac::ReadPairsCsv({reinterpret_cast<const char*>(data), size}, "fuzz.csv");
    for (const evac::CorrelationPoint& point : csv.points)
      Require(std::isfinite(point.real_sr) && std::isfinite(point.sim_sr));
    Check(evac::CorrelatePoints(csv.points));
  } catch (const evac::Error& error) {
    Require(error.exit_code() == evac::ExitCode::kInvalidInput);
  }
  return 0;
}
