#include "core/collection.h"

#include <algorithm>
#include <charconv>
#include <cstring>
#include <limits>
#include <nlohmann/json.hpp>
#include <span>
#include <stdexcept>

#include "core/error.h"
#include "core/file.h"
#include "core/names.h"
#include "core/parse_json.h"
#include "core/tensor_file.h"

namespace evac {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;

/// 64 bits as text: JSON's numbers are doubles to most readers.
std::string Digits(std::uint64_t number) { return std::to_string(number); }

/// @throws std::invalid_argument unless it is digits alone and fits.
std::uint64_t Number(const std::string& digits) {
  std::uint64_t number = 0;
  const auto [end, error] = std::from_chars(digits.data(), digits.data() + digits.size(), number);
  if (error != std::errc() || end != digits.data() + digits.size()) throw std::invalid_argument("'" + digits + "'");
  return number;
}

/// A field that is a whole number of type T: the library would make one of any number, whatever it is.
template <typename T>
T WholeIn(const Json& page, const char* field, const std::string& where) {
  const Json& value = page.at(field);
  constexpr auto kMost = static_cast<std::uint64_t>(std::numeric_limits<T>::max());
  const bool fits = value.is_number_unsigned()
                        ? value.get<std::uint64_t>() <= kMost
                        : value.is_number_integer() && value.get<std::int64_t>() >= std::numeric_limits<T>::min();
  if (!fits) throw InvalidInput("{}: {} is {}, wanted a whole number", where, field, value.dump());
  return value.get<T>();
}

/// A CSV cell: quoted where it must be.
std::string Cell(const std::string& text) {
  if (text.find_first_of(",\"\n") == std::string::npos) return text;
  std::string quoted = "\"";
  for (const char letter : text) quoted += letter == '"' ? std::string("\"\"") : std::string(1, letter);
  return quoted + "\"";
}

std::string Sentence(const std::map<std::string, double>& parameters) {
  std::string text;
  for (const auto& [name, value] : parameters) text += fmt::format("{}{}={}", text.empty() ? "" : " ", name, value);
  return text;
}

TensorView View(const std::string& name, TensorType type, std::vector<std::int64_t> shape, const void* values) {
  TensorView view;
  view.name = name;
  view.type = type;
  view.shape = std::move(shape);
  view.bytes = {static_cast<const std::byte*>(values), view.ByteCount()};
  return view;
}

/// Copies a tensor's numbers. @throws InvalidInput unless type and shape are those.
template <typename T>
std::vector<T> Numbers(const TensorFile& file, const TensorDeclaration& wanted) {
  const TensorView& found = file.Get(wanted.name);
  if (found.type != wanted.type || found.shape != wanted.shape)
    throw InvalidInput("{}: tensor {} is not of the recording's frames and views", file.name(), wanted.name);
  std::vector<T> numbers(found.bytes.size() / sizeof(T));
  std::memcpy(numbers.data(), found.bytes.data(), found.bytes.size());
  return numbers;
}

/// The order of cameras in every task page that ships.
bool IsInOrderOfPages(const std::vector<std::string>& cameras) {
  std::vector<std::string> ordered = {"head", "hand_left", "hand_right"};
  std::erase_if(ordered, [&](const std::string& name) { return std::ranges::find(cameras, name) == cameras.end(); });
  return ordered == cameras;
}

/// The names of the file's views, in their order.
std::vector<std::string> CamerasOf(const TensorFile& file, const std::vector<std::string>& wanted) {
  const auto named = file.metadata().find("cameras");
  if (named != file.metadata().end()) return NamesIn(named->second);
  const std::vector<std::int64_t>& shape = file.Get("object_px").shape;
  const std::int64_t views = shape.size() == 3 ? shape[1] : 0;
  if (views == std::ssize(wanted) && IsInOrderOfPages(wanted)) return wanted;
  throw InvalidInput(
      "{}: does not say which cameras its {} views are of, as files of an earlier `evac collect`; wanted {}: collect "
      "anew",
      file.name(), views, fmt::join(wanted, ","));
}

/// Where each of the wanted cameras stands among the file's. @throws InvalidInput if one does not.
std::vector<std::size_t> ColumnsOf(const std::vector<std::string>& wanted, const std::vector<std::string>& found,
                                   const std::string& file) {
  std::vector<std::size_t> columns;
  for (const std::string& name : wanted) {
    const auto at = std::ranges::find(found, name);
    if (at == found.end())
      throw InvalidInput("{}: cameras are {}, wanted {} among them", file, fmt::join(found, ","), name);
    columns.push_back(static_cast<std::size_t>(at - found.begin()));
  }
  return columns;
}

}  // namespace

std::string CollectedJson(const CollectedEpisode& episode) {
  const Json page = {{"index", episode.index},
                     {"task", episode.task},
                     {"episode", episode.episode},
                     {"initial_state", episode.initial_state},
                     {"state_seed", Digits(episode.state_seed)},
                     {"world_seed", Digits(episode.world_seed)},
                     {"policy_seed", Digits(episode.policy_seed)},
                     {"behaviour", episode.behaviour},
                     {"policy", episode.policy},
                     {"parameters", episode.parameters},
                     {"without", episode.without},
                     {"outcome", episode.success ? 1 : 0},
                     {"fate", episode.fate},
                     {"reason", episode.reason},
                     {"stop", episode.stop},
                     {"frames", episode.frames},
                     {"contact_frames", episode.contact_frames},
                     {"video_scale", episode.video_scale}};
  return page.dump();
}

