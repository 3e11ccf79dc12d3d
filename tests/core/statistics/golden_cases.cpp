#include "tests/core/statistics/golden_cases.h"

#include <fmt/format.h>

#include <cmath>
#include <fstream>

#include "core/error.h"
#include "tests/core/statistics/golden_functions.h"

namespace evac {
namespace {

using Json = nlohmann::json;
using Difference = std::optional<std::string>;

Difference Differ(const std::string& where, const Json& got, const Json& want) {
  return fmt::format("{}: {}, wanted {}", where, got.dump(), want.dump());
}

Difference Compare(const std::string& where, const Json& got, const Json& want, double tolerance) {
  if (want.is_number() && got.is_number()) {
    const double difference = std::abs(got.get<double>() - want.get<double>());
    if (difference <= tolerance * std::max(1.0, std::abs(want.get<double>()))) return std::nullopt;
    return Differ(where, got, want);
  }
  if (want.is_array() && got.is_array() && want.size() == got.size()) {
    for (std::size_t i = 0; i < want.size(); ++i) {
      if (const Difference found = Compare(fmt::format("{}[{}]", where, i), got[i], want[i], tolerance)) return found;
    }
    return std::nullopt;
  }
  return got == want ? std::nullopt : Differ(where, got, want);
}

Difference CompareAll(const Json& got, const GoldenCase& golden) {
  for (const auto& [key, want] : golden.expect.items()) {
    if (!got.contains(key)) return fmt::format("{}: not answered, wanted {}", key, want.dump());
    if (const Difference found = Compare(key, got[key], want, golden.tolerance)) return found;
  }
  return std::nullopt;
}

}  // namespace

std::vector<GoldenCase> ReadGoldenCases(const std::filesystem::path& file) {
  std::ifstream stream(file);
  if (!stream) throw InvalidInput("{}: cannot be read", file.string());
  std::vector<GoldenCase> cases;
  try {
    const Json all = Json::parse(stream);
    for (const Json& json : all.at("cases")) {
      cases.push_back({json.at("id"), json.at("fn"), json.value("status", "ok"), json.at("inputs"),
                       json.value("expect", Json::object()), json.value("tol", 1e-9)});
    }
  } catch (const Json::exception& error) {
    throw InvalidInput("{}: is no file of golden cases: {}", file.string(), error.what());
  }
  return cases;
}

std::vector<GoldenCase> ReadGoldenCases(const std::filesystem::path& file, const std::string& fn) {
  std::vector<GoldenCase> cases = ReadGoldenCases(file);
  std::erase_if(cases, [&](const GoldenCase& golden) { return golden.fn != fn; });
  return cases;
}

std::optional<std::string> FirstDifference(const GoldenCase& golden) {
  try {
    const Json got = CallGolden(golden.fn, golden.inputs);
    if (golden.status == "error") return fmt::format("answered {}, wanted the inputs rejected", got.dump());
    return CompareAll(got, golden);
  } catch (const Error& error) {
    if (golden.status == "error") return std::nullopt;
    return fmt::format("rejected: {}", error.what());
  } catch (const Json::exception& error) {  // a missing argument, or one of another type
    if (golden.status == "error") return std::nullopt;
    return fmt::format("inputs not understood: {}", error.what());
  } catch (const std::exception& error) {
    return fmt::format("broke down: {}", error.what());
  }
}

}  // namespace evac
