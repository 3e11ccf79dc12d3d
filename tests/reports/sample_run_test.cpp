#include "tests/reports/sample_run.h"

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <opencv2/imgcodecs.hpp>
#include <set>

#include "core/video.h"

namespace evac {
namespace {

cv::Mat Frame(int time, char outcome) {
  cv::Mat rgb(24, 32, CV_8UC3, cv::Scalar(40, 60, outcome == 's' ? 200 : 90));
  rgb.col(time % rgb.cols).setTo(cv::Scalar(255, 255, 255));
  return rgb;
}

FinishedVideo WriteVideo(const std::filesystem::path& path, char outcome) {
  VideoWriter writer(path, {});
  for (int time = 0; time < 4; ++time) writer.Append(Frame(time, outcome));
  return writer.Finish();
}

std::string Jpeg(char outcome) {
  std::vector<unsigned char> bytes;
  cv::imencode(".jpg", Frame(0, outcome), bytes);
  return {bytes.begin(), bytes.end()};
}

Verdict VerdictOf(const EpisodeKey& key, char outcome) {
  Verdict verdict;
  verdict.episode_id = key.Id();
  verdict.judge = "oracle";
  verdict.label = outcome == 's'   ? Label::kSuccess
                  : outcome == 'f' ? Label::kFailure
                  : outcome == '?' ? Label::kCannotTell
                                   : Label::kInvalid;
  verdict.stages = {{"reach", true}, {"grasp", outcome == 's'}};
  verdict.reason = outcome == 's' ? "released for 0.5 s" : "never grasped";
  verdict.rubric_version = "v1";
  return verdict;
}

Task TaskOf(const std::string& id) {
  Task task;
  task.id = id;
  task.instruction = fmt::format("Do {}.", id);
  task.max_chunks = 4;
  Camera camera;
  camera.name = "head";
  camera.width_px = 32;
  camera.height_px = 24;
  camera.fx_px = camera.fy_px = 30;
  camera.cx_px = 16;
  camera.cy_px = 12;
  task.cameras = {camera};
  task.rubric.version = "v1";
  task.rubric.success = "It is done.";
  task.rubric.stages.resize(2);
  task.rubric.stages[0].name = "reach";
  task.rubric.stages[1].name = "grasp";
  return task;
}

}  // namespace

SampleRun::SampleRun(const std::vector<SampleCell>& cells)
    : store_(Store::InMemory(folder_.path(), {"name: sample\n", "suite-hash", "sample.yaml", "0.1.0"})) {
  Declare(cells);
  for (const SampleCell& cell : cells) {
    for (std::size_t state = 0; state < std::max(cell.real.size(), cell.sim.size()); ++state) {
      const PairKey pair{cell.task, fmt::format("41-{:04d}", state), cell.policy, cell.checkpoint, 1};
      if (state < cell.real.size()) AddEpisode({pair, "real"}, cell.real[state]);
      if (state < cell.sim.size()) AddEpisode({pair, "sim"}, cell.sim[state]);
    }
  }
}

void SampleRun::Declare(const std::vector<SampleCell>& cells) {
  store_.AddWorld({"real", "mujoco", true, "real-profile"});
  store_.AddWorld({"sim", "mujoco", false, "sim-profile"});
  std::set<std::string> tasks, policies;
  for (const SampleCell& cell : cells) {
    if (tasks.insert(cell.task).second) store_.AddTask(TaskOf(cell.task));
    if (policies.insert(PolicyLabel(cell.policy, cell.checkpoint)).second)
      store_.AddPolicy({cell.policy, cell.checkpoint, "{\"chunk\": 8}"});
  }
}

void SampleRun::AddEpisode(const EpisodeKey& key, char outcome) {
  if (outcome == '-') return;
  EpisodeRecord record;
  record.episode.key = key;
  record.episode.chunks = 4;
  record.episode.stop = outcome == 'e' ? StopReason::kPolicyTimeout : StopReason::kMaxChunks;
  record.episode.stop_reason = outcome == 'e' ? "no reply within 2 s" : "4 of 4 chunks executed";
  if (outcome == 'e') record.episode.failure = "no reply within 2 s";
  record.video = WriteVideo(store_.VideoPath(key), outcome);
  record.thumbnail_jpeg = Jpeg(outcome);
  store_.Add(record);
  if (outcome != 'e' && outcome != 'u') store_.AddVerdict(VerdictOf(key, outcome));
}

std::vector<SampleCell> FourPoliciesTwoTasks() {
  return {
      {"take_bottle", "pick", "good", "sssssssssf", "sssssssssf"},
      {"take_bottle", "pick", "biased", "ssssssffff", "sssssffffs"},
      {"take_bottle", "pick", "late", "ssffffffff", "sfffffffff"},
      {"take_bottle", "pick", "blind", "ffffffffff", "ffffffffff"},
      {"place_toast", "pick", "good", "ssssssssff", "sssssssfff"},
      {"place_toast", "pick", "biased", "sssssfffff", "sssssfffff"},
      {"place_toast", "pick", "late", "sssfffffff", "ssffffffff"},
      {"place_toast", "pick", "blind", "sfffffffff", "ffffffffff"},
  };
}

const SampleRun& LargeRun() {
  static const SampleRun run(FourPoliciesTwoTasks());
  return run;
}

TEST(SampleRun, HasAVideoAndAThumbnailForEveryEpisode) {
  SampleRun run({{"take_bottle", "pick", "good", "sf", "se"}});
  const std::vector<Episode> episodes = run.store().Episodes();
  ASSERT_EQ(episodes.size(), 4u);
  for (const Episode& episode : episodes) {
    EXPECT_TRUE(std::filesystem::exists(run.folder() / episode.video)) << episode.video;
    EXPECT_TRUE(std::filesystem::exists(run.folder() / episode.thumbnail)) << episode.thumbnail;
  }
}

}  // namespace evac
