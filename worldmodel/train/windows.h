#pragma once

#include <cstdint>
#include <vector>

#include "worldmodel/train/dice.h"
#include "worldmodel/train/shards.h"

/// Which frames a training sample of the world model is made of: as the reference (docs/evac_quirks.md) draws them, and
/// what was added (docs/train.md).
namespace evac::train {

/// Frames of one clip, counted from its first.
struct Window {
  const Clip* clip = nullptr;
  std::vector<std::int64_t> memory;  ///< N frames, newest last
  std::int64_t last = 0;             ///< the newest of them: frames last + 1 … last + chunk are to be imagined
  std::int64_t chunk = 0;            ///< K
  std::int64_t image = 0;            ///< what the image encoder sees
};

struct WindowOptions {
  std::int64_t chunk = 16;          ///< K
  std::int64_t memory = 4;          ///< N
  std::int64_t history = 48;        ///< how far back memory reaches when it is picked at random
  /// Of the samples that begin where rollouts do (frame 0, K, 2K, …) and remember what rollouts do (RolloutMemory).
  /// The paper: 0.
  double rollout_share = 0;
  double contact_share = 0;         ///< of the samples whose chunk holds a frame in contact. The paper: 0
  /// Of the samples in which a hand is told to close, in the chunk's first half or half a chunk before it: what comes of
  /// it is seen, and whether it holds something or not is no part of the choice. The paper: 0
  double closing_share = 0;
  /// Of the samples in which a hand that was closed is told to open, there likewise: where what it held falls is seen.
  /// Drawn of those that `closing_share` leaves. The paper: 0
  double opening_share = 0;
  bool successes_only = false;      ///< from clips that ended in success, as a lab that keeps no failures would have. The paper: both
  /// How many times as often windows of clips that ended in failure are drawn as others. The paper: 1
  double failure_weight = 1;
  bool first_image = false;         ///< the image encoder sees the oldest memory, as when imagining; else any of it
};

/// The memory of a rollout that has shown `last + 1` frames: the first N times, then every frame; of these the first,
/// others evenly spaced, and the newest, as when imagining (frame_memory.h).
std::vector<std::int64_t> RolloutMemory(std::int64_t last, std::int64_t memory);

class WindowSampler {
 public:
  /// @throws TensorError for options that make no window, or if no clip is long enough
  WindowSampler(const ShardSet& shards, const WindowOptions& options);
  Window Pick(Dice& dice) const;
  /// About `count` windows at rollout positions, evenly spaced over the set: for measuring.
  std::vector<Window> Spread(std::int64_t count) const;
  const WindowOptions& options() const { return options_; }

 private:
  struct Start {
    const Clip* clip;
    std::int64_t last;
  };
  /// Where windows of one kind begin: anywhere, and where a rollout's chunks do.
  struct Pool {
    std::vector<Start> any, rollout;
  };
  std::vector<std::int64_t> RandomMemory(std::int64_t last, Dice& dice) const;
  const Start& PickStart(const std::vector<Start>& starts, Dice& dice) const;
  void AddClip(const ShardSet& shards, const Clip& clip);

  WindowOptions options_;
  Pool all_, contact_, closing_, opening_;
};

}  // namespace evac::train
