#pragma once

#include <map>
#include <nlohmann/json.hpp>
#include <string>

#include "core/statistics/estimate.h"

/// The parts that golden_functions.cpp is put together from.
namespace evac::golden {

using Json = nlohmann::json;
/// From a case's inputs to an object with every key that a case may expect; undefined is null.
using Functions = std::map<std::string, Json (*)(const Json&)>;

Functions RaterFunctions();       ///< golden_raters.cpp
Functions ComparisonFunctions();  ///< golden_comparisons.cpp: two rates, many rates, sequential
Functions PlanningFunctions();    ///< golden_planning.cpp: prediction-powered, Bradley-Terry, sizes

inline Json ToJson(const Number& number) { return number ? Json(*number) : Json(nullptr); }
inline Json ToJson(const Defined<Interval>& interval) {
  return interval ? Json::array({interval->low, interval->high}) : Json(nullptr);
}
/// {"lo": …, "hi": …} of an interval, null where there is none.
inline Json Ends(const Defined<Interval>& interval) {
  if (!interval) return {{"lo", nullptr}, {"hi", nullptr}};
  return {{"lo", interval->low}, {"hi", interval->high}};
}

}  // namespace evac::golden
