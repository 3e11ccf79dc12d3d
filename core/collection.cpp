#include "core/collection.h"

#include <cstring>
#include <nlohmann/json.hpp>
#include <span>

#include "core/error.h"
#include "core/file.h"
#include "core/tensor_file.h"

namespace evac {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;

/// 64 bits as text: JSON's numbers are doubles to most readers.
std::string Digits(std::uint64_t number) { return std::to_string(number); }

std::uint64_t Number(const std::string& digits) { return std::stoull(digits); }

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
  const Json page = Json::parse(json);
  CollectedEpisode episode;
  episode.index = page.at("index");
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
  episode.success = page.at("outcome").get<int>() == 1;
  episode.fate = page.at("fate");
  episode.reason = page.at("reason");
  episode.stop = page.at("stop");
  episode.frames = page.at("frames");
  episode.contact_frames = page.at("contact_frames");
  episode.video_scale = page.at("video_scale");
  if (episode.video_scale < 1 || episode.frames < 1) throw InvalidInput("{}: video_scale or frames below 1", where);
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
                     episode.episode, episode.initial_state, episode.behaviour, episode.policy,
                     Cell(Sentence(episode.parameters)), episode.without, episode.success ? 1 : 0, episode.fate,
                     episode.stop, episode.frames, episode.contact_frames, episode.state_seed, episode.world_seed,
                     episode.policy_seed, Cell(episode.reason));
}

fs::path RowPath(const TreePlace& place) { return place.root / "rows" / place.task / (place.episode + ".json"); }

fs::path TruthPath(const TreePlace& place) {
  return place.root / "truth" / place.task / (place.episode + ".safetensors");
}

void WriteTruth(const fs::path& path, const EpisodeTruth& truth) {
  MakeFolders(path.parent_path());
  const auto frames = static_cast<std::int64_t>(truth.contact.size()), views = static_cast<std::int64_t>(truth.views);
  const TensorView tensors[] = {View("object_px", TensorType::kF32, {frames, views, 2}, truth.object_px.data()),
                                View("contact", TensorType::kU8, {frames}, truth.contact.data())};
  WriteTensorFile(path, tensors, {{"format", "evac-truth"}, {"version", "1"}});
}

EpisodeTruth ReadTruth(const fs::path& path, std::size_t frames, std::size_t views) try {
  const TensorFile file = TensorFile::Open(path);
  const auto t = static_cast<std::int64_t>(frames), v = static_cast<std::int64_t>(views);
  return {views, Numbers<float>(file, {"object_px", TensorType::kF32, {t, v, 2}}),
          Numbers<std::uint8_t>(file, {"contact", TensorType::kU8, {t}})};
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
  if (!place || !fs::exists(RowPath(*place))) return std::nullopt;
  return ParseCollected(ReadFile(RowPath(*place)), RowPath(*place).string());
}

}  // namespace evac
