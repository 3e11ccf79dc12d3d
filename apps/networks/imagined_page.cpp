#include "apps/networks/imagined_page.h"

#include "core/error.h"
#include "core/parse_json.h"

namespace evac {

using Json = nlohmann::json;

Json JobOnPage(const std::string& text, const std::string& where) try {
  return ParseJson<Json>(text).at("job").get<Json::object_t>();
} catch (const Json::exception&) {
  throw InvalidInput("{}: is there, and says of no job of evac imagine; wanted that name free, or another --out",
                     where);
}

std::string DifferencesOf(const Json& wanted, const Json& found) {
  std::string differences;
  for (const auto& [name, value] : wanted.items()) {
    const Json other = found.value(name, Json());
    if (other == value) continue;
    const std::string there = other.dump(), here = value.dump();
    differences += there.size() + here.size() > 60 ? fmt::format("; {} is another", name)
                                                   : fmt::format("; {} is {} there, {} here", name, there, here);
  }
  return differences;
}

}  // namespace evac
