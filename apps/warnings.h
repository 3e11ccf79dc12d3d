#pragma once

#include <string>
#include <vector>

namespace evac {

/// "evac: warning: …" on stderr for each of the first ones, and how many more there are.
void PrintWarnings(const std::vector<std::string>& warnings);

}  // namespace evac
