#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "core/recording_writer.h"

namespace evac {

/// What is known of one collected episode beside its recording: a row of the manifest (docs/collect.md).
struct CollectedEpisode {
  std::int64_t index = 0;     ///< in the collection, from 0
  std::string task, episode;  ///< folder names in the tree
  std::string initial_state;  ///< "collect-7-00012": episodes that share it began alike
  std::uint64_t state_seed = 0, world_seed = 0, policy_seed = 0;
  std::string behaviour;                    ///< entry of the recipe's mix
  std::string policy;                       ///< visual_pick, explorer, learned
  std::map<std::string, double> parameters; ///< of the policy, as drawn for this episode
  std::string without;                      ///< the body that was taken away, or empty
  bool success = false;                     ///< by the oracle
  std::string fate;                         ///< judges/attempt.h, or diverged
  std::string reason;                       ///< the oracle's sentence, or how the physics failed
  std::string stop;                         ///< still, max_chunks or diverged
  int frames = 0;          ///< 0 if it diverged, and only then: there is no recording
  int contact_frames = 0;  ///< of those, near a touch, a grasp or a release
  int video_scale = 1;     ///< video pixels per pixel of the picture
};

/// One line of JSON, fields in a fixed order.
std::string CollectedJson(const CollectedEpisode& episode);
/// @param where  names the file in messages. @throws InvalidInput naming a missing or wrong field, or frames that do not
/// go with the stop.
CollectedEpisode ParseCollected(const std::string& json, const std::string& where);
/// A line of manifest.csv, and its heading.
std::string CollectedCsvHeading();
std::string CollectedCsvLine(const CollectedEpisode& episode);

/// What only physics knows, frame by frame.
struct EpisodeTruth {
  std::vector<std::string> cameras;   ///< V names, one per view
  std::vector<float> object_px;       ///< [T, V, 2]: x, y of the object's middle in pixels of the video; NaN behind it
  std::vector<std::uint8_t> contact;  ///< [T]: 1 near a touch, a grasp, a release, a hand that closes low

  float* At(std::size_t frame, std::size_t view) { return &object_px[(frame * cameras.size() + view) * 2]; }
  const float* At(std::size_t frame, std::size_t view) const {
    return &object_px[(frame * cameras.size() + view) * 2];
  }
};

/// ROOT/rows/<task>/<episode>.json, written last: the episode is whole. ROOT/truth/<task>/<episode>.safetensors.
std::filesystem::path RowPath(const TreePlace& place);
std::filesystem::path TruthPath(const TreePlace& place);

void WriteTruth(const std::filesystem::path& path, const EpisodeTruth& truth);
/// What is known of those cameras, in that order, whatever the file's.
/// A file that names none, of an earlier version, is of the task page's: it is taken to be of `cameras` if they are as
/// many, in the order head, hand_left, hand_right.
/// @throws InvalidInput if it is not of `frames` frames, or has nothing of one of the cameras.
EpisodeTruth ReadTruth(const std::filesystem::path& path, std::size_t frames, const std::vector<Camera>& cameras);

/// The row of the recording in `folder`, if that is an episode of a collection.
std::optional<CollectedEpisode> RowOf(const std::filesystem::path& folder);
/// Where a tree's episode folder belongs: ROOT/observations/<task>/<episode>.
std::optional<TreePlace> PlaceOf(const std::filesystem::path& folder);

}  // namespace evac
