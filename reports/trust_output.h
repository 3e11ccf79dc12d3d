#pragma once

#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "reports/trust.h"

/// What `evac trust` prints (docs/trust.md).
namespace evac {

/// One world's trust, and what it was held against.
struct TrustReport {
  std::string world;
  std::string real;  ///< "24 imported real trials (2 more without an outcome)", "the world real"
  std::string judge;
  TrustOptions options;
  std::vector<TaskTrust> tasks;
};

std::string TrustText(const TrustReport& report);
nlohmann::ordered_json TrustJson(const TrustReport& report);

/// "yes: sim's rate is within ±10 points of the real one (40 pairs: 62 % against 60 %, bias +2 points [-6, 9])".
std::string TrustStatement(const TaskTrust& task, const TrustReport& report);

}  // namespace evac
