#pragma once

#include <Eigen/Geometry>
#include <map>
#include <memory>
#include <optional>

#include "core/policy.h"

namespace evac {

/// Another policy whose right hand strays from where it is told to go: what a world model is trained on should have more ways
/// of reaching for a thing than the policies that were at hand (after DART, arXiv 1703.09327: noise in the supervisor's
/// actions). What is told is what strays, so nothing is hidden from who learns from it.
///
/// The error is a smooth curve over the way that the hand was sent, not over time: it begins at nothing, and a hand that is
/// told to stay, stays. A policy that answers from where it sees its arm, and not with places, is pushed anew by each chunk.
class SwayingPolicy final : public Policy {
 public:
  /// @param sway_m  standard deviation of the error along each axis, [0, 0.1]; it turns by 10 rad for each metre of it, too
  /// @throws InvalidInput if it is not
  SwayingPolicy(std::unique_ptr<Policy> policy, double sway_m);

  std::string Name() const override { return policy_->Name(); }
  void Reset(SceneId scene, const Task& task, std::uint64_t seed) override;
  std::vector<Acted> Act(std::span<const SceneObservation> batch) override;

 private:
  struct Way {
    std::uint64_t seed = 0;
    Eigen::AlignedBox3d workspace_m;
    std::optional<Eigen::Vector3d> meant_m;  ///< where the hand was last sent to, before it strayed
    double length_m = 0;                     ///< of the way so far
  };
  void Stray(Way& way, ArmState& hand) const;

  std::unique_ptr<Policy> policy_;
  double sway_m_;
  std::map<SceneId, Way> ways_;
};

}  // namespace evac
