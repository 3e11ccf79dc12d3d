#pragma once

#include "core/policy.h"

namespace evac {

/// Never moves: every target of its chunk is where the arms are. The simplest policy, and the still rule's subject.
class HoldPolicy : public Policy {
 public:
  /// @param chunk_size  targets per chunk, > 0.
  explicit HoldPolicy(int chunk_size) : chunk_size_(chunk_size) {}

  std::string Name() const override { return "hold"; }
  void Reset(SceneId, const Task&, std::uint64_t) override {}
  std::vector<Acted> Act(std::span<const SceneObservation> batch) override;

 private:
  int chunk_size_;
};

}  // namespace evac
