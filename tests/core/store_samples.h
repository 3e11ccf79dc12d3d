#pragma once

#include <filesystem>
#include <string>

#include "core/seed.h"
#include "core/store.h"

/// Made-up content for the store's tests: every field filled, nothing round.
namespace evac::samples {

inline RunInfo SomeRun() {
  return {.suite_text = "name: t\n", .suite_hash = "5417e", .suite_path = "suites/t.yaml", .evac_version = "0.1.0"};
}

inline Eigen::Isometry3d Pose(SplitMix64& random) {
  Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
  for (int i = 0; i < 12; ++i) pose.matrix()(i / 4, i % 4) = random.Normal();
  return pose;
}

inline Arms SomeArms(SplitMix64& random, int count = 1) {
  Arms arms(count);
  for (ArmState& arm : arms) arm = {Pose(random), random.Uniform()};
  return arms;
}

inline Camera SomeCamera(const std::string& name, Mount mount, SplitMix64& random) {
  return {
      name,  24,          16, 20 + random.Uniform(), 21 + random.Uniform(), 12 + random.Uniform(), 8 + random.Uniform(),
      mount, Pose(random)};
}

inline Task SomeTask(const std::string& id = "take_bottle") {
  SplitMix64 random(SeedFor(1, id));
  Task task;
  task.id = id;
  task.instruction = "take the bottle, “gently”";
  task.cameras = {SomeCamera("head", Mount::kBase, random), SomeCamera("hand_right", Mount::kRightGripper, random)};
  task.period_s = 0.1;
  task.max_chunks = 25;
  task.still = {true, 1.0 / 3, 0.07, 0.01, 4, 5};
  task.workspace_m = {Eigen::Vector3d(-0.1, -0.2, 0.3), Eigen::Vector3d(1.0 / 7, 2, 3)};
  task.rubric = {"r1",
                 "it stands",
                 {{"reach",
                   "the hand is there",
                   {{"near", "hand", "bottle", {}, 0.05}, {"lifted", "bottle", "", 0.1, {}}},
                   0.5,
                   true}}};
  task.page = "id: " + id + "\n# a comment\nmujoco: {scene: a.xml}\n";
  task.page_path = "/somewhere/" + id + ".yaml";
  return task;
}

inline EpisodeKey Key(int index, const std::string& world = "sim") {
  return {{"take_bottle", "41-0007", "visual_pick", "good", static_cast<std::uint64_t>(index)}, world};
}

inline cv::Mat Image(int seed, int width_px = 24, int height_px = 16) {
  cv::Mat image(height_px, width_px, CV_8UC3);
  cv::RNG(static_cast<std::uint64_t>(seed) + 1).fill(image, cv::RNG::UNIFORM, 0, 256);
  return image;
}

/// With 5 observations and a video in the store's folder.
inline EpisodeRecord SomeEpisode(const Store& store, const EpisodeKey& key, StopReason stop = StopReason::kStill) {
  SplitMix64 random(key.pair.seed);
  EpisodeRecord record;
  record.episode.key = key;
  record.episode.chunks = 2;
  record.episode.stop = stop;
  record.episode.stop_reason = "commanded 1.2 mm, observed 0.9 mm";
  if (IsFailure(stop)) record.episode.failure = "the policy answered NaN";
  VideoWriter writer(store.VideoPath(key), {.preset = "ultrafast"});
  for (int i = 0; i < 5; ++i) {
    record.episode.observations.push_back({{}, SomeArms(random), i == 3});
    if (i > 0) record.episode.commands.push_back(SomeArms(random));
    record.privileged.push_back(
        {{{"bottle", Pose(random)}, {"hand", Pose(random)}}, {{"bottle", "hand", random.Normal()}}});
    writer.Append(Image(i));
  }
  record.video = writer.Finish();
  record.thumbnail_jpeg = "jpeg of " + key.Id();
  return record;
}

inline void Declare(Store& store) {
  store.AddTask(SomeTask());
  store.AddWorld({.name = "real", .type = "mujoco", .is_real = true, .profile_hash = "f00"});
  store.AddWorld({.name = "sim", .type = "mujoco", .is_real = false, .profile_hash = "ba5"});
  store.AddPolicy({"visual_pick", "good", R"({"arms": 1})"});
}

}  // namespace evac::samples
