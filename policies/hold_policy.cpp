#include "policies/hold_policy.h"

namespace evac {

std::vector<Acted> HoldPolicy::Act(std::span<const SceneObservation> batch) {
  std::vector<Acted> answers;
  for (const SceneObservation& asked : batch) {
    answers.push_back(ActionChunk{.targets = std::vector<Arms>(chunk_size_, asked.observation->arms)});
  }
  return answers;
}

}  // namespace evac
