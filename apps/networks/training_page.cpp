#include "apps/networks/training_page.h"

#include <algorithm>
#include <utility>

namespace evac {
namespace {

void ReadField(const Config& page, const train::Setting& setting) {
  const std::string& name = setting.name;
  std::visit(
      [&](auto* field) {
        using Type = std::decay_t<decltype(*field)>;
        if constexpr (std::is_same_v<Type, std::int64_t>) {
          const auto found = page.Get<std::uint64_t>(name);
          page.Require(found < (std::uint64_t{1} << 40), name, "a whole number below 2^40");
          *field = static_cast<std::int64_t>(found);
        } else if constexpr (std::is_same_v<Type, std::string>) {
          std::string found = page.Get<std::string>(name);
          if (found.find('\n') != std::string::npos)  // identities and jobs hold an option in a line
            throw InvalidInput("{}: found a line's end in a text, wanted it in one line", page.Where(name));
          *field = std::move(found);
        } else {
          *field = page.Get<Type>(name);
        }
      },
      setting.field);
}

std::string Names(const train::Settings& settings) {
  std::string names;
  for (const train::Setting& setting : settings) names += (names.empty() ? "" : ", ") + setting.name;
  return names;
}

void ReadAll(const Config& page, const train::Settings& settings) {
  for (const std::string& key : page.Keys()) {
    const auto found = std::find_if(settings.begin(), settings.end(), [&](const auto& s) { return s.name == key; });
    if (found == settings.end())
      throw InvalidInput("{}: there is no such option, wanted one of: {}", page.Where(key), Names(settings));
    ReadField(page, *found);
  }
}

Config Given(const std::vector<std::string>& assignments) {
  Config given = Config::FromText("{}", "--set");
  for (const std::string& assignment : assignments) given.Set(assignment);
  return given;
}

}  // namespace

void ReadTrainingPage(const std::string& path, const std::string& section, const std::vector<std::string>& assignments,
                      const train::Settings& settings) {
  if (!path.empty()) {
    const Config page = Config::FromFile(path);
    page.AllowOnly({"codec", "forecast", "world", "judge", "policy"});
    if (page.Has(section)) ReadAll(page.Section(section), settings);
  }
  ReadAll(Given(assignments), settings);
}

std::string WhereGiven(const std::string& path, const std::string& section, const std::vector<std::string>& assignments,
                       const std::string& option) {
  const Config given = Given(assignments);
  if (given.Has(option)) return given.Where(option) + ": ";
  if (path.empty()) return "";
  const Config page = Config::FromFile(path);
  const bool has = page.Has(section) && page.Section(section).Has(option);
  return has ? page.Section(section).Where(option) + ": " : "";
}

}  // namespace evac
