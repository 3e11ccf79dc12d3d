#include "harness/suite_hash.h"

#include <algorithm>
#include <set>
#include <sstream>
#include <utility>
#include <vector>

#include "core/collection.h"
#include "core/hash.h"
#include "core/recording.h"
#include "core/recording_folders.h"
#include "core/scene_files.h"

namespace evac {
namespace {

namespace fs = std::filesystem;

using HashedFiles = std::map<fs::path, HashedFile>;

/// A file of a folder, by its name in it.
struct NamedFile {
  std::string name;
  fs::path path;
};

bool StartsWithAny(const std::string& line, std::initializer_list<const char*> prefixes) {
  return std::any_of(prefixes.begin(), prefixes.end(), [&](const char* prefix) { return line.starts_with(prefix); });
}

/// What Python writes beside the modules that it imports, when it first does.
constexpr const char* kPythonsCache = "__pycache__";

/// Each file below a folder, through links too. @param above  folders that this one lies in: a link back to one is not followed
/// @param but  folders of that name are not looked into
void AddFilesBelow(const fs::path& folder, const std::string& name, const std::string& but, std::set<fs::path> above,
                   std::vector<NamedFile>& files) {
  if (!above.insert(fs::canonical(folder)).second) return;
  std::error_code error, ignored;
  for (fs::directory_iterator at(folder, error), end; !error && at != end; at.increment(error)) {
    const std::string own = name + at->path().filename().string();
    if (at->is_directory(ignored) && at->path().filename() != but)
      AddFilesBelow(at->path(), own + "/", but, above, files);
    if (at->is_regular_file(ignored)) files.push_back({own, at->path()});
  }
  if (error) throw InvalidInput("{}: cannot be read: {}", folder.string(), error.message());
}

bool IsFolder(const fs::path& path) {
  std::error_code ignored;
  return fs::is_directory(path, ignored);
}

/// Which files below a folder are none of its own.
struct LeftAside {
  std::string file = {};               ///< one by its name in the folder
  std::string folder = {};             ///< all below folders of that name, wherever in it they lie
  std::set<fs::path> recordings = {};  ///< folders; of what lies below them all that no recording is read from
};

/// Whether a folder is one of these, or lies in one.
bool LiesInOneOf(const std::set<fs::path>& folders, fs::path folder) {
  while (!folders.contains(folder)) {
    if (folder == folder.parent_path()) return false;
    folder = folder.parent_path();
  }
  return true;
}

/// The files below a folder; or the one file, which has no name in it.
std::vector<NamedFile> FilesOfTree(const fs::path& path, const LeftAside& aside) {
  if (!IsFolder(path)) return {{"", path}};
  std::vector<NamedFile> files;
  AddFilesBelow(path, "", aside.folder, {}, files);
  fs::path last;  // of one folder there may be thousands
  bool is_recording = false;
  std::erase_if(files, [&](const NamedFile& file) {
    if (file.name == aside.file) return true;
    if (aside.recordings.empty() || IsReadOfRecording(file.path.filename().string())) return false;
    if (const fs::path folder = file.path.parent_path(); folder != last) {
      is_recording = LiesInOneOf(aside.recordings, folder);
      last = folder;
    }
    return is_recording;
  });
  return files;
}

fs::path KeyOf(const fs::path& path) { return fs::absolute(path).lexically_normal(); }

/// @param known  of what has been hashed
std::string HashOfFile(const fs::path& file, const HashedFiles& known) {
  const auto found = known.find(KeyOf(file));
  return found == known.end() ? Sha256HexOfFile(file) : found->second.sha256;
}

/// The files below a folder by name and content, in name order; or the one file.
std::string HashOfTree(const fs::path& path, const HashedFiles& known, const LeftAside& aside = {}) {
  if (!IsFolder(path)) return HashOfFile(path, known);
  std::vector<std::string> lines;
  for (const NamedFile& file : FilesOfTree(path, aside))
    lines.push_back(file.name + " " + HashOfFile(file.path, known));
  std::sort(lines.begin(), lines.end());
  std::string text;
  for (const std::string& line : lines) text += line + "\n";
  return Sha256Hex(text);
}

/// Whether a line of the page says something of a world model: ".worlds.2.weights=…", and world 2 is of type evac.
bool IsOfModel(const std::string& line, const Suite& suite) {
  for (std::size_t i = 0; i < suite.worlds.size(); ++i) {
    if (suite.worlds[i].evac && line.starts_with(".worlds." + std::to_string(i) + ".")) return true;
  }
  return false;
}

bool IsOfPolicies(const std::string& line) { return line.starts_with(".policies."); }

/// ".policies.0.files.1=…": what lies there is hashed, by its place in the list (FilesOf), wherever it lies.
bool NamesAFile(const std::string& line) {
  return IsOfPolicies(line) && line.substr(0, line.find('=')).find(".files.") != std::string::npos;
}

/// An initial state is named by its seed and its number: how many there are changes none of them.
bool SaysHowManyStates(const std::string& line) { return line.starts_with(".initial_states.count="); }

/// All that holds files of a recording, or of a folder of several: of one task of a tree some lie beside it, and of a
/// collection the rows that say what its states are.
std::vector<fs::path> PlacesOf(const fs::path& recording) {
  std::vector<fs::path> places = FoldersOf(recording);
  if (IsRecording(recording)) return places;
  for (const fs::path& one : FindRecordings(recording)) {
    std::vector<fs::path> parts = FoldersOf(one);
    std::error_code ignored;
    if (const auto place = PlaceOf(one); place && fs::exists(RowPath(*place), ignored)) parts.push_back(RowPath(*place));
    for (const fs::path& part : parts) {
      const fs::path from_first = part.lexically_relative(places.front());
      if (from_first.empty() || *from_first.begin() == "..") places.push_back(part);
    }
  }
  return places;
}

/// A collection's says which process wrote it last.
constexpr const char* kLock = "lock";

bool IsToldTheRecording(const SuitePolicy& policy) {
  return std::ranges::any_of(policy.command,
                             [](const std::string& word) { return word.find("${recording}") != std::string::npos; });
}

/// What of the recordings' places changes nothing. A policy that is told where the recording lies may read all of it;
/// of a folder of several none is told.
LeftAside LeftAsideOf(const Suite& suite) {
  LeftAside aside{.file = kLock};
  if (IsRecording(*suite.recording)) {
    if (std::ranges::any_of(suite.policies, IsToldTheRecording)) return aside;
    const std::vector<fs::path> folders = FoldersOf(*suite.recording);
    aside.recordings.insert(folders.begin(), folders.end());
    return aside;
  }
  for (const fs::path& one : FindRecordings(*suite.recording)) {
    const std::vector<fs::path> folders = FoldersOf(one);
    aside.recordings.insert(folders.begin(), folders.end());
    aside.recordings.insert(one);  // which may be a link
  }
  return aside;
}

std::string FilesOf(const SuitePolicy& policy, const HashedFiles& known = {}) {
  std::ostringstream text;
  for (std::size_t i = 0; i < policy.files.size(); ++i)
    text << "file " << i << " of " << policy.name << "@" << policy.checkpoint << " "
         << HashOfTree(policy.files[i], known, {.folder = kPythonsCache}) << "\n";
  return text.str();
}

/// The file as it is now, but for its hash; of one that is not there, nothing.
HashedFile LookAt(const fs::path& file) {
  std::error_code ignored;
  HashedFile found;
  found.bytes = fs::file_size(file, ignored);
  found.written = fs::last_write_time(file, ignored);
  return found;
}

bool LiesIn(const fs::path& file, const fs::path& place) {
  const fs::path from_place = file.lexically_relative(place);
  return !from_place.empty() && *from_place.begin() != "..";
}

/// @param place  a file, or a folder, below which the order of paths keeps all together
void DemandAsHashed(const HashedFiles& hashed, const fs::path& place) {
  const fs::path key = KeyOf(place);
  for (auto at = hashed.lower_bound(key); at != hashed.end() && LiesIn(at->first, key); ++at) {
    const auto& [file, known] = *at;
    const HashedFile now = LookAt(file);
    if (now.bytes == known.bytes && now.written == known.written) continue;
    const std::string found = Sha256HexOfFile(file);
    if (found == known.sha256) continue;
    throw InvalidInput("{}: it is another file than when the suite was read: found SHA-256 {}, wanted {}", file.string(),
                       found, known.sha256)
        .Called(kChangedError);
  }
}

std::string HashOf(const Config& page, const Suite& suite, bool whole) {
  std::ostringstream text;
  std::istringstream lines(page.Canonical());
  for (std::string line; std::getline(lines, line);) {
    if (!whole && (IsOfModel(line, suite) || IsOfPolicies(line) || SaysHowManyStates(line))) continue;
    const bool by_content =
        StartsWithAny(line, {".recording=", ".tasks."}) || NamesAFile(line) || IsHashedByContent(line);
    if (!by_content &&
        !StartsWithAny(line, {".lanes=", ".threads=", ".error_budget=", ".description=", ".transport.deadline_s=",
                              ".transport.repeat_after_s=", ".transport.start_s=", ".policy.start_probe="}))
      text << line << "\n";
  }
  for (const Task& task : suite.tasks)
    text << "task " << task.id << " " << suite.page_hashes.at(task.page_path) << "\n";
  for (const SuiteWorld& world : suite.worlds) {
    if (!world.profile.empty()) text << "profile " << world.name << " " << suite.page_hashes.at(world.profile) << "\n";
  }
  for (const SuiteWorld& world : suite.worlds) {
    if (world.evac && whole) text << "evac " << world.name << " " << world.evac->hash << "\n";
  }
  for (const SuitePolicy& policy : suite.policies) {
    if (whole) text << FilesOf(policy, suite.hashed_files);
  }
  if (suite.recording) {
    const auto& said = suite.recorded_task.name;
    text << "recorded task " << (said ? *said : RecordedTaskName(*suite.recording)) << "\n";  // it is filled in later
    const LeftAside aside = LeftAsideOf(suite);
    for (const fs::path& place : PlacesOf(*suite.recording))
      text << "recording " << HashOfTree(place, suite.hashed_files, aside) << "\n";
  }
  return Sha256Hex(text.str());
}

}  // namespace

std::vector<std::string> FilesInNoHash(const Suite& suite, const SuitePolicy& policy) {
  const fs::path suites_folder = fs::absolute(suite.path).parent_path().lexically_normal() / "";
  std::vector<std::string> found;
  for (std::size_t i = 1; i < policy.command.size(); ++i) {
    const std::string& word = policy.command[i];
    const std::string value = word.substr(word.starts_with("--") ? word.find('=') + 1 : 0);
    const fs::path named = (suites_folder / value).lexically_normal();
    std::error_code ignored;
    const bool is_listed = std::ranges::any_of(policy.files, [&](const std::string& file) {
      const fs::path listed = fs::absolute(file).lexically_normal() / "";
      return (named / "").string().starts_with(listed.string());  // it, or below it
    });
    const bool is_there =
        fs::is_regular_file(named, ignored) || (fs::is_directory(named, ignored) && named / "" != suites_folder);
    if (!is_listed && is_there) found.push_back(value);
  }
  return found;
}

std::string PageHash(const fs::path& path) {
  const Config page = Config::FromFile(path);
  std::string text = page.Canonical();
  std::set<fs::path> scenes, known;
  std::istringstream lines(page.Canonical());
  for (std::string line; std::getline(lines, line);) {
    const std::string value = line.substr(line.find('=') + 1);
    const fs::path named = path.parent_path() / value;
    std::error_code ignored;
    const bool is_scene = line.starts_with(".mujoco.scene=");  // MuJoCo reads it under any name
    const bool may_be_file = is_scene || value.find('.') != std::string::npos;
    if (!may_be_file || !fs::is_regular_file(named, ignored)) continue;
    text += value + " " + Sha256HexOfFile(named) + "\n";
    known.insert(fs::canonical(named));
    if (is_scene || named.extension() == ".xml") scenes.insert(named);
  }
  for (const fs::path& scene : scenes) {
    for (const fs::path& file : FilesOfScene(scene)) {
      if (known.insert(fs::canonical(file)).second)
        text += file.lexically_relative(scene.parent_path()).string() + " " + Sha256HexOfFile(file) + "\n";
    }
  }
  return Sha256Hex(text);
}

std::string SuiteHash(const Config& page, const Suite& suite) { return HashOf(page, suite, true); }

std::string RealityHash(const Config& page, const Suite& suite) { return HashOf(page, suite, false); }

void DemandUnchanged(const Suite& suite, const SuiteWorld& world) {
  const auto demand = [&](const fs::path& page) {
    const auto known = suite.page_hashes.find(page);
    if (known == suite.page_hashes.end()) return;
    const std::string found = PageHash(page);
    if (found == known->second) return;
    throw InvalidInput("{}: it, or a file that it names, is another than when the suite was read: found SHA-256 {}, "
                       "wanted {}",
                       page.string(), found, known->second);
  };
  if (!world.profile.empty()) demand(world.profile);
  for (const Task& task : suite.tasks) demand(task.page_path);
}

void DemandUnchanged(const Suite& suite, const SuitePolicy& policy) {
  for (const std::string& file : policy.files) DemandAsHashed(suite.hashed_files, file);
  if (suite.recording && IsToldTheRecording(policy)) DemandRecordingUnchanged(suite, *suite.recording);
}

void DemandRecordingUnchanged(const Suite& suite, const fs::path& recording) {
  for (const fs::path& place : FoldersOf(recording)) DemandAsHashed(suite.hashed_files, place);
}

std::map<fs::path, HashedFile> HashFiles(const Suite& suite) {
  HashedFiles hashed;
  const auto add = [&](const fs::path& place, const LeftAside& aside) {
    for (const NamedFile& file : FilesOfTree(place, aside)) {
      HashedFile now = LookAt(file.path);  // before it is read: what is written to it meanwhile is noticed
      now.sha256 = Sha256HexOfFile(file.path);
      hashed.insert_or_assign(KeyOf(file.path), std::move(now));
    }
  };
  for (const SuitePolicy& policy : suite.policies) {
    for (const std::string& file : policy.files) add(file, {.folder = kPythonsCache});
  }
  if (suite.recording) {
    const LeftAside aside = LeftAsideOf(suite);
    for (const fs::path& place : PlacesOf(*suite.recording)) add(place, aside);
  }
  return hashed;
}

std::string PolicyHash(const SuitePolicy& policy) {
  std::ostringstream text;
  text << policy.name << "@" << policy.checkpoint << "\n";
  for (const std::string& word : policy.command) text << "word " << word.size() << " " << word << "\n";
  text << "listens at " << policy.join_url << "\n" << FilesOf(policy);
  return Sha256Hex(text.str());
}

}  // namespace evac
