#include "apps/networks/packed_clips.h"

#include <algorithm>
#include <iterator>
#include <map>
#include <nlohmann/json.hpp>
#include <set>

#include "core/error.h"
#include "core/file.h"
#include "core/names.h"

namespace evac {
namespace {

using nlohmann::json;

/// shards.json, one entry per recording.
struct Recordings {
  std::vector<std::string> states, behaviours, fates;
};

Recordings ReadRecordings(const std::filesystem::path& path) try {
  const json page = json::parse(ReadFile(path));
  Recordings recordings;
  page.at("states").get_to(recordings.states);
  page.at("behaviours").get_to(recordings.behaviours);
  page.at("fates").get_to(recordings.fates);
  if (recordings.behaviours.size() != recordings.states.size() || recordings.fates.size() != recordings.states.size())
    throw InvalidInput("{}: {} states, {} behaviours and {} fates, wanted as many of each", path.string(),
                       recordings.states.size(), recordings.behaviours.size(), recordings.fates.size());
  return recordings;
} catch (const json::exception& error) {
  throw InvalidInput("{}: {}; wanted states, behaviours and fates per recording, as `evac pack` writes them",
                     path.string(), error.what());
}

/// `clip_id` of one shard, one per clip.
at::Tensor ClipIds(const std::filesystem::path& shard) {
  const nn::MappedTensors file(TensorFile::Open(shard));
  const at::Tensor ids = file.Get("clip_id");
  nn::CheckShape(shard.string() + ": clip_id", ids, {std::max<std::int64_t>(0, file.Get("clip_start").numel() - 1)});
  return ids.to(at::kLong).clone();
}

/// The initial states of one packing.
struct SplitStates {
  std::set<std::string> learned, held_out;
};

SplitStates StatesOf(const std::filesystem::path& folder) {
  const std::vector<std::string> states = ReadRecordings(folder / "shards.json").states;
  SplitStates split;
  for (const std::filesystem::path& shard : train::ShardPaths(folder)) {
    const TensorFile file = TensorFile::Open(shard);
    const auto split_said = file.metadata().find("split");
    const bool holds_out = split_said != file.metadata().end() && split_said->second == "holdout";
    const at::Tensor ids = ClipIds(shard);
    for (std::int64_t i = 0; i < ids.size(0); ++i) {
      const auto recording = ids.data_ptr<std::int64_t>()[i];
      if (recording < 0 || recording >= std::ssize(states))
        throw InvalidInput("{}: a clip of recording {}, wanted below {}", shard.string(), recording, states.size());
      (holds_out ? split.held_out : split.learned).insert(states[static_cast<std::size_t>(recording)]);
    }
  }
  return split;
}

/// @param learner, keeper  folders of the states
void CheckHoldout(const std::string& learner, const std::set<std::string>& learned, const std::string& keeper,
                  const std::set<std::string>& held_out) {
  std::vector<std::string> both;
  std::ranges::set_intersection(learned, held_out, std::back_inserter(both));
  if (both.empty()) return;
  throw InvalidInput("{}: {} of the {} initial states that {} holds out are learned from here, as {}: wanted packings "
                     "of one --seed and one --holdout",
                     learner, both.size(), held_out.size(), keeper, both.front());
}

}  // namespace

void CheckHoldouts(const train::ShardFolders& folders) {
  std::map<std::filesystem::path, SplitStates> packings;
  for (const std::filesystem::path& folder : folders) packings[folder];
  if (packings.size() < 2) return;
  for (auto& [folder, states] : packings) states = StatesOf(folder);
  for (const auto& [learner, learns] : packings) {
    for (const auto& [keeper, keeps] : packings)
      CheckHoldout(learner.string(), learns.learned, keeper.string(), keeps.held_out);
  }
}

void CheckSides(std::int64_t height_px, std::int64_t width_px) {
  const auto fits = [](std::int64_t side_px) { return side_px >= 8 && side_px <= 4096 && side_px % 8 == 0; };
  if (!fits(height_px) || !fits(width_px))
    throw InvalidInput("the clips' pictures are {}x{}, wanted multiples of 8, at most 4096, on the page of sizes that "
                       "`evac pack` is given",
                       width_px, height_px);
}

PackedSet::PackedSet(const train::ShardFolders& folders, train::Split split) : shards(folders, split) {
  tasks = NamesIn(shards.metadata().at("tasks"));
  cameras = NamesIn(shards.metadata().at("cameras"));
  std::map<std::filesystem::path, Recordings> of_folder;
  for (const std::filesystem::path& folder : folders) {
    const std::filesystem::path page = folder / "shards.json";
    of_folder[page.parent_path()] = ReadRecordings(page);  // as its shards' paths say it, without a last slash
  }
  std::vector<at::Tensor> ids;
  std::vector<bool> is_again;
  std::set<std::filesystem::path> seen;
  for (const train::Shard& shard : shards.shards()) {
    ids.push_back(ClipIds(shard.path));
    const auto folder = std::filesystem::weakly_canonical(shard.path.parent_path());
    is_again.push_back(!seen.insert(folder / shard.path.filename()).second);
  }
  std::vector<std::int64_t> in_shard(shards.shards().size(), 0);
  for (const train::Clip& clip : shards.clips()) {
    const Recordings& recordings = of_folder.at(shards.shards()[clip.shard].path.parent_path());
    const std::int64_t recording = ids[clip.shard][in_shard[clip.shard]++].item<std::int64_t>();
    const auto at = static_cast<std::size_t>(recording);
    if (recording < 0 || at >= recordings.states.size() || clip.task < 0 ||
        static_cast<std::size_t>(clip.task) >= tasks.size())
      throw InvalidInput("{}: a clip of recording {} and task {}, wanted below {} and {}",
                         shards.shards()[clip.shard].path.string(), recording, clip.task, recordings.states.size(),
                         tasks.size());
    clips.push_back({clip, recording, "", recordings.states[at], recordings.behaviours[at], recordings.fates[at],
                     is_again[clip.shard]});
  }
}

}  // namespace evac
