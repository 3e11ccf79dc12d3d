#include "core/names.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <sstream>

namespace evac {

std::vector<std::string> NamesIn(const std::string& joined) {
  std::vector<std::string> names;
  std::istringstream text(joined);
  for (std::string part; std::getline(text, part, ',');) names.push_back(part);
  return names;
}

std::string Joined(const std::vector<std::string>& names) { return fmt::format("{}", fmt::join(names, ",")); }

}  // namespace evac
