#include "reports/estimate_json.h"

namespace evac {

using Json = nlohmann::ordered_json;

void Put(Json& json, const std::string& key, const Number& number) {
  json[key] = number ? Json(*number) : Json(nullptr);
  if (!number) json[key + "_reason"] = number.reason();
}

Json JsonOf(const Estimate& estimate) {
  Json json;
  Put(json, "value", estimate.value);
  json["interval"] = estimate.interval ? Json::array({estimate.interval->low, estimate.interval->high}) : Json(nullptr);
  if (!estimate.interval) json["interval_reason"] = estimate.interval.reason();
  json["confidence"] = estimate.confidence;
  json["n"] = estimate.n;
  json["method"] = estimate.method;
  return json;
}

}  // namespace evac
