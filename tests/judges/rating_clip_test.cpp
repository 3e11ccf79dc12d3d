#include "judges/rating_clip.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "core/error.h"
#include "core/file.h"
#include "core/video.h"
#include "judges/rating_study.h"
#include "tests/judges/rating_support.h"
#include "tests/reports/stored_run.h"

namespace evac {
namespace {

Camera OfSize(const char* name, int width_px, int height_px) {
  Camera camera;
  camera.name = name;
  camera.width_px = width_px;
  camera.height_px = height_px;
  return camera;
}

TEST(RatingClip, TheFirstViewIsLargeAndTheOthersStandBesideIt) {
  const ClipLayout layout =
      LayoutOf({OfSize("head", 256, 256), OfSize("left", 256, 256), OfSize("right", 256, 256)}, 512);
  EXPECT_EQ(layout.width_px, 768);
  EXPECT_EQ(layout.height_px, 512);
  ASSERT_EQ(layout.views.size(), 3u);
  EXPECT_EQ(layout.views[0].width_px, 512);
  EXPECT_EQ(layout.views[2].x_px, 512);
  EXPECT_EQ(layout.views[2].y_px, 256);
  const auto views = nlohmann::json::parse(ViewsJson(layout, 768, 512));
  EXPECT_NEAR(views[1]["x"].get<double>(), 2.0 / 3, 1e-9);
  EXPECT_NEAR(views[1]["height"].get<double>(), 0.5, 1e-9);
}

TEST(RatingClip, EveryClipOfAStudyHasOneSizeOneRateOneLengthInBytesAndNoMark) {
  SmallStudy study(3);
  std::set<std::uintmax_t> sizes;
  std::set<std::pair<int, int>> pictures;
  const StudyStore store = study.Open();
  for (const StudyClip& clip : store.Clips()) {
    VideoReader reader(study.folder() / clip.file);
    pictures.insert({reader.width_px(), reader.height_px()});
    sizes.insert(std::filesystem::file_size(study.folder() / clip.file));
    EXPECT_EQ(static_cast<int>(ReadAllFrames(study.folder() / clip.file).size()), clip.frames);
    const std::string bytes = ReadFile(study.folder() / clip.file);
    EXPECT_EQ(bytes.find("Lavf"), std::string::npos);
    EXPECT_EQ(bytes.find("real"), std::string::npos);
  }
  EXPECT_EQ(sizes.size(), 1u);
  EXPECT_EQ(pictures.size(), 1u);
}

TEST(RatingClip, ASourceOfAnotherRateKeepsItsTime) {
  TempFolder folder;
  Task task;
  task.cameras = {OfSize("head", 64, 48)};
  task.period_s = 0.2;
  VideoWriter writer(folder / "slow.mp4", {.period_s = 0.2});
  for (int k = 0; k < 10; ++k) writer.Append(cv::Mat(48, 64, CV_8UC3, cv::Scalar::all(20 * k)));
  writer.Finish();
  const ClipLayout layout = LayoutOf(task.cameras, 48);
  EXPECT_EQ(
      EncodeClip(folder / "slow.mp4", task, layout, {layout.width_px, layout.height_px, 0.1}, {}, folder / "fast.mp4"),
      20);
  const auto frames = ReadAllFrames(folder / "fast.mp4");
  ASSERT_EQ(frames.size(), 20u);
  EXPECT_NEAR(frames[19].at<cv::Vec3b>(20, 20)[0], 180, 6);
  EXPECT_NEAR(frames[10].at<cv::Vec3b>(20, 20)[0], 100, 6);
}

TEST(RatingClip, EachViewGoesThroughTheCodecInItsCamerasSize) {
  TempFolder folder;
  Task task;
  task.cameras = {OfSize("head", 64, 48), OfSize("hand", 32, 48)};
  VideoWriter writer(folder / "wide.mp4", {});  // each pixel twice
  cv::Mat frame(96, 192, CV_8UC3, cv::Scalar::all(40));
  frame.colRange(128, 192).setTo(cv::Scalar::all(200));
  for (int k = 0; k < 3; ++k) writer.Append(frame);
  writer.Finish();
  const ClipLayout layout = LayoutOf(task.cameras, 96);
  std::vector<cv::Size> sizes;
  const ClipRoundTrip negative{"codec", [&](const cv::Mat& picture) {
                                 sizes.push_back(picture.size());
                                 return cv::Mat(cv::Scalar::all(255) - picture);
                               }};
  EncodeClip(folder / "wide.mp4", task, layout, {layout.width_px, layout.height_px, 0.1}, negative,
             folder / "shown.mp4");
  ASSERT_EQ(sizes.size(), 6u);
  EXPECT_EQ(sizes[0], cv::Size(64, 48));
  EXPECT_EQ(sizes[1], cv::Size(32, 48));
  const cv::Mat shown = ReadAllFrames(folder / "shown.mp4").at(1);
  EXPECT_NEAR(shown.at<cv::Vec3b>(20, 20)[0], 215, 6);
  EXPECT_NEAR(shown.at<cv::Vec3b>(20, layout.views[1].x_px + 10)[0], 55, 6);
}

TEST(RatingClip, OnlyWhatNoWorldModelDrewGoesThroughItsCodecAndEveryWaveTheSameWay) {
  StoredRun run("mixed", "sf", "fs");
  run.store().AddWorld({"dream", "evac", false, "network"});
  run.AddEpisode({{"take", "41-0000", "pick", "1", 1}, "dream"}, 's');
  std::size_t pictures = 0, frames = 0;
  StudyOptions options{.runs = {run.folder()}, .height_px = 64};
  options.round_trip = {"c0dec", [&](const cv::Mat& picture) { return ++pictures, picture.clone(); }};
  const std::filesystem::path folder = run.folder().parent_path() / "study";
  MakeStudy(folder, options, [](std::size_t, std::size_t) {});
  const StudyStore study = StudyStore::Open(folder, StudyStore::Mode::kReadOnly);
  EXPECT_EQ(study.Codec(), "c0dec");
  for (const StudyClip& clip : study.Clips())
    frames += clip.world == "dream" ? 0 : static_cast<std::size_t>(clip.frames);
  EXPECT_EQ(study.Clips().size(), 5u);
  EXPECT_EQ(pictures, frames);

  run.Add("41-0007", 's', 's');
  options.round_trip = {};
  EXPECT_THAT([&] { MakeStudy(folder, options, [](std::size_t, std::size_t) {}); },
              testing::ThrowsMessage<Error>(testing::HasSubstr("its clips went through the codec c0dec")));
  EXPECT_EQ(study.Waves(), 1);
}

TEST(RatingClip, PaddingLeavesTheClipPlayable) {
  TempFolder folder;
  VideoWriter writer(folder / "clip.mp4", {});
  for (int k = 0; k < 5; ++k) writer.Append(cv::Mat(48, 64, CV_8UC3, cv::Scalar::all(50)));
  writer.Finish();
  PadClip(folder / "clip.mp4", 100'000, folder / "clip.mp4");
  EXPECT_EQ(std::filesystem::file_size(folder / "clip.mp4"), 100'000u);
  EXPECT_EQ(ReadAllFrames(folder / "clip.mp4").size(), 5u);
  EXPECT_THROW(PadClip(folder / "clip.mp4", 50'000, folder / "clip.mp4"), Error);
}

}  // namespace
}  // namespace evac
