#include "apps/networks/pack_sources.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>

#include "core/error.h"
#include "core/file.h"
#include "core/hash.h"

namespace evac {
namespace {

namespace fs = std::filesystem;

std::string HashOfFiles(const Recording& recording, const std::optional<CollectedEpisode>& row,
                        const fs::path& folder) {
  std::string all;
  for (const fs::path& file : recording.files) all += file.filename().string() + Sha256HexOfFile(file);
  if (row) all += CollectedJson(*row) + Sha256HexOfFile(TruthPath(*PlaceOf(folder)));
  return Sha256Hex(all);
}

/// An episode of a collection whose row is not written yet is not whole.
void RefuseUnfinished(const fs::path& folder) {
  const std::optional<TreePlace> place = PlaceOf(folder);
  std::error_code unknown;  // what cannot be looked at is told where it is read
  if (!place || !fs::exists(place->root / "collection.json", unknown) || fs::exists(RowPath(*place), unknown)) return;
  throw InvalidInput("{}: its collection has no row for it yet", folder.string()).Called("unfinished");
}

std::string TaskOf(const fs::path& folder, const std::optional<CollectedEpisode>& row) {
  if (row) return row->task;
  const std::optional<TreePlace> place = PlaceOf(folder);
  return place ? place->task : "recording";
}

PackSource Examine(const fs::path& folder, const SourceOptions& options) {
  RefuseUnfinished(folder);
  const Recording recording = ReadForPacking(folder, options);
  PackSource source;
  source.folder = folder;
  source.row = RowOf(folder);
  const std::optional<TreePlace> place = PlaceOf(folder);
  source.name = place ? place->task + "/" + place->episode : folder.filename().string();
  source.task = TaskOf(folder, source.row);
  source.state = source.row ? source.row->initial_state : source.name;
  source.track = ToldTrack(recording);
  source.frames = source.track.size();
  source.lag.Add(recording.told, recording.arms);
  if (source.frames < options.least_frames) {
    throw InvalidInput("{}: {} steps of {} s, wanted at least {}", folder.string(), source.frames, recording.period_s,
                       options.least_frames)
        .Called("too_short");
  }
  if (source.row) ReadTruth(TruthPath(*place), source.frames, recording.cameras);
  source.sha256 = HashOfFiles(recording, source.row, folder);
  return source;
}

}  // namespace

std::vector<std::string> ChooseViews(const std::vector<fs::path>& folders, const SourceOptions& options) {
  if (!options.cameras.empty()) return options.cameras;
  std::string why, most;
  std::size_t cameras = 0;
  for (const fs::path& folder : folders) {
    std::vector<std::string> names = CamerasIn(folder);
    if (names.size() > cameras) most = fmt::format("{} has {}", folder.string(), fmt::join(names, ", "));
    cameras = std::max(cameras, names.size());
    if (names.size() < options.views) continue;
    names.resize(options.views);
    try {
      ReadRecording(folder, {.cameras = names, .count_video_frames = false});
      return names;
    } catch (const Error& error) {
      why = fmt::format("the last one that could not: {}", error.what());
    }
  }
  if (cameras < options.views)
    throw InvalidInput(
        "field views: found {}, wanted as many as a recording has cameras: none of {} has more than {}{}",
        options.views, folders.size(), cameras, cameras == 0 ? "" : " (" + most + ")")
        .Called("few_cameras");
  throw InvalidInput("no recording's first {} cameras can be read; {}", options.views, why);
}

Recording ReadForPacking(const fs::path& folder, const SourceOptions& options) {
  const std::optional<CollectedEpisode> row = RowOf(folder);
  RecordingOptions how;
  how.cameras = options.cameras;
  how.read_told = options.arms == ArmsKind::kTold || (options.arms == ArmsKind::kAuto && row);
  Recording recording = Thinned(ReadRecording(folder, how), options.period_s);
  if (recording.videos.empty())
    throw InvalidInput("{}: there is no video, only a first frame", folder.string()).Called("no_video");
  if (how.read_told && recording.told.empty())  // a measured closure would tell what became of the grasp
    throw InvalidInput("{}: it does not say where the arms were told to be", folder.string()).Called("nothing_told");
  if (row && recording.every_nth > 1)
    throw InvalidInput("{}: a collection's episodes are packed at their own period", folder.string());
  if (row) recording = Shrunk(std::move(recording), row->video_scale);
  return recording;
}

Looked LookAt(const fs::path& folder, const SourceOptions& options) try {
  return {Examine(folder, options), {}};
} catch (const Error& error) {
  if (error.exit_code() != ExitCode::kInvalidInput) throw;
  return {std::nullopt, {folder, error.kind()[0] == '\0' ? "other" : error.kind(), error.what()}};
}

std::string CountByKind(const std::vector<LeftOut>& left_out) {
  if (left_out.empty()) return "";
  std::map<std::string, int> counts;
  for (const LeftOut& one : left_out) ++counts[one.kind];
  std::string text;
  for (const auto& [kind, count] : counts) text += fmt::format("{}{} {}", text.empty() ? "" : ", ", count, kind);
  return fmt::format("{} recordings left out: {}", left_out.size(), text);
}

}  // namespace evac
