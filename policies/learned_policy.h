#pragma once

#include <filesystem>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "core/policy.h"
#include "policies/spec.h"

namespace evac {

/// A policy that learned by imitation (`evac train policy`, docs/learned_policy.md): pictures, arms and task in, a
/// chunk of absolute targets out, by one pass of a small network.
///
/// It knows the arms by what it told them, not by what was measured: so it does the same in a world that nobody can
/// measure (arms_are_commanded). It draws no noise: its answer is a function of what it saw since Reset.
class LearnedPolicy : public Policy {
 public:
  /// @param weights     of `evac train policy`
  /// @param chunk_size  targets per chunk, the first of those that the network says
  /// @param as_task     one of the tasks it learned: every task is taken for this one, whatever its name (a recorded
  ///                    suite's is named after its recording); empty: tasks go by their own names
  /// @throws InvalidInput naming the file and what about it is wrong; a chunk longer than the network's; an `as_task`
  ///   that it did not learn.
  LearnedPolicy(const std::filesystem::path& weights, int chunk_size, std::string as_task = "");
  ~LearnedPolicy() override;

  std::string Name() const override { return "learned"; }
  /// What the card says it was trained for; the checkpoint is the file's name without its ending.
  PolicySpec Spec() const;

  /// @throws InvalidInput for a task that it did not learn, a camera that is missing or looks from elsewhere than in
  ///   training (found, wanted), other arms or another period.
  void Reset(SceneId scene, const Task& task, std::uint64_t seed) override;
  std::vector<Acted> Act(std::span<const SceneObservation> batch) override;

 private:
  struct Network;
  struct Episode {
    Task task;
    std::int64_t task_index = 0;
    std::vector<std::size_t> views;  ///< where each camera of the network is in the observation
    Arms told;                       ///< last targets; empty before the first observation
    std::vector<bool> grasped;       ///< per arm: the hand was told to close, or began closed; empty as `told`
  };
  /// The first moment: as in training, where a recording's first frame counts.
  static void Begin(const Arms& arms, Episode& episode);
  ActionChunk Answer(Episode& episode, const Observation& observation) const;
  /// Among those it learned. @throws InvalidInput if it is none of them.
  std::int64_t IndexOfTask(const std::string& name, const char* remedy) const;

  std::unique_ptr<const Network> network_;
  int chunk_size_;
  std::string as_task_;
  std::map<SceneId, Episode> episodes_;
};

}  // namespace evac
