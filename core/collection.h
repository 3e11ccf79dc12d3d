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
  std::string fate;                         ///< judges/attempt.h
  std::string reason;                       ///< the oracle's sentence
  std::string stop;                         ///< still or max_chunks
  int frames = 0;
  int contact_frames = 0;  ///< of those, near a touch, a grasp or a release
  int video_scale = 1;     ///< video pixels per pixel of the picture
};

/// One line of JSON, fields in a fixed order.
std::string CollectedJson(const CollectedEpisode& episode);
/// @param where  names the file in messages. @throws InvalidInput naming a missing or wrong field.
CollectedEpisode ParseCollected(const std::string& json, const std::string& where);
/// A line of manifest.csv, and its heading.
std::string CollectedCsvHeading();
std::string CollectedCsvLine(const CollectedEpisode& episode);

/// What only physics knows, frame by frame.
struct EpisodeTruth {
  std::size_t views = 0;
  std::vector<float> object_px;       ///< [T, V, 2]: x, y of the object's middle in pixels of the video; NaN behind it
  std::vector<std::uint8_t> contact;  ///< [T]: 1 near a touch, a grasp, a release, a hand that closes low

  float* At(std::size_t frame, std::size_t view) { return &object_px[(frame * views + view) * 2]; }
  const float* At(std::size_t frame, std::size_t view) const { return &object_px[(frame * views + view) * 2]; }
};

/// ROOT/rows/<task>/<episode>.json, written last: the episode is whole. ROOT/truth/<task>/<episode>.safetensors.
std::filesystem::path RowPath(const TreePlace& place);
std::filesystem::path TruthPath(const TreePlace& place);

void WriteTruth(const std::filesystem::path& path, const EpisodeTruth& truth);
/// @throws InvalidInput if it is not of `frames` frames and `views` views.
EpisodeTruth ReadTruth(const std::filesystem::path& path, std::size_t frames, std::size_t views);

/// The row of the recording in `folder`, if that is an episode of a collection.
std::optional<CollectedEpisode> RowOf(const std::filesystem::path& folder);
/// Where a tree's episode folder belongs: ROOT/observations/<task>/<episode>.
std::optional<TreePlace> PlaceOf(const std::filesystem::path& folder);

}  // namespace evac
