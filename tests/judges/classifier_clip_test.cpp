#include "judges/classifier_clip.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>

#include "core/error.h"
#include "core/video.h"
#include "tests/support/temp_folder.h"

namespace evac {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;
using testing::ThrowsMessage;

std::vector<Camera> TwoCameras() {
  return {{.name = "head", .width_px = 48, .height_px = 32}, {.name = "hand_right", .width_px = 48, .height_px = 32}};
}

/// A clip whose left view grows brighter by `step` a frame from 20 on, and whose right view is always 200.
std::filesystem::path Clip(const TempFolder& folder, int frames, int step, int scale) {
  VideoWriter writer(folder / "clip.mp4", {.period_s = 0.1, .crf = 10, .scale = scale});
  for (int i = 0; i < frames; ++i) {
    const cv::Mat left(32, 48, CV_8UC3, cv::Scalar::all(20 + step * i)), right(32, 48, CV_8UC3, cv::Scalar::all(200));
    writer.Append(SideBySide({left, right}));
  }
  return writer.Finish().path;
}

double Mean(const cv::Mat& picture) { return cv::mean(picture)[1]; }

TEST(EvenlySpaced, HoldsTheFirstAndTheLast) {
  EXPECT_THAT(EvenlySpaced(97, 8), ElementsAre(0, 14, 27, 41, 55, 69, 82, 96));
  EXPECT_THAT(EvenlySpaced(8, 8), ElementsAre(0, 1, 2, 3, 4, 5, 6, 7));
  EXPECT_THAT(EvenlySpaced(1, 3), ElementsAre(0, 0, 0));
  EXPECT_THAT(EvenlySpaced(5, 1), ElementsAre(4));
}

TEST(ReadClip, TakesTheViewsApartAgainAtAnyScale) {
  for (const int scale : {1, 2, 4}) {
    const TempFolder folder;
    const auto views = ReadClip(Clip(folder, 15, 10, scale), {TwoCameras(), 8, {24, 16}});
    ASSERT_EQ(views.size(), 2U);
    ASSERT_EQ(views[0].size(), 8U);
    for (int k = 0; k < 8; ++k) {
      EXPECT_EQ(views[0][static_cast<std::size_t>(k)].size(), cv::Size(24, 16));
      EXPECT_NEAR(Mean(views[0][static_cast<std::size_t>(k)]), 20 + 10 * 2 * k, 3) << "scale " << scale;
      EXPECT_NEAR(Mean(views[1][static_cast<std::size_t>(k)]), 200, 3);
    }
  }
}

TEST(ReadClip, AShortClipRepeatsItsFrames) {
  const TempFolder folder;
  const auto views = ReadClip(Clip(folder, 2, 100, 1), {TwoCameras(), 8, {48, 32}});
  EXPECT_NEAR(Mean(views[0].front()), 20, 3);
  EXPECT_NEAR(Mean(views[0].back()), 120, 3);
}

TEST(ReadClip, RefusesPicturesOfOtherCameras) {
  const TempFolder folder;
  std::vector<Camera> one = TwoCameras();
  one.resize(1);
  one[0].height_px = 40;
  EXPECT_THAT(
      [&] {
        ReadClip(Clip(folder, 3, 1, 1), {one, 8, {48, 32}});
      },
      ThrowsMessage<Error>(HasSubstr("pictures of 96x32 pixels, wanted 48x40 (the task's 1 cameras side by side)")));
}

TEST(ReadClip, AClipThatIsCutOffIsAnErrorAndNamed) {
  const TempFolder folder;
  const std::filesystem::path clip = Clip(folder, 30, 5, 1);
  std::filesystem::resize_file(clip, std::filesystem::file_size(clip) - 200);
  EXPECT_THAT([&] { ReadClip(clip, {TwoCameras(), 8, {48, 32}}); }, ThrowsMessage<Error>(HasSubstr("clip.mp4")));
  EXPECT_THROW(ReadClip(folder / "none.mp4", {TwoCameras(), 8, {48, 32}}), Error);
}

}  // namespace
}  // namespace evac
