#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

namespace evac {

struct CollectArguments {
  std::filesystem::path recipe, out;
  std::vector<std::string> assignments;  ///< `--set`
  int episodes = 0;                      ///< 0: as the recipe says
  std::uint64_t seed = 1;
  int jobs = 0;  ///< episodes that run at the same time; 0: one per core. Changes no byte
};

/// Makes every episode of the recipe that `out` does not have, then the manifest; says on stderr how far it is, on
/// stdout what came of it (docs/collect.md).
/// @throws InvalidInput for a wrong recipe, or if `out` holds another collection.
void Collect(const CollectArguments& arguments);

}  // namespace evac
