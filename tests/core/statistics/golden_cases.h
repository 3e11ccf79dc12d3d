#pragma once

#include <filesystem>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

namespace evac {

/// One case of the golden file.
struct GoldenCase {
  std::string id, fn;
  std::string status;  ///< ok, undefined, undecided, partial; error: the inputs must be rejected
  nlohmann::json inputs, expect;
  double tolerance = 0;  ///< |got - want| <= tolerance * max(1, |want|); 0: exact
};

/// All cases, in the file's order. @throws InvalidInput if the file cannot be read or is not of that format.
std::vector<GoldenCase> ReadGoldenCases(const std::filesystem::path& file);
/// The cases of one function, in the file's order.
std::vector<GoldenCase> ReadGoldenCases(const std::filesystem::path& file, const std::string& fn);

/// Calls the case's function. @returns the first thing that differs, "per_policy[2]: 0.1, wanted 0.2", or nothing.
std::optional<std::string> FirstDifference(const GoldenCase& golden);

}  // namespace evac