CollectedEpisode ParseCollected(const std::string& json, const std::string& where) try {
  const Json page = ParseJson<Json>(json);
  CollectedEpisode episode;
  episode.index = WholeIn<std::int64_t>(page, "index", where);
  episode.task = page.at("task");
  episode.episode = page.at("episode");
  episode.initial_state = page.at("initial_state");
  episode.state_seed = Number(page.at("state_seed"));
  episode.world_seed = Number(page.at("world_seed"));
  episode.policy_seed = Number(page.at("policy_seed"));
  episode.behaviour = page.at("behaviour");
  episode.policy = page.at("policy");
  episode.parameters = page.at("parameters").get<std::map<std::string, double>>();
  episode.without = page.at("without");
  const int outcome = WholeIn<int>(page, "outcome", where);
  if (outcome != 0 && outcome != 1) throw InvalidInput("{}: outcome is {}, wanted 0 or 1", where, outcome);
  episode.success = outcome == 1;
  episode.fate = page.at("fate");
  episode.reason = page.at("reason");
  episode.stop = page.at("stop");
  episode.frames = WholeIn<int>(page, "frames", where);
  episode.contact_frames = WholeIn<int>(page, "contact_frames", where);
  episode.video_scale = WholeIn<int>(page, "video_scale", where);
  if (episode.video_scale < 1)
    throw InvalidInput("{}: video_scale is {}, wanted 1 or more", where, episode.video_scale);
  const bool diverged = episode.stop == Name(StopReason::kDiverged);
  if (diverged ? episode.frames != 0 : episode.frames < 1)
    throw InvalidInput("{}: frames is {}, wanted {} of an episode whose stop is {}", where, episode.frames,
                       diverged ? "0" : "1 or more", episode.stop);
  return episode;
} catch (const Json::exception& error) {
  throw InvalidInput("{}: no row of a collection: {}", where, error.what());
} catch (const std::logic_error& error) {  // a seed that is no number
  throw InvalidInput("{}: no row of a collection: a seed is no number ({})", where, error.what());
}

std::string CollectedCsvHeading() {
  return "index,task,episode,initial_state,behaviour,policy,parameters,without,outcome,fate,stop,frames,contact_frames,"
         "state_seed,world_seed,policy_seed,reason\n";
}

std::string CollectedCsvLine(const CollectedEpisode& episode) {
  return fmt::format("{},{},{},{},{},{},{},{},{},{},{},{},{},{},{},{},{}\n", episode.index, episode.task,
                     episode.episode, episode.initial_state, Cell(episode.behaviour), episode.policy,
                     Cell(Sentence(episode.parameters)), Cell(episode.without), episode.success ? 1 : 0, episode.fate,
                     episode.stop, episode.frames, episode.contact_frames, episode.state_seed, episode.world_seed,
                     episode.policy_seed, Cell(episode.reason));
}

fs::path RowPath(const TreePlace& place) { return place.root / "rows" / place.task / (place.episode + ".json"); }

fs::path TruthPath(const TreePlace& place) {
  return place.root / "truth" / place.task / (place.episode + ".safetensors");
}

void WriteTruth(const fs::path& path, const EpisodeTruth& truth) {
  MakeFolders(path.parent_path());
  const auto frames = static_cast<std::int64_t>(truth.contact.size()), views = std::ssize(truth.cameras);
  const TensorView tensors[] = {View("object_px", TensorType::kF32, {frames, views, 2}, truth.object_px.data()),
                                View("contact", TensorType::kU8, {frames}, truth.contact.data())};
  WriteTensorFile(path, tensors, {{"format", "evac-truth"},
                                  {"version", "1"},
                                  {"cameras", Joined(truth.cameras)}});
}

EpisodeTruth ReadTruth(const fs::path& path, std::size_t frames, const std::vector<Camera>& cameras) try {
  const TensorFile file = TensorFile::Open(path);
  EpisodeTruth truth;
  for (const Camera& camera : cameras) truth.cameras.push_back(camera.name);
  const std::vector<std::string> found = CamerasOf(file, truth.cameras);
  const std::vector<std::size_t> columns = ColumnsOf(truth.cameras, found, file.name());
  const auto t = static_cast<std::int64_t>(frames);
  truth.contact = Numbers<std::uint8_t>(file, {"contact", TensorType::kU8, {t}});
  EpisodeTruth whole{found, Numbers<float>(file, {"object_px", TensorType::kF32, {t, std::ssize(found), 2}}), {}};
  for (std::size_t frame = 0; frame < frames; ++frame) {
    for (const std::size_t column : columns) {
      const float* at_px = whole.At(frame, column);
      truth.object_px.insert(truth.object_px.end(), {at_px[0], at_px[1]});
    }
  }
  return truth;
} catch (const TensorError& error) {
  throw InvalidInput("{}", error.what());
}

std::optional<TreePlace> PlaceOf(const fs::path& folder) {
  const fs::path observations = folder.parent_path().parent_path();
  if (observations.filename() != "observations") return std::nullopt;
  return TreePlace{observations.parent_path(), folder.parent_path().filename().string(), folder.filename().string()};
}

std::optional<CollectedEpisode> RowOf(const fs::path& folder) {
  const std::optional<TreePlace> place = PlaceOf(folder);
  std::error_code error;
  if (!place || (!fs::exists(RowPath(*place), error) && !error)) return std::nullopt;
  return ParseCollected(ReadFile(RowPath(*place)), RowPath(*place).string());
}

}  // namespace evac
