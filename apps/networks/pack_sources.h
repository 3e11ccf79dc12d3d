#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "core/collection.h"
#include "core/recording.h"
#include "core/recording_folders.h"
#include "worldmodel/motion_statistics.h"

namespace evac {

/// Which arms are the actions: where they were told to be, or where they were measured.
enum class ArmsKind { kAuto, kTold, kMeasured };  ///< auto: told in our own collections, else measured, as the paper

/// How recordings are read for packing.
struct SourceOptions {
  double period_s = 0.1;             ///< of the clips: every nth recorded step is kept
  std::vector<std::string> cameras;  ///< empty: as many of the first recording's as `views` (ChooseViews)
  std::size_t views = 1;
  ArmsKind arms = ArmsKind::kAuto;
  std::size_t least_frames = 17;  ///< shorter recordings are left out
};

/// A recording that can be packed.
struct PackSource {
  std::filesystem::path folder;
  std::optional<CollectedEpisode> row;  ///< of a collection's episode
  std::string name;                     ///< <task>/<episode> of a tree, else the folder's
  std::string task, state;              ///< what is split: recordings that began alike
  std::size_t frames = 0;
  std::string sha256;                   ///< of all its files
  std::vector<Arms> track;              ///< the actions; emptied once the statistics are known
  LagSums lag;                          ///< of what was told, where that is what the track holds
};

struct LeftOut {
  std::filesystem::path folder;
  std::string kind;  ///< short_video, missing_camera, not_finite, …: docs/formats/recording.md
  std::string sentence;
};

/// The cameras that will be packed: those asked for, or the first of the first recording whose first ones can be read,
/// whatever is wrong with its others. @throws InvalidInput if there is none; called few_cameras where no recording has
/// so many, whatever is read
std::vector<std::string> ChooseViews(const std::vector<std::filesystem::path>& folders, const SourceOptions& options);

/// Reads a recording as it will be packed: that of a collection in the size of the pictures that its videos were drawn
/// from, whatever its recipe's video.scale. @throws Error with a kind.
Recording ReadForPacking(const std::filesystem::path& folder, const SourceOptions& options);

/// The recording, looked at from end to end, or why it is left out.
struct Looked {
  std::optional<PackSource> source;
  LeftOut left_out;
};
Looked LookAt(const std::filesystem::path& folder, const SourceOptions& options);

/// "2 recordings left out: 1 missing_camera, 1 short_video", or nothing.
std::string CountByKind(const std::vector<LeftOut>& left_out);

}  // namespace evac
