#pragma once

#include <nlohmann/json.hpp>
#include <string>

namespace evac {

/// JSON of somebody's, of nlohmann::json or ordered_json. What copies it, compares it or writes it calls itself at every
/// bracket (of ordered_json reading does): none of a million reaches that.
/// @throws the library's parse_error for what is no JSON, its other_error for what lies more than 32 deep
template <typename Json>
Json ParseJson(const std::string& text) {
  return Json::parse(text, [](int depth, typename Json::parse_event_t, const Json&) {
    constexpr int kMostDeep = 32;
    if (depth > kMostDeep)
      throw Json::other_error::create(501, "lists and objects lie more than 32 deep", static_cast<const Json*>(nullptr));
    return true;
  });
}

}  // namespace evac
