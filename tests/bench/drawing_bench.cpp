// What a state's pictures cost, drawn one by one and together (docs/decisions/0022).
#include <benchmark/benchmark.h>

#include "core/task_page.h"
#include "worldmodel/sim/mujoco_handles.h"
#include "worldmodel/sim/renderer.h"
#include "worldmodel/sim/scene_page.h"

namespace evac {
namespace {

/// Head and wrist's pictures of a scene at its start, the wrist's camera 25 cm above the table.
void TwoPicturesOfAState(benchmark::State& state) {
  const bool together = state.range(0) == 1;
  const Task task = ReadTaskPage(EVAC_SOURCE_DIR "/worldmodel/sim/scenes/take_toast.yaml");
  const sim::ModelPtr model = sim::LoadModel(sim::ReadScenePage(task).scene);
  const sim::DataPtr data = sim::MakeData(*model);
  mj_forward(model.get(), data.get());
  Eigen::Isometry3d base_from_wrist = Eigen::Isometry3d::Identity();
  base_from_wrist.linear() = Eigen::Vector3d(1, -1, -1).asDiagonal();
  base_from_wrist.translation() = Eigen::Vector3d(0.45, -0.1, 0.25);
  const sim::SceneView head{task.cameras.at(0), task.cameras.at(0).mount_from_camera},
      wrist{task.cameras.at(1), base_from_wrist};
  sim::Renderer renderer;
  const auto draw = [&](const std::vector<sim::SceneView>& views) {
    benchmark::DoNotOptimize(renderer.Draw(*model, *model, *data, views));
  };
  draw({head, wrist});  // contexts are made
  for (auto _ : state) {
    if (together) {
      draw({head, wrist});
    } else {
      draw({head});
      draw({wrist});
    }
  }
  state.SetLabel(together ? "together" : "one by one");
}
BENCHMARK(TwoPicturesOfAState)->DenseRange(0, 1)->UseRealTime()->Unit(benchmark::kMillisecond);

}  // namespace
}  // namespace evac
