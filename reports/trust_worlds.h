#pragma once

#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "reports/trust_output.h"

namespace evac {

/// A world of which nothing is said, and why.
struct UnsaidWorld {
  std::string world, reason;
};

/// What is said of each world. One that nobody could judge takes nothing away from the others.
struct WorldsTrust {
  std::vector<TrustReport> worlds;
  std::vector<UnsaidWorld> unsaid;
};

/// Each of these worlds against the run's imported real trials if it has any, else against its real world.
WorldsTrust TrustOfWorlds(const RunSummary& summary, const std::vector<std::string>& worlds,
                          const TrustOptions& options);

/// Where nothing is said of any world: the reason that all share, else each one's own.
std::string WhyNothingIsSaid(const std::vector<UnsaidWorld>& unsaid);

/// What `evac trust` prints (docs/trust.md).
std::string TrustText(const WorldsTrust& trust);
nlohmann::ordered_json TrustJson(const WorldsTrust& trust);

}  // namespace evac
