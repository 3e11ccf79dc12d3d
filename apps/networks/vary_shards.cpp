#include "apps/networks/vary_shards.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <memory>
#include <mutex>
#include <nlohmann/json.hpp>
#include <span>

#include "apps/collect_episode.h"
#include "apps/networks/packed_clips.h"
#include "apps/networks/shard_rows.h"
#include "apps/variation.h"
#include "apps/warnings.h"
#include "apps/work_share.h"
#include "core/error.h"
#include "core/file.h"
#include "core/seed.h"
#include "core/store_lock.h"
#include "worldmodel/conditioning.h"
#include "worldmodel/nn/number_text.h"

namespace evac {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;

/// What came of one variant.
struct Variant {
  std::vector<float> actions, object_px;  ///< [T, 16], [T, V, 2]
  std::int8_t outcome = 0;
};

/// A collection, and which of its episodes the recordings of a packing are.
class VariedCollection {
 public:
  VariedCollection(const VaryArguments& arguments)
      : recipe_(ReadRecipe(arguments.recipe, arguments.assignments)), collection_(arguments.collection) {
    const fs::path path = arguments.shards / "shards.json", claim = collection_ / "collection.json";
    std::string made_by;
    try {
      json::parse(ReadFile(path)).at("recordings").get_to(names_);
      const json page = json::parse(ReadFile(claim));
      seed_ = std::stoull(page.at("seed").get<std::string>());
      page.at("recipe_sha256").get_to(made_by);
    } catch (const std::exception& error) {
      throw InvalidInput("{}: {}; wanted what `evac pack` and `evac collect` write: {} and {}", arguments.shards.string(),
                         error.what(), path.string(), claim.string());
    }
    if (made_by == recipe_.hash) return;
    throw InvalidInput(
        "{}: `evac collect` had the recipe {}, `evac vary` has {} by --recipe {} and --set: wanted the recipe of the "
        "collection, with the same --set and the pages, scenes and weights that it names as they were",
        claim.string(), made_by, recipe_.hash, arguments.recipe.string());
  }

  const Recipe& recipe() const { return recipe_; }

  /// @throws InvalidInput if the recipe would not have made that episode
  CollectJob JobOf(std::int64_t recording) const {
    if (recording < 0 || recording >= std::ssize(names_))
      throw InvalidInput("shards.json names {} recordings, a clip is of recording {}: wanted one of them", names_.size(), recording);
    const std::string& name = names_[static_cast<std::size_t>(recording)];
    const std::size_t slash = name.find('/');
    if (slash == std::string::npos) throw InvalidInput("recording '{}' is none of a collection's", name);
    const fs::path path = RowPath({collection_, name.substr(0, slash), name.substr(slash + 1)});
    if (!fs::exists(path)) throw InvalidInput("{} is not there: the shards are of another collection", path.string());
    const CollectedEpisode row = ParseCollected(ReadFile(path), path.string());
    CollectJob job = JobAt(recipe_, seed_, row.index);
    if (job.row.task != row.task || job.row.state_seed != row.state_seed || job.row.world_seed != row.world_seed ||
        job.row.behaviour != row.behaviour)
      throw InvalidInput(
          "{}: episode {} is '{}' of {}; by its recipe and seed it would be '{}' of {}: wanted a row of this version of "
          "evac",
          path.string(), row.index, row.behaviour, row.task, job.row.behaviour, job.row.task);
    return job;
  }

