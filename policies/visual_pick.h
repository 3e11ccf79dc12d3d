#pragma once

#include <map>
#include <string>
#include <vector>

#include "core/policy.h"
#include "policies/visual_episode.h"

namespace evac {

/// A policy without learning that sees images only: finds a thing of known colour and shape with the head camera, goes
/// above it, looks again with the wrist camera, takes it, carries it to where it belongs, lets go, and rests.
/// What it knows of its tasks is in visual_things.cpp; how it goes about them in visual_episode.h; docs/visual_pick.md.
///
/// Its noise is a function of (Reset's seed, number of the request since Reset). Cameras may have any size.
class VisualPick : public Policy {
 public:
  /// @throws InvalidInput as Check(options) does.
  explicit VisualPick(const VisualPickOptions& options);

  std::string Name() const override { return "visual_pick"; }

  /// The right arm works; a left one stays where it is and goes on holding what it holds.
  /// @throws InvalidInput for a task it does not know or without a camera named "head".
  void Reset(SceneId scene, const Task& task, std::uint64_t seed) override;

  std::vector<Acted> Act(std::span<const SceneObservation> batch) override;

 private:
  VisualPickOptions options_;
  std::map<SceneId, VisualEpisode> episodes_;
};

}  // namespace evac
