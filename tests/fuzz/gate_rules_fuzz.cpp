#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <string>

#include "core/error.h"
#include "reports/gate_rules.h"

/// Whatever the bytes: the rules are refused with one message, or every number in them is in its range and every
/// rule has the threshold it needs.
namespace {

void Require(bool holds) {
  if (!holds) std::abort();
}

void Check(const evac::GateRules& rules) {
  Require(!rules.rules.empty() && rules.hash.size() == 64);
  for (const evac::GateRule& rule : rules.rules) {
    Require(rule.alpha > 0 && rule.alpha < 0.5 && rule.margin > 0 && rule.margin < 1);
    Require(rule.min_states >= 0 && rule.max_error_share >= 0 && rule.max_error_share <= 1);
    Require(!rule.name.empty() && !rule.metric.empty());
    Require(rule.Compares() || rule.at_least.has_value() != rule.at_most.has_value());
  }
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  try {
    const std::string text(reinterpret_cast<const char*>(data), size);
    const evac::GateRules rules = evac::ReadGateRules(evac::Config::FromText(text, "fuzz.yaml"));
    Check(rules);
  } catch (const evac::Error& error) {
    Require(error.exit_code() == evac::ExitCode::kInvalidInput);
  }
  return 0;
}
