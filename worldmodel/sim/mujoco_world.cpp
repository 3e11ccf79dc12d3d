#include "worldmodel/sim/mujoco_world.h"

#include <utility>

#include "core/error.h"

namespace evac::sim {
namespace {

/// Executes one chunk, up to where the physics or the drawing fails. Not filmed, only its last step is drawn.
Advanced Execute(Scene& scene, const ActionChunk& chunk, bool film, Renderer& renderer) try {
  std::vector<WorldStep> steps;
  for (const Arms& target : chunk.targets) {
    scene.Drive(target);
    if (const auto why = scene.WhyDiverged()) return Failure{StopReason::kDiverged, *why};
    const bool seen = film || &target == &chunk.targets.back();
    steps.push_back(scene.Observe(seen ? &renderer : nullptr));
  }
  return steps;
} catch (const std::exception& error) {
  return Failure{StopReason::kWorldError, error.what()};
}

}  // namespace

struct MujocoWorld::Stage {
  ScenePage page;
  ModelPtr model;
};

MujocoWorld::MujocoWorld(MujocoWorldOptions options)
    : options_(std::move(options)), profile_(ReadProfile(options_.profile)) {
  if (options_.threads < 1 || options_.threads > 256)
    throw InvalidInput("world {}: found threads {}, wanted 1 … 256", options_.name, options_.threads);
  PrepareMujoco();
  workers_ = std::make_unique<Workers>(options_.threads);
}

MujocoWorld::~MujocoWorld() = default;

WorldStep MujocoWorld::Reset(SceneId scene, const Task& task, const InitialState& initial, std::uint64_t seed) {
  const Stage& stage = StageFor(task);
  WorldStep first;
  std::unique_ptr<Scene>& place = scenes_[scene];
  place.reset();
  workers_->Run(1, [&](int, Renderer& renderer) {
    auto made = std::make_unique<Scene>(Scene::Setup{stage.model.get(), &stage.page, &profile_, task, initial, seed});
    if (const auto why = made->WhyDiverged())
      throw InternalError("{} {} in {}: {}", task.id, initial.id, options_.name, *why).Called("diverged");
    first = made->Observe(&renderer);
    place = std::move(made);
  });
  return first;
}

std::vector<Advanced> MujocoWorld::Advance(std::span<const SceneChunk> batch) {
  std::vector<Scene*> scenes;
  for (const SceneChunk& item : batch) scenes.push_back(&SceneAt(item.scene));
  std::vector<Advanced> answers(batch.size());
  workers_->Run(static_cast<int>(batch.size()), [&](int item, Renderer& renderer) {
    const auto i = static_cast<std::size_t>(item);
    answers[i] = Execute(*scenes[i], *batch[i].chunk, options_.film, renderer);
  });
  return answers;
}

const MujocoWorld::Stage& MujocoWorld::StageFor(const Task& task) {
  std::unique_ptr<Stage>& stage = stages_[task.page_path + "\n" + task.page];
  if (!stage) {
    auto made = std::make_unique<Stage>();
    made->page = ReadScenePage(task);
    made->model = LoadModel(made->page.scene);
    stage = std::move(made);
  }
  return *stage;
}

Scene& MujocoWorld::SceneAt(SceneId scene) {
  const auto found = scenes_.find(scene);
  if (found == scenes_.end() || !found->second)
    throw InternalError("world {}: scene {} was not reset", options_.name, scene);
  return *found->second;
}

}  // namespace evac::sim