 private:
  Recipe recipe_;
  fs::path collection_;
  std::vector<std::string> names_;
  std::uint64_t seed_ = 0;
};

TensorMetadata MetadataOf(const VaryArguments& arguments, const fs::path& shard) {
  const auto file = TensorFile::Open(shard);
  return {{"format", "evac-variants"},
          {"version", "1"},
          {"recipe", file.metadata().at("recipe")},
          {"count", std::to_string(arguments.count)},
          {"seed", std::to_string(arguments.seed)}};
}

/// The clip's cameras, in pixels of its stored pictures.
std::vector<Camera> CamerasOf(const PackedSet& set, const PackedClip& clip, const Task& task) {
  std::vector<Camera> cameras;
  for (std::size_t view = 0; view < set.cameras.size(); ++view) {
    const Camera stored = CameraAt(set.shards.shards()[clip.shard], clip.first, static_cast<std::int64_t>(view));
    const auto found = std::ranges::find(task.cameras, set.cameras[view], &Camera::name);
    if (found == task.cameras.end()) throw InvalidInput("{}: has no camera '{}'", task.id, set.cameras[view]);
    Camera camera = *found;
    camera.width_px = stored.width_px;
    camera.height_px = stored.height_px;
    camera.fx_px = stored.fx_px;
    camera.fy_px = stored.fy_px;
    camera.cx_px = stored.cx_px;
    camera.cy_px = stored.cy_px;
    cameras.push_back(camera);
  }
  return cameras;
}

std::vector<float> PlacesOf(const CollectJob& job, const std::vector<Camera>& cameras, const PrivilegedTrack& track) {
  constexpr float kUnknown = std::numeric_limits<float>::quiet_NaN();
  std::vector<float> places;
  for (const PrivilegedFrame& frame : track) {
    for (const Camera& camera : cameras) {
      const auto at_px = ObjectIn(job, camera, frame);
      places.push_back(at_px ? static_cast<float>(at_px->x()) : kUnknown);
      places.push_back(at_px ? static_cast<float>(at_px->y()) : kUnknown);
    }
  }
  return places;
}

/// The first places are those that the shard has, or they are of different scenes.
void CheckBegins(const train::Shard& shard, const PackedClip& clip, const std::vector<float>& places) {
  const auto known = shard.object_px[clip.first].contiguous();
  constexpr float kSame_px = 0.05F;
  for (std::int64_t i = 0; i < known.numel(); ++i) {
    const float wanted = known.data_ptr<float>()[i], found = places[static_cast<std::size_t>(i)];
    if (std::isfinite(wanted) == std::isfinite(found) && !(std::abs(wanted - found) > kSame_px)) continue;
    throw InvalidInput("{}: a clip's object begins at {} px, and in its scene at {}: wanted the scenes that were recorded",
                       shard.path.string(), wanted, found);
  }
}

class Varier {
 public:
  Varier(const VaryArguments& arguments, const VariedCollection& collection, const PackedSet& set)
      : arguments_(arguments), collection_(collection), set_(set) {}

  std::vector<Variant> Vary(const PackedClip& clip, EpisodeRepeater& world) const {
    const CollectJob job = collection_.JobOf(clip.recording);
    std::vector<Variant> variants;
    if (job.behaviour->without_object) return variants;  // whatever is done, nothing comes of it
    const Task& task = TaskOf(job);
    const TensorMetadata& packing = set_.shards.metadata();
    if (const auto arms = packing.find("arms_read"); arms != packing.end() && arms->second == "measured")
      throw InvalidInput("{}: arms_read is measured, wanted told: what is varied is what the arms were told", arguments_.shards.string());
    const std::string& period_s = packing.at("period_s");
    double packed_s = 0;
    if (!nn::ParseNumber(period_s, packed_s) || std::abs(packed_s - task.period_s) > 1e-9)
      throw InvalidInput("{}: period_s is {}, wanted {} as {} has it", arguments_.shards.string(), period_s, task.period_s, task.id);
    const train::Shard& shard = set_.shards.shards()[clip.shard];
    const std::vector<Camera> cameras = CamerasOf(set_, clip, task);
    std::vector<Arms> told;
    for (std::int64_t row = clip.first; row < clip.first + clip.frames; ++row)
      told.push_back(ArmsOfRow(shard.actions[row].data_ptr<float>(), task.arms.size()));
    for (int i = 0; i < arguments_.count; ++i) {
      SplitMix64 random(
          SeedFor(SeedFor(SeedFor(arguments_.seed, "variant"), job.row.policy_seed), static_cast<std::uint64_t>(i)));
      const std::vector<Arms> varied = Varied(told, random);
      const auto run = world.Do(job, varied);
      if (!run) continue;
      Variant variant;
      for (const Arms& arms : varied) {
        const std::vector<float> row = ActionRow(arms);
        variant.actions.insert(variant.actions.end(), row.begin(), row.end());
      }
      variant.object_px = PlacesOf(job, cameras, run->track);
      variant.outcome = run->success ? 1 : 0;
      CheckBegins(shard, clip, variant.object_px);
      variants.push_back(std::move(variant));
    }
    return variants;
  }

