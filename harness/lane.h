#pragma once

#include <optional>
#include <string>
#include <vector>

#include "core/policy.h"
#include "core/store.h"
#include "core/world.h"
#include "harness/job.h"
#include "harness/policy_latency.h"
#include "harness/still.h"

namespace evac {

/// What stays the same for all episodes of one RunEpisodes.
struct LaneOptions {
  int chunk_size = 8;         ///< targets executed per chunk; a policy's longer chunk is cut to it
  int policy_chunk_size = 8;  ///< targets a policy may answer
  PolicyLatency latency;      ///< what the world does while the policy thinks
  VideoOptions video;         ///< period_s is the task's
  bool film = true;                 ///< false: no video, and of each chunk only the last observation has images
  bool keep_initial_scene = false;  ///< the world is the real one: its first frames start the imagined episodes
};

/// One running episode: it gathers commands and observations, encodes the video while it runs, and knows when it is over.
/// Life: Begin, then {Command, Observe}… until `over`, then Finish. A failure at any point ends it with a reason.
class Lane {
 public:
  Lane(SceneId scene, Job job, const LaneOptions& options, Store& store);

  /// Resets both sides. What either throws is the episode's failure; what the disk refuses is thrown, and so is that
  /// what the world reads is another than when the suite was read (kChangedError).
  void Begin(Policy& policy, World& world);
  /// Takes the policy's answer: checks it, and asks the stop rule whether the episode has come to rest.
  void Command(const Acted& acted);
  /// Takes the world's answer to the chunk. @throws Error if the video cannot be written.
  void Observe(const Advanced& advanced);
  void Fail(const Failure& failure);
  /// The row, with its finished video.
  EpisodeRecord Finish();

  bool over() const { return over_; }
  SceneId scene() const { return scene_; }
  const Job& job() const { return job_; }
  const Observation& observation() const { return episode_.observations.back(); }
  const ActionChunk& chunk() const { return chunk_; }
  int chunks() const { return episode_.chunks; }

 private:
  void Stop(StopReason stop, const std::string& sentence);
  std::optional<WorldStep> ResetWorld(World& world);
  void Keep(const WorldStep& first);
  void Append(const WorldStep& step);
  std::vector<Arms> ObservedSinceLastChunk() const;

  SceneId scene_;
  Job job_;
  const LaneOptions& options_;
  Store& store_;
  Episode episode_;
  PrivilegedTrack privileged_;
  std::optional<VideoWriter> video_;
  cv::Mat last_frame_;
  ExecutedPlan plan_;
  ActionChunk chunk_;  ///< what is executed now: the chunk's part of the plan
  StillMeter still_;
  bool over_ = false;
};

}  // namespace evac
