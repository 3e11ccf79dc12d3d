#include "apps/networks/pack.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <map>
#include <nlohmann/json.hpp>
#include <optional>

#include "apps/warnings.h"
#include "apps/work_share.h"
#include "core/error.h"
#include "core/file.h"
#include "core/hash.h"
#include "core/names.h"
#include "core/seed.h"
#include "core/store_lock.h"
#include "core/version.h"
#include "reports/csv.h"
#include "worldmodel/clip.h"
#include "worldmodel/evac_config.h"
#include "worldmodel/nn/threads.h"
#include "worldmodel/shard_writer.h"

namespace evac {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;

constexpr double kRawFrames_hz = 30;  // of the statistics
constexpr double kLagToTell_frames = 0.2;
constexpr double kHalfClosed = 0.5;

/// One clip to be made: which recording, and which of its crops.
struct PlannedClip {
  std::size_t source = 0;
  int crop = 0;
};

struct PlannedShard {
  bool holds_out = false;
  std::vector<PlannedClip> clips;
};

/// Everything that is decided before the first shard is made.
struct Packing {
  SourceOptions how;
  std::vector<PackSource> sources;
  std::vector<LeftOut> left_out;
  std::vector<std::string> tasks;
  std::string arms_read;  ///< told or measured: what its actions are
  ClipOptions clip;
  std::vector<PlannedShard> shards;
  std::string recipe;  ///< SHA-256 of all that it is made from
};

void Tell(const std::string& line) { std::fputs((line + "\n").c_str(), stderr); }

bool HoldsOut(const PackSource& source, const PackArguments& arguments) {
  return SplitMix64(SeedFor(SeedFor(arguments.seed, "hold-out"), source.state)).Uniform() < arguments.hold_out;
}

std::vector<std::string> ViewsOf(const std::vector<fs::path>& folders, const PackArguments& arguments,
                                 const SourceOptions& how) try {
  return ChooseViews(folders, how);
} catch (const Error& error) {
  if (error.exit_code() != ExitCode::kInvalidInput) throw;
  if (error.kind() == std::string_view("few_cameras"))
    throw InvalidInput("{}: {}", arguments.config.string(), error.what());
  throw InvalidInput("{}; --cameras names others", error.what());
}

/// Looks at every recording, several at a time; what cannot be packed is left out.
void LookAtAll(const PackArguments& arguments, Packing& packing) {
  std::vector<fs::path> folders;
  for (const fs::path& input : arguments.inputs) {
    const std::vector<fs::path> found = FindRecordings(input);
    folders.insert(folders.end(), found.begin(), found.end());
    SayPassedOver(input);
  }
  packing.how.cameras = ViewsOf(folders, arguments, packing.how);
  std::vector<Looked> looked(folders.size());
  CountProgress progress("recordings looked at", static_cast<std::int64_t>(folders.size()), 0);
  ShareOut(
      static_cast<std::int64_t>(folders.size()), arguments.jobs,
      [&](std::int64_t i) {
        const auto at = static_cast<std::size_t>(i);
        looked[at] = LookAt(folders[at], packing.how);
      },
      [&](std::int64_t) { progress.Count(); });
  for (Looked& one : looked) {
    if (one.source) {
      packing.sources.push_back(*std::move(one.source));
    } else {
      packing.left_out.push_back(std::move(one.left_out));
    }
  }
}

std::size_t ArmsOf(const PackSource& source) { return source.track.front().size(); }

/// One robot per packing: as many arms in all recordings as in most of them; the first decides between equals.
void LeaveOutOtherRobots(Packing& packing) {
  std::map<std::size_t, int> recordings;  // by their number of arms
  for (const PackSource& source : packing.sources) ++recordings[ArmsOf(source)];
  std::size_t wanted = 0;
  for (const PackSource& source : packing.sources) {
    if (wanted == 0 || recordings[ArmsOf(source)] > recordings[wanted]) wanted = ArmsOf(source);
  }
  std::erase_if(packing.sources, [&](const PackSource& source) {
    const std::size_t found = ArmsOf(source);
    if (found == wanted) return false;
    packing.left_out.push_back({source.folder, "other_robot",
                                fmt::format("{}: {} arms, wanted {} as in {} recordings", source.folder.string(), found,
                                            wanted, recordings[wanted])});
    return true;
  });
}

/// Says how many were left out. @throws InvalidInput if that is all of them
void SayLeftOut(const Packing& packing) {
  if (!packing.left_out.empty()) Tell(CountByKind(packing.left_out));
  if (packing.sources.empty())
    throw InvalidInput("no recording can be packed; the last one: {}", packing.left_out.back().sentence);
}

/// @throws InvalidInput if the choice was left open and would be told in some recordings and measured in others
std::string ArmsRead(ArmsKind asked, const std::vector<PackSource>& sources) {
  if (asked != ArmsKind::kAuto) return asked == ArmsKind::kTold ? "told" : "measured";
  const auto is_collected = [](const PackSource& source) { return source.row.has_value(); };
  const auto collected = std::find_if(sources.begin(), sources.end(), is_collected),
             other = std::find_if_not(sources.begin(), sources.end(), is_collected);
  if (collected != sources.end() && other != sources.end())
    throw InvalidInput("{} is of a collection, whose arms would be told, {} is not, whose would be measured: "
                       "wanted --arms told or --arms measured for all",
                       collected->folder.string(), other->folder.string());
  return collected != sources.end() ? "told" : "measured";
}

/// Told arms are drawn, and carry their cameras, where the network's page says that they are seen.
void SayLag(const LagSums& lag, const Packing& packing) {
  const double page_frames = packing.clip.pose_map.lag_frames;
  if (packing.arms_read == "measured" && page_frames > 0)
    Tell(fmt::format("evac: warning: the arms packed are measured ones, and pose_map.lag_frames is {}, which is for "
                     "told ones: pose maps and moving cameras are drawn that late; wanted 0, or --arms told",
                     page_frames));
  const std::optional<double> frames = lag.Frames();
  if (!frames) return;
  Tell(fmt::format("arms are {:.2f} frames behind what they are told; pose_map.lag_frames is {}{}", *frames, page_frames,
                   std::abs(*frames - page_frames) > kLagToTell_frames
                       ? ": pictures and pose maps do not lie on each other"
                       : ""));
}

/// A gripper that is told or measured in another unit reads as one that never closes, and nothing is learned of grasps.
void SayGrippers(const Packing& packing) {
  double furthest = 0;
  for (const PackSource& source : packing.sources) {
    for (const Arms& arms : source.track) {
      for (const ArmState& arm : arms) furthest = std::max(furthest, arm.closure);
    }
  }
  if (furthest >= kHalfClosed) return;
  Tell(fmt::format("evac: warning: no hand of any recording closes by half (the furthest is {:.2g} of the way): wanted "
                   "state/effector/position from 0 (open) to 120 (closed), action/effector/position from 0 to 1",
                   furthest));
}

void MeasureMotion(const PackArguments& arguments, Packing& packing) {
  MotionSums sums;
  LagSums lag;
  for (PackSource& source : packing.sources) {
    if (HoldsOut(source, arguments)) continue;
    sums.Add(source.track);
    lag.Add(source.lag);
  }
  SayLag(lag, packing);
  packing.clip.delta_frames = arguments.period_s * kRawFrames_hz;
  packing.clip.statistics = arguments.statistics.empty() ? sums.Statistics("packed", packing.clip.delta_frames)
                                                         : ReadActionStatistics(arguments.statistics);
}

template <typename T>
void Shuffle(std::vector<T>& items, SplitMix64 random) {
  for (std::size_t i = items.size(); i > 1; --i) std::swap(items[i - 1], items[random.Below(i)]);
}

/// Of its pictures and maps.
double Megabytes(const PlannedClip& clip, const Packing& packing) {
  const double pictures = static_cast<double>(packing.sources[clip.source].frames * packing.how.cameras.size() * 2);
  return pictures * packing.clip.picture_px.area() * 3 / 1e6;
}

void PlanShards(const PackArguments& arguments, Packing& packing) {
  for (const bool holds_out : {false, true}) {
    std::vector<PlannedClip> clips;
    for (std::size_t i = 0; i < packing.sources.size(); ++i) {
      if (HoldsOut(packing.sources[i], arguments) != holds_out) continue;
      for (int crop = 0; crop < (holds_out ? 1 : arguments.crops); ++crop) clips.push_back({i, crop});
    }
    Shuffle(clips, SplitMix64(SeedFor(SeedFor(arguments.seed, "order of clips"), holds_out ? 1 : 0)));
    double megabytes = 0;
    std::size_t room = 0;  // for so many clips more
    for (const PlannedClip& clip : clips) {
      const double own = Megabytes(clip, packing);
      if (room == 0 || megabytes + own > arguments.shard_mb) {
        packing.shards.push_back({holds_out, {}});
        room = static_cast<std::size_t>(arguments.clips_per_shard);
        megabytes = 0;
      }
      packing.shards.back().clips.push_back(clip);
      --room;
      megabytes += own;
    }
  }
}

/// Trainings learn from one split and are measured on the other. No hold-out is meant by --holdout 0 alone.
void SayEmptySplit(const PackArguments& arguments, const Packing& packing) {
  const auto held_out = std::ranges::count_if(packing.shards, &PlannedShard::holds_out);
  const bool lacks_holdout = held_out == 0 && arguments.hold_out > 0;
  const bool lacks_train = held_out == std::ssize(packing.shards);
  if (!lacks_holdout && !lacks_train) return;
  Tell(fmt::format("evac: warning: {} of {} recordings is held out by --holdout {}, and trainings want some on either "
                   "side: wanted a {} --holdout, or another --seed",
                   lacks_train ? "every one" : "none", packing.sources.size(), arguments.hold_out,
                   lacks_train ? "smaller" : "larger"));
}

std::string RecipeOf(const PackArguments& arguments, const Packing& packing) {
  std::string all =
      fmt::format("evac-shard 1 seed {} crops {} hold-out {} clips {} period {} size {}x{} maps {} arms {}",
                  arguments.seed, arguments.crops, arguments.hold_out, arguments.clips_per_shard, arguments.period_s,
                  packing.clip.picture_px.width, packing.clip.picture_px.height, PoseMapWords(packing.clip.pose_map),
                  packing.arms_read);
  if (arguments.shard_mb != kShardMb) all += fmt::format(" shard MB {}", arguments.shard_mb);
  for (const std::string& camera : packing.how.cameras) all += " " + camera;
  for (const PackSource& source : packing.sources) all += "\n" + source.name + " " + source.sha256;
  return Sha256Hex(all + "\n" + StatisticsPage(packing.clip.statistics));
}

/// The tasks, sorted. Metadata have them with commas between them: a name with one in it would be two tasks' there.
std::vector<std::string> TasksOf(const std::vector<PackSource>& sources) {
  std::vector<std::string> tasks;
  for (const PackSource& source : sources) {
    if (source.task.find(',') != std::string::npos)
      throw InvalidInput("{}: its task is called '{}', wanted a name without a comma: rename the task's folder",
                         source.folder.string(), source.task);
    tasks.push_back(source.task);
  }
  std::sort(tasks.begin(), tasks.end());
  tasks.erase(std::unique(tasks.begin(), tasks.end()), tasks.end());
  return tasks;
}

Packing Plan(const PackArguments& arguments) {
  const nn::ModelConfig config = ReadEvacConfig(arguments.config);
  if (!arguments.cameras.empty() && std::ssize(arguments.cameras) != config.views)
    throw InvalidInput("--cameras: {} cameras, wanted {}, one for each view of {}", arguments.cameras.size(),
                       config.views, arguments.config.string());
  Packing packing;
  packing.how = {arguments.period_s, arguments.cameras, static_cast<std::size_t>(config.views), arguments.arms,
                 static_cast<std::size_t>(config.chunk + 1)};
  packing.clip.picture_px = {static_cast<int>(config.image_width_px), static_cast<int>(config.image_height_px)};
  packing.clip.pose_map = PoseMapOptions::Of(config);
  LookAtAll(arguments, packing);
  LeaveOutOtherRobots(packing);
  SayLeftOut(packing);
  packing.arms_read = ArmsRead(arguments.arms, packing.sources);
  packing.tasks = TasksOf(packing.sources);
  SayGrippers(packing);
  MeasureMotion(arguments, packing);
  PlanShards(arguments, packing);
  SayEmptySplit(arguments, packing);
  packing.recipe = RecipeOf(arguments, packing);
  return packing;
}

fs::path ShardPath(const fs::path& out, std::size_t number) {
  return out / fmt::format("shard_{:05}.safetensors", number);
}

/// OUT/packing.json says which packing the shards beside it are of, and which evac began it.
void Claim(const PackArguments& arguments, const Packing& packing) {
  const fs::path path = arguments.out / "packing.json";
  const Json page = {{"format", "evac-packing"},
                     {"recipe", packing.recipe},
                     {"shards", packing.shards.size()},
                     {"evac_version", EVAC_VERSION}};
  if (!fs::exists(path)) return WriteFileAtomically(path, page.dump(1) + "\n");
  const Json before = Json::parse(ReadFile(path), nullptr, /*allow_exceptions=*/false);
  for (const char* field : {"format", "recipe", "shards"}) {
    if (before.is_object() && before.contains(field) && before[field] == page[field]) continue;
    throw InvalidInput("{}: holds shards of other recordings or options, wanted recipe {}; choose another --out",
                       path.string(), packing.recipe);
  }
  const auto began = before.find("evac_version");
  SayIfAnotherVersionBegan(arguments.out, began != before.end() && began->is_string() ? began->get<std::string>() : "");
}

Clip Make(const PlannedClip& planned, const PackArguments& arguments, const Packing& packing) {
  const PackSource& source = packing.sources[planned.source];
  const Recording recording = ReadForPacking(source.folder, packing.how);
  std::optional<EpisodeTruth> truth;
  if (source.row) truth = ReadTruth(TruthPath(*PlaceOf(source.folder)), source.frames, recording.cameras);
  const ClipSource read = ReadClipSource(recording, truth ? &*truth : nullptr);
  const cv::Size picture_px = read.pictures.front().front().size();
  SplitMix64 random(
      SeedFor(SeedFor(SeedFor(arguments.seed, "crop"), source.name), static_cast<std::uint64_t>(planned.crop)));
  const Crop crop =
      planned.crop == 0 ? Crop{0, 0, picture_px.width, picture_px.height} : RandomCrop(picture_px, random);
  Clip clip = MakeClip(read, crop, packing.clip);
  clip.recording = static_cast<std::int64_t>(planned.source);
  clip.task = static_cast<std::int32_t>(std::find(packing.tasks.begin(), packing.tasks.end(), source.task) -
                                        packing.tasks.begin());
  clip.outcome = static_cast<std::int8_t>(!source.row ? -1 : source.row->success ? 1 : 0);
  return clip;
}

TensorMetadata MetadataOf(std::size_t number, const PackArguments& arguments, const Packing& packing) {
  const bool one_arm = ArmsOf(packing.sources.front()) == 1;
  return {{"split", packing.shards[number].holds_out ? "holdout" : "train"},
          {"period_s", fmt::format("{}", arguments.period_s)},
          {"height_px", std::to_string(packing.clip.picture_px.height)},
          {"width_px", std::to_string(packing.clip.picture_px.width)},
          {"cameras", Joined(packing.how.cameras)},
          {"arms", one_arm ? "right" : "left,right"},
          {"arms_read", packing.arms_read},
          {"tasks", Joined(packing.tasks)},
          {"pose_map", PoseMapWords(packing.clip.pose_map)},
          {"delta_frames", fmt::format("{}", packing.clip.delta_frames)},
          {"statistics", StatisticsPage(packing.clip.statistics)},
          {"recipe", packing.recipe},
          {"shard", std::to_string(number)},
          {"shards", std::to_string(packing.shards.size())}};
}

void MakeShard(std::size_t number, const PackArguments& arguments, const Packing& packing) {
  std::vector<Clip> clips;
  for (const PlannedClip& planned : packing.shards[number].clips) clips.push_back(Make(planned, arguments, packing));
  WriteShard(ShardPath(arguments.out, number), clips, packing.clip.picture_px, MetadataOf(number, arguments, packing));
}

void WriteLists(const PackArguments& arguments, const Packing& packing) {
  std::string table = "folder,kind,sentence\n";
  for (const LeftOut& one : packing.left_out) table += CsvLine({one.folder.string(), one.kind, one.sentence});
  WriteFileAtomically(arguments.out / "left_out.csv", table);
  WriteFileAtomically(arguments.out / "statistics.yaml", StatisticsPage(packing.clip.statistics));
}

void WriteIndex(const PackArguments& arguments, const Packing& packing) {
  Json shards = Json::array(), recordings = Json::array();
  for (std::size_t number = 0; number < packing.shards.size(); ++number) {
    const PlannedShard& shard = packing.shards[number];
    std::size_t frames = 0;
    for (const PlannedClip& clip : shard.clips) frames += packing.sources[clip.source].frames;
    const fs::path path = ShardPath(arguments.out, number);
    shards.push_back({{"file", path.filename().string()},
                      {"split", shard.holds_out ? "holdout" : "train"},
                      {"clips", shard.clips.size()},
                      {"frames", frames},
                      {"sha256", Sha256HexOfFile(path)}});
  }
  Json states = Json::array(), behaviours = Json::array(), fates = Json::array();
  for (const PackSource& source : packing.sources) {
    recordings.push_back(source.name);
    states.push_back(source.state);
    behaviours.push_back(source.row ? source.row->behaviour : "");
    fates.push_back(source.row ? source.row->fate : "");
  }
  const Json page = {{"format", "evac-shards"},    {"version", 1},        {"recipe", packing.recipe},
                     {"tasks", packing.tasks},     {"recordings", recordings}, {"states", states},
                     {"behaviours", behaviours},   {"fates", fates},      {"shards", shards}};
  WriteFileAtomically(arguments.out / "shards.json", page.dump(1, ' ', false, Json::error_handler_t::replace) + "\n");
}

}  // namespace

void Pack(const PackArguments& arguments) {
  const Packing packing = Plan(arguments);
  MakeFolders(arguments.out);
  const RunLock lock(arguments.out / "lock");
  Claim(arguments, packing);
  WriteLists(arguments, packing);
  std::vector<std::size_t> todo;
  for (std::size_t number = 0; number < packing.shards.size(); ++number) {
    if (!fs::exists(ShardPath(arguments.out, number))) todo.push_back(number);
  }
  const auto count = static_cast<std::int64_t>(todo.size()), total = static_cast<std::int64_t>(packing.shards.size());
  CountProgress progress("shards", total, total - count);
  const nn::LibraryThreads one_thread(1);
  ShareOut(
      count, arguments.jobs,
      [&](std::int64_t i) {
        nn::UseLibraryThreadsHere(1);
        MakeShard(todo[static_cast<std::size_t>(i)], arguments, packing);
      },
      [&](std::int64_t) { progress.Count(); });
  WriteIndex(arguments, packing);
  Tell(fmt::format("{} recordings in {} shards in {}", packing.sources.size(), total, arguments.out.string()));
}

}  // namespace evac