 private:
  const VaryArguments& arguments_;
  const VariedCollection& collection_;
  const PackedSet& set_;
};

/// @param of_clips  of each of the shard's clips
void Write(const fs::path& path, const std::vector<std::vector<Variant>>& of_clips, std::int64_t views,
           const TensorMetadata& metadata) {
  std::vector<std::int64_t> clip, start = {0};
  std::vector<std::int8_t> outcome;
  std::vector<float> actions, object_px;
  for (std::size_t i = 0; i < of_clips.size(); ++i) {
    for (const Variant& variant : of_clips[i]) {
      clip.push_back(static_cast<std::int64_t>(i));
      outcome.push_back(variant.outcome);
      actions.insert(actions.end(), variant.actions.begin(), variant.actions.end());
      object_px.insert(object_px.end(), variant.object_px.begin(), variant.object_px.end());
      start.push_back(static_cast<std::int64_t>(actions.size() / 16));
    }
  }
  const auto view = [](const char* name, TensorType type, std::vector<std::int64_t> shape, const auto& values) {
    return TensorView{{name, type, std::move(shape)}, std::as_bytes(std::span(values))};
  };
  const auto count = static_cast<std::int64_t>(clip.size());
  const TensorView tensors[] = {view("clip", TensorType::kI64, {count}, clip),
                                view("start", TensorType::kI64, {count + 1}, start),
                                view("actions", TensorType::kF32, {start.back(), 16}, actions),
                                view("object_px", TensorType::kF32, {start.back(), views, 2}, object_px),
                                view("outcome", TensorType::kI8, {count}, outcome)};
  WriteTensorFile(path, tensors, metadata);
}

bool IsThere(const fs::path& path, const TensorMetadata& metadata) {
  return fs::exists(path) && TensorFile::Open(path).metadata() == metadata;
}

/// Which evac began the variants that are as these shall be.
void KeepWhoBeganVariants(const VaryArguments& arguments) {
  const bool is_begun = std::ranges::any_of(train::ShardPaths(arguments.shards), [&](const fs::path& shard) {
    return IsThere(train::VariantsPath(shard), MetadataOf(arguments, shard));
  });
  KeepWhoBegan(arguments.shards / "variants_begun_by", is_begun, "what is varied in " + arguments.shards.string());
}

/// Worlds that nobody works with.
class Worlds {
 public:
  explicit Worlds(const Recipe& recipe) : recipe_(recipe) {}

  std::unique_ptr<EpisodeRepeater> Take() {
    const std::lock_guard lock(mutex_);
    if (idle_.empty()) return std::make_unique<EpisodeRepeater>(recipe_);
    auto world = std::move(idle_.back());
    idle_.pop_back();
    return world;
  }
  void GiveBack(std::unique_ptr<EpisodeRepeater> world) {
    const std::lock_guard lock(mutex_);
    idle_.push_back(std::move(world));
  }

 private:
  const Recipe& recipe_;
  std::mutex mutex_;
  std::vector<std::unique_ptr<EpisodeRepeater>> idle_;  // guarded by mutex_
};

/// How many variants there are, and how many succeeded.
struct Counts {
  std::int64_t variants = 0, successes = 0;
};

Counts VarySplit(const VaryArguments& arguments, const VariedCollection& collection, train::Split split, Worlds& worlds) {
  const PackedSet set({arguments.shards}, split);
  const Varier varier(arguments, collection, set);
  Counts counts;
  CountProgress progress(split == train::Split::kTrain ? "clips" : "clips of the hold-out",
                         static_cast<std::int64_t>(set.clips.size()), 0);
  for (std::size_t s = 0; s < set.shards.shards().size(); ++s) {
    const train::Shard& shard = set.shards.shards()[s];
    std::vector<const PackedClip*> clips;
    for (const PackedClip& clip : set.clips) {
      if (clip.shard == s) clips.push_back(&clip);
    }
    const TensorMetadata metadata = MetadataOf(arguments, shard.path);
    if (IsThere(train::VariantsPath(shard.path), metadata)) {
      for (std::size_t i = 0; i < clips.size(); ++i) progress.Count();
      continue;
    }
    std::vector<std::vector<Variant>> variants(clips.size());
    ShareOut(
        static_cast<std::int64_t>(clips.size()), arguments.jobs,
        [&](std::int64_t i) {
          const auto at = static_cast<std::size_t>(i);
          auto world = worlds.Take();
          variants[at] = varier.Vary(*clips[at], *world);
          worlds.GiveBack(std::move(world));
        },
        [&](std::int64_t) { progress.Count(); });
    Write(train::VariantsPath(shard.path), variants, set.shards.views(), metadata);
    for (const auto& of_clip : variants) {
      counts.variants += std::ssize(of_clip);
      for (const Variant& variant : of_clip) counts.successes += variant.outcome;
    }
  }
  return counts;
}

}  // namespace

void VaryShards(const VaryArguments& arguments) {
  const VariedCollection collection(arguments);
  const RunLock lock(arguments.shards / "lock");
  KeepWhoBeganVariants(arguments);
  Worlds worlds(collection.recipe());
  Counts all;
  for (const train::Split split : {train::Split::kTrain, train::Split::kHoldout}) {
    if (!train::HasSplit(arguments.shards, split)) continue;
    const Counts counts = VarySplit(arguments, collection, split, worlds);
    all.variants += counts.variants;
    all.successes += counts.successes;
  }
  fmt::print("{}: {} new variants, {} of them successes\n", arguments.shards.string(), all.variants, all.successes);
}

}  // namespace evac
