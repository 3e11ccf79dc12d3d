#include <benchmark/benchmark.h>

#include <opencv2/imgproc.hpp>

#include "core/seed.h"
#include "core/store.h"
#include "core/video.h"
#include "tests/support/temp_folder.h"

namespace evac {
namespace {

cv::Mat Scene(int width_px, int height_px, int frame) {
  cv::Mat image(height_px, width_px, CV_8UC3, cv::Scalar(120, 130, 140));
  cv::circle(image, {(frame * 3) % width_px, height_px / 2}, height_px / 6, cv::Scalar(40, 160, 60), -1);
  return image;
}

/// One second of video: 10 frames of two views, as an episode writes them.
void EncodeTenFrames(benchmark::State& state) {
  const TempFolder folder;
  const int height_px = static_cast<int>(state.range(0)), width_px = height_px * 3 / 2;
  VideoWriter writer(folder / "video.mp4", {.scale = static_cast<int>(state.range(1))});
  int frame = 0;
  for (auto _ : state) {
    for (int i = 0; i < 10; ++i, ++frame) writer.Append(SideBySide({Scene(width_px, height_px, frame), Scene(width_px, height_px, frame + 7)}));
  }
}
BENCHMARK(EncodeTenFrames)->Args({64, 1})->Args({64, 4})->Args({128, 1})->Args({128, 2})->Unit(benchmark::kMillisecond);

/// A stored episode of 100 steps with its privileged track, video included.
void StoreAnEpisode(benchmark::State& state) {
  const TempFolder folder;
  Store store = Store::CreateOrContinue(folder / "run", {.suite_text = "suite: b", .suite_hash = "b", .suite_path = "", .evac_version = "0"});
  Task task;
  task.id = "task";
  store.AddTask(task);
  store.AddWorld({"real", "mujoco", true, ""});
  store.AddPolicy({"p", "a", "{}"});
  std::uint64_t seed = 0;
  for (auto _ : state) {
    EpisodeRecord record;
    record.episode.key = {{"task", "1-0000", "p", "a", ++seed}, "real"};
    record.episode.stop = StopReason::kStill;
    record.episode.observations.assign(101, {{}, Arms(1), false});
    record.episode.commands.assign(100, Arms(1));
    record.privileged.assign(101, {.bodies = std::vector<PrivilegedFrame::Body>(6, {"bottle", Eigen::Isometry3d::Identity()}), .contacts = {}});
    store.Add(record);
  }
}
BENCHMARK(StoreAnEpisode)->Unit(benchmark::kMillisecond);

}  // namespace
}  // namespace evac
