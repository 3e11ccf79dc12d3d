#include "harness/lanes.h"

#include "core/error.h"

namespace evac {

int Lanes::Refill(JobQueue& jobs, Policy& policy, World& world) {
  int held = 0;
  for (std::size_t i = 0; i < lanes_.size(); ++i) {
    if (!lanes_[i]) {
      if (held > 0 && options_.interrupted && options_.interrupted()) continue;  // a Reset may take seconds
      std::optional<Job> job = jobs.Next();
      if (!job) continue;
      lanes_[i] = std::make_unique<Lane>(static_cast<SceneId>(i), std::move(*job), options_.lane, store_);
      lanes_[i]->Begin(policy, world);
    }
    ++held;
  }
  return held;
}

std::vector<Lane*> Lanes::Live() const {
  std::vector<Lane*> live;
  for (const auto& lane : lanes_) {
    if (lane && !lane->over()) live.push_back(lane.get());
  }
  return live;
}

void Lanes::Command(Policy& policy) {
  const std::vector<Lane*> live = Live();
  std::vector<SceneObservation> observed;
  for (const Lane* lane : live) observed.push_back({lane->scene(), &lane->observation()});
  std::vector<Acted> answers;
  try {
    answers = policy.Act(observed);
    if (answers.size() != live.size()) throw InternalError("the policy was asked for {} chunks and answered {}", live.size(), answers.size());
  } catch (const std::exception& error) {
    return FailAll({StopReason::kPolicyError, error.what()});
  }
  for (std::size_t i = 0; i < live.size(); ++i) live[i]->Command(answers[i]);
}

void Lanes::Observe(World& world) {
  const std::vector<Lane*> live = Live();
  std::vector<SceneChunk> commanded;
  for (const Lane* lane : live) commanded.push_back({lane->scene(), &lane->chunk()});
  std::vector<Advanced> answers;
  try {
    answers = world.Advance(commanded);
    if (answers.size() != live.size()) throw InternalError("the world was given {} chunks and answered {}", live.size(), answers.size());
  } catch (const std::exception& error) {
    return FailAll({StopReason::kWorldError, error.what()});
  }
  for (std::size_t i = 0; i < live.size(); ++i) live[i]->Observe(answers[i]);
}

/// The policy or the world broke as a whole.
void Lanes::FailAll(const Failure& failure) {
  for (Lane* lane : Live()) lane->Fail(failure);
}

std::vector<EpisodeRecord> Lanes::TakeFinished() {
  std::vector<EpisodeRecord> finished;
  for (auto& lane : lanes_) {
    if (!lane || !lane->over()) continue;
    const EpisodeKey& key = lane->job().key;
    if (store_.Has(key)) store_.RemoveFailed(key);  // before the new video takes the place of the old one's
    finished.push_back(lane->Finish());
    lane.reset();
  }
  return finished;
}

std::vector<Progress::LaneState> Lanes::State() const {
  std::vector<Progress::LaneState> state;
  for (const auto& lane : lanes_) {
    if (lane) state.push_back({lane->job().key.Id(), lane->chunks(), lane->job().task->max_chunks});
  }
  return state;
}

}  // namespace evac
