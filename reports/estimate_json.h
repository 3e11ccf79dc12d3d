#pragma once

#include <nlohmann/json.hpp>
#include <string>

#include "core/statistics/estimate.h"

namespace evac {

/// json[key] = the number, or null with the reason beside it in json[key + "_reason"].
void Put(nlohmann::ordered_json& json, const std::string& key, const Number& number);

/// {"value", "interval": [low, high], "confidence", "n", "method"}; null with "value_reason" or "interval_reason".
nlohmann::ordered_json JsonOf(const Estimate& estimate);

}  // namespace evac
