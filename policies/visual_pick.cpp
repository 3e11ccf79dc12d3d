#include "policies/visual_pick.h"

#include "core/error.h"

namespace evac {

VisualPick::VisualPick(const VisualPickOptions& options) : options_(options) { Check(options); }

void VisualPick::Reset(SceneId scene, const Task& task, std::uint64_t seed) {
  episodes_.insert_or_assign(scene, VisualEpisode(task, options_, seed));
}

std::vector<Acted> VisualPick::Act(std::span<const SceneObservation> batch) {
  std::vector<Acted> answers;
  for (const auto& [scene, observation] : batch) {
    const auto episode = episodes_.find(scene);
    if (episode == episodes_.end()) throw InternalError("visual_pick was asked for scene {} before its Reset", scene);
    answers.push_back(episode->second.Answer(*observation));
  }
  return answers;
}

}  // namespace evac
