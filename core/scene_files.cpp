#include "core/scene_files.h"

#include <fstream>
#include <set>
#include <string>
#include <string_view>

#include "core/file.h"

namespace evac {
namespace {

namespace fs = std::filesystem;

struct Attribute {
  std::string name, value;
};

/// Of all elements, in either kind of quote.
std::vector<Attribute> AttributesIn(const std::string& xml) {
  static constexpr const char* kBlank = " \t\r\n";
  std::vector<Attribute> attributes;
  for (std::size_t sign = xml.find('='); sign != std::string::npos && sign > 0;) {
    const std::size_t open = xml.find_first_not_of(kBlank, sign + 1);
    if (open == std::string::npos) break;
    const bool is_quoted = xml[open] == '"' || xml[open] == '\'';
    const std::size_t close = is_quoted ? xml.find(xml[open], open + 1) : sign;
    if (close == std::string::npos) break;
    const std::size_t last = xml.find_last_not_of(kBlank, sign - 1);
    if (is_quoted && last != std::string::npos) {
      const std::size_t before = xml.find_last_of(" \t\r\n<\"'", last);
      const std::size_t first = before == std::string::npos ? 0 : before + 1;
      attributes.push_back({xml.substr(first, last + 1 - first), xml.substr(open + 1, close - open - 1)});
    }
    sign = xml.find('=', close + 1);
  }
  return attributes;
}

/// By its content, as MuJoCo takes it: what a scene includes may be called robot.mjcf, or robot.
bool IsXml(const fs::path& file) {
  static constexpr std::string_view kBefore = " \t\r\n\xEF\xBB\xBF";  // blanks, a byte order mark
  std::ifstream bytes(file, std::ios::binary);
  char byte = 0;
  while (bytes.get(byte) && kBefore.find(byte) != std::string_view::npos) {
  }
  return bytes && byte == '<';
}

/// Of one scene: paths count from its folder, whichever file names them.
class SceneFiles {
 public:
  explicit SceneFiles(const fs::path& scene) : folder_(scene.parent_path()) { folders_.insert(folder_); }

  void Read(const fs::path& xml) {
    for (const auto& [attribute, value] : AttributesIn(ReadFile(xml))) {
      if (attribute == "meshdir" || attribute == "texturedir" || attribute == "assetdir") folders_.insert(folder_ / value);
      if (attribute == "strippath" && value == "true") strips_paths_ = true;
      if (!attribute.starts_with("file")) continue;
      names_.insert(value);
      const fs::path named = folder_ / value;
      std::error_code ignored;
      if (!fs::is_regular_file(named, ignored) || read_.contains(named)) continue;
      if (named.extension() != ".xml" && !IsXml(named)) continue;
      read_.insert(named);
      Read(named);
    }
  }

  std::vector<fs::path> Found() const {
    std::set<fs::path> found;
    std::error_code ignored;
    for (const std::string& name : Names()) {
      for (const fs::path& folder : folders_) {
        const fs::path file = (folder / name).lexically_normal();
        if (fs::is_regular_file(file, ignored)) found.insert(file);
      }
    }
    return {found.begin(), found.end()};
  }

 private:
  /// With `strippath` a mesh "parts/hand.stl" is looked for as "hand.stl".
  std::set<std::string> Names() const {
    std::set<std::string> names = names_;
    if (!strips_paths_) return names;
    for (const std::string& name : names_) names.insert(name.substr(name.find_last_of("/\\") + 1));
    return names;
  }

  fs::path folder_;
  std::set<fs::path> folders_, read_;
  std::set<std::string> names_;
  bool strips_paths_ = false;
};

}  // namespace

std::vector<fs::path> FilesOfScene(const fs::path& scene) {
  SceneFiles files(scene);
  files.Read(scene);
  std::vector<fs::path> found = files.Found();
  std::erase(found, scene.lexically_normal());
  return found;
}

}  // namespace evac
