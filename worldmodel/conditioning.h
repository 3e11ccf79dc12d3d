#pragma once

#include <array>
#include <cstdint>
#include <opencv2/core.hpp>
#include <span>
#include <vector>

#include "core/types.h"
#include "worldmodel/action_statistics.h"
#include "worldmodel/nn/model_config.h"
#include "worldmodel/pose_map.h"
#include "worldmodel/ray_map.h"

/// What the network is told of one chunk (EVAC, Sec. 3.2), in plain numbers: no tensors, nothing encoded.
namespace evac {

/// [frames][V]: RGB, the network's picture size unless said otherwise.
using Pictures = std::vector<std::vector<cv::Mat>>;

/// A frame as it is remembered: the network's own shorthand for the picture, and where the arms were.
struct RememberedFrame {
  std::vector<float> latent;  ///< [V, z, h, w], contiguous
  Arms arms;                  ///< imagined frames: the commanded ones
};

/// One episode on its way. Frames are kept as latents: nothing that was encoded or imagined is encoded again.
struct ImaginedScene {
  std::vector<Camera> cameras;          ///< V; intrinsics and size of the network's picture
  std::vector<RememberedFrame> frames;  ///< N times the first, then every frame that was executed; newest last
  std::vector<cv::Mat> first, newest;   ///< [V] CV_32FC3 in [-1, 1]: what the image encoder may be shown
  std::uint64_t seed = 0;               ///< of all noise of this episode
};

/// The network's reading of one step: 14 numbers, normalised (action_delta.h).
using DeltaRow = std::array<float, 14>;

struct ConditioningOptions {
  ActionStatistics statistics = AgiBotWorldStatistics();
  /// Frames of 30 Hz that one step spans: the statistics are per such frame. Training of the published network divided
  /// by 3 whatever lay between two frames (max_sep): that is what weights mean that do not say their period.
  double stride = 3;
  PoseMapOptions pose_map;
};

struct ChunkConditioning {
  std::vector<std::size_t> memory;        ///< N indices of ImaginedScene::frames, newest last
  std::vector<DeltaRow> deltas;           ///< [K]: from each frame to the next; to be replaced only by a quirk
  Pictures pose_maps;                     ///< [K][V]: of the frames to imagine alone
  std::vector<std::vector<RayMap>> rays;  ///< [N + K][V], latent pixels
  std::vector<float> arms;                ///< [N + K, 16]: ActionRow of each frame
  std::vector<float> turns;               ///< [N + K, nn::kTurnRow]: nn::HandTurns since the oldest memory
  std::size_t count = 0;                  ///< targets given, 1 … K: what lies beyond is padding
};

/// `targets` (1 … K; fewer are filled up: the arms rest at the last) after what `memory` shows. With one arm the other
/// is absent from the maps, and its deltas are those of an open gripper that does not move.
ChunkConditioning Condition(const ImaginedScene& scene, std::vector<std::size_t> memory, std::span<const Arms> targets,
                            const nn::ModelConfig& config, const ConditioningOptions& options);

/// Where arms are when they were told `before` a frame ago, are told `now`, and follow `lag_frames` (0 … 1) late: on the
/// straight way from one to the other.
Arms SeenArms(const Arms& before, const Arms& now, double lag_frames);

/// The maps of the arms at one moment, one per camera.
std::vector<cv::Mat> DrawPoseMaps(const Arms& arms, std::span<const Camera> cameras, const PoseMapOptions& options);

/// 16 numbers per step: xyz, quaternion xyzw, gripper (0 open … 120 closed), left then right; an absent arm: zeros and
/// (0, 0, 0, 1).
std::vector<float> ActionRow(const Arms& arms);

}  // namespace evac
