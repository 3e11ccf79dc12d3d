#pragma once

#include <nlohmann/json.hpp>
#include <string>
#include <vector>

namespace evac {

/// Calls the function that the golden file (stat_golden.json, schema stat_golden/1) names `fn`.
/// @param inputs  the case's object of arguments.
/// @returns an object with at least the keys of the case's `expect`; undefined is null.
/// @throws Error (InvalidInput) for inputs that must be rejected, and for a name that is not known.
nlohmann::json CallGolden(const std::string& fn, const nlohmann::json& inputs);

/// All names that CallGolden knows, sorted.
std::vector<std::string> GoldenNames();

}  // namespace evac
