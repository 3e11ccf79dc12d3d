#pragma once

#include <fmt/format.h>

#include <opencv2/imgcodecs.hpp>
#include <string>

#include "core/store.h"
#include "core/video.h"
#include "tests/support/temp_folder.h"

namespace evac {

/// A run on disk, as `evac run` leaves it: task take, policy pick@1, worlds real and sim; its store can grow.
class StoredRun {
 public:
  /// @param real, sim  a letter per initial state: s success, f failure. @param rubric  its version.
  StoredRun(const std::string& name, const std::string& real, const std::string& sim, int frames = 4,
            const std::string& rubric = "v1")
      : name_(name),
        rubric_(rubric),
        frames_(frames),
        store_(Store::CreateOrContinue(folder(), {"suite: " + name, "hash-" + name, "suite.yaml", "test"})) {
    store_.AddTask(TakeTask(rubric));
    store_.AddWorld({"real", "mujoco", true, "real-profile"});
    store_.AddWorld({"sim", "mujoco", false, "sim-profile"});
    store_.AddPolicy({"pick", "1", "{}"});
    for (std::size_t i = 0; i < real.size(); ++i) Add(fmt::format("41-{:04d}", i), real[i], sim[i]);
  }

  std::filesystem::path folder() const { return parent_.path() / name_; }
  Store& store() { return store_; }
  const Store& store() const { return store_; }

  void Add(const std::string& state, char real, char sim) {
    AddEpisode({{"take", state, "pick", "1", 1}, "real"}, real);
    AddEpisode({{"take", state, "pick", "1", 1}, "sim"}, sim);
  }

  void AddEpisode(const EpisodeKey& key, char outcome) {
    EpisodeRecord record;
    record.episode.key = key;
    record.episode.chunks = 4;
    record.episode.stop = StopReason::kMaxChunks;
    record.episode.stop_reason = "4 of 4 chunks executed";
    VideoWriter writer(store_.VideoPath(key), {});
    const int frames = key.world == "real" ? frames_ : frames_ + frames_ / 4;  // never of one length
    for (int time = 0; time < frames; ++time) writer.Append(Frame(time, key));
    record.video = writer.Finish();
    std::vector<unsigned char> jpeg;
    cv::imencode(".jpg", Frame(0, key), jpeg);
    record.thumbnail_jpeg.assign(jpeg.begin(), jpeg.end());
    store_.Add(record);
    Verdict verdict;
    verdict.episode_id = key.Id();
    verdict.judge = "oracle";
    verdict.label = outcome == 's' ? Label::kSuccess : Label::kFailure;
    verdict.stages = {{"reach", true}, {"grasp", outcome == 's'}};
    verdict.reason = outcome == 's' ? "grasped at 1.5 s" : "never grasped; nearest 0.04 m";
    verdict.rubric_version = rubric_;
    store_.AddVerdict(verdict);
  }

 private:
  static Task TakeTask(const std::string& rubric) {
    Task task;
    task.id = "take";
    task.instruction = "Take it.";
    task.max_chunks = 4;
    Camera camera;
    camera.name = "head";
    camera.width_px = 64;
    camera.height_px = 48;
    camera.fx_px = camera.fy_px = 60;
    camera.cx_px = 32;
    camera.cy_px = 24;
    task.cameras = {camera};
    task.rubric.version = rubric;
    task.rubric.success = "It is taken.";
    task.rubric.stages.resize(2);
    task.rubric.stages[0].name = "reach";
    task.rubric.stages[1].name = "grasp";
    return task;
  }

  /// A bar that walks, so that a frame can be told from the next.
  static cv::Mat Frame(int time, const EpisodeKey& key) {
    cv::Mat rgb(48, 64, CV_8UC3, key.world == "real" ? cv::Scalar(40, 90, 60) : cv::Scalar(40, 60, 120));
    rgb.colRange(time % 60, time % 60 + 4).setTo(cv::Scalar(255, 255, 255));
    return rgb;
  }

  TempFolder parent_;
  std::string name_, rubric_;
  int frames_;
  Store store_;
};

}  // namespace evac
