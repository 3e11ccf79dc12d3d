#include "core/recording_writer.h"

#include <gmock/gmock.h>

#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include "core/error.h"
#include "core/file.h"
#include "core/hash.h"
#include "core/recording.h"
#include "core/seed.h"
#include "tests/support/temp_folder.h"

namespace evac {
namespace {

constexpr int kSteps = 5, kWidth_px = 24, kHeight_px = 16;

Camera MakeCamera(const std::string& name, Mount mount) {
  Camera camera{name, kWidth_px, kHeight_px, 20, 21, 12, 8, mount, Eigen::Isometry3d::Identity()};
  camera.mount_from_camera = Eigen::Translation3d(0.05, 0.01, -0.1) * Eigen::AngleAxisd(0.4, Eigen::Vector3d::UnitY());
  return camera;
}

/// Small things of many colours on grey, as on a desk seen from afar.
cv::Mat Colourful(std::uint64_t seed) {
  SplitMix64 random(seed);
  cv::Mat picture(kHeight_px, kWidth_px, CV_8UC3, cv::Scalar::all(180));
  for (int i = 0; i < 12; ++i) {
    const auto below = [&](int bound) { return static_cast<int>(random.Below(static_cast<std::uint64_t>(bound))); };
    const cv::Rect thing(below(kWidth_px - 4), below(kHeight_px - 4), 1 + below(4), 1 + below(4));
    picture(thing) = cv::Scalar(below(256), below(256), below(256));
  }
  return picture;
}

Arms ArmAt(int step, double closure) {
  const Eigen::Isometry3d pose = Eigen::Translation3d(0.3 + 0.01 * step, -0.1, 0.2) *
                                 Eigen::AngleAxisd(0.1 * step, Eigen::Vector3d(1, 2, 3).normalized());
  return {{pose, closure}};
}

RecordedEpisode OneArmEpisode() {
  RecordedEpisode episode;
  episode.cameras = {MakeCamera("head", Mount::kBase), MakeCamera("hand_right", Mount::kRightGripper)};
  for (int step = 0; step < kSteps; ++step) {
    episode.arms.push_back(ArmAt(step, 0.6));
    episode.told.push_back(ArmAt(step + 1, 1));
    episode.pictures.push_back(
        {Colourful(2 * static_cast<std::uint64_t>(step)), Colourful(2 * static_cast<std::uint64_t>(step) + 1)});
  }
  return episode;
}

double MeanDifference(const cv::Mat& a, const cv::Mat& b) {
  cv::Mat difference;
  cv::absdiff(a, b, difference);
  const cv::Scalar mean = cv::mean(difference);
  return (mean[0] + mean[1] + mean[2]) / 3;
}

TEST(RecordingWriter, AnEpisodeThatWasWrittenIsReadAsItWas) {
  const TempFolder folder;
  const TreePlace place{folder.path(), "take_bottle", "000007"};
  const RecordedEpisode episode = OneArmEpisode();
  WriteRecording(place, episode, {.crf = 4, .scale = 2});
  const Recording read = ReadRecording(place.Folder(), {.read_told = true});
  EXPECT_EQ(read.id, "take_bottle-000007");
  EXPECT_DOUBLE_EQ(read.period_s, 0.1);
  EXPECT_THAT(read.arm_names, testing::ElementsAre("right"));
  ASSERT_EQ(read.arms.size(), kSteps);
  ASSERT_EQ(read.told.size(), kSteps);
  for (int step = 0; step < kSteps; ++step) {
    const auto k = static_cast<std::size_t>(step);
    EXPECT_TRUE(read.arms[k][0].base_from_gripper.isApprox(episode.arms[k][0].base_from_gripper, 1e-9));
    EXPECT_TRUE(read.told[k][0].base_from_gripper.isApprox(episode.told[k][0].base_from_gripper, 1e-9));
    EXPECT_NEAR(read.arms[k][0].closure, 0.6, 1e-12);
    EXPECT_NEAR(read.told[k][0].closure, 1, 1e-12);
  }
  ASSERT_EQ(read.cameras.size(), 2u);
  EXPECT_EQ(read.cameras[1].width_px, 2 * kWidth_px);
  EXPECT_DOUBLE_EQ(read.cameras[1].fy_px, 42);
  EXPECT_TRUE(read.cameras[1].mount_from_camera.isApprox(episode.cameras[1].mount_from_camera, 1e-9));
}

TEST(RecordingWriter, FourFilesSayWhereTheArmsWereToldToBe) {
  const TempFolder folder;
  const TreePlace place{folder.path(), "take_bottle", "000007"};
  const RecordedEpisode episode = OneArmEpisode();
  WriteRecording(place, episode, {.scale = 1});
  std::vector<uchar> png;
  cv::imencode(".png", Colourful(0), png);
  WriteFileAtomically(folder / "frame.png", std::string(png.begin(), png.end()));
  const std::filesystem::path parameters = folder / "parameters/take_bottle/000007/parameters/camera",
                              track = folder / "proprio_stats/take_bottle/000007/proprio_stats.h5";
  const RecordingFiles files{folder / "frame.png", track, parameters / "head_extrinsic_params_aligned.json",
                             parameters / "head_intrinsic_params.json"};
  const Recording read = ReadRecordingFiles(files, {.read_told = true});
  ASSERT_EQ(read.told.size(), read.arms.size());
  EXPECT_TRUE(read.told[1][0].base_from_gripper.isApprox(episode.told[1][0].base_from_gripper, 1e-9));
  EXPECT_TRUE(ReadRecordingFiles(files).told.empty()) << "nobody asked";
}

TEST(RecordingWriter, DrawnTwiceAsLargeTheColoursOfSmallThingsComeBackCloser) {
  const TempFolder folder;
  const RecordedEpisode episode = OneArmEpisode();
  const auto difference_at = [&](int scale) {
    const TreePlace place{folder.path(), "task", std::to_string(scale)};
    WriteRecording(place, episode, {.crf = 4, .scale = scale});
    const cv::Mat video = ReadRecording(place.Folder()).first_images[0];
    cv::Mat picture;
    cv::resize(video, picture, {kWidth_px, kHeight_px}, 0, 0, cv::INTER_AREA);
    return MeanDifference(picture, episode.pictures[0][0]);
  };
  EXPECT_LT(difference_at(2), 0.7 * difference_at(1));
}

TEST(RecordingWriter, TheSameEpisodeGivesTheSameBytes) {
  const TempFolder folder;
  const auto hashes = [&](const std::string& name) {
    const TreePlace place{folder / name, "task", "1"};
    WriteRecording(place, OneArmEpisode(), {});
    std::string all;
    for (const auto& file : ReadRecording(place.Folder()).files) all += Sha256HexOfFile(file) + "\n";
    EXPECT_NE(all, "");
    return all;
  };
  EXPECT_EQ(hashes("a"), hashes("b"));
}

TEST(RecordingWriter, TracksOfDifferentLengthsAreRefused) {
  const TempFolder folder;
  RecordedEpisode episode = OneArmEpisode();
  episode.told.pop_back();
  EXPECT_THROW(WriteRecording({folder.path(), "task", "1"}, episode, {}), Error);
}

/// A mount is no field of the files: a camera on the gripper that was called `wrist` was taken to stand on the base,
/// and its recording refused as of a camera that moves. `evac collect` had written a thousand of them.
TEST(RecordingWriter, ACameraThatReadersWouldTakeToBeElsewhereIsRefused) {
  const TempFolder folder;
  const auto error_of = [&](const std::vector<Camera>& cameras) -> std::string {
    RecordedEpisode episode = OneArmEpisode();
    episode.cameras = cameras;
    try {
      WriteRecording({folder.path(), "task", "1"}, episode, {});
    } catch (const Error& error) {
      EXPECT_EQ(error.exit_code(), ExitCode::kInvalidInput);
      return error.what();
    }
    return "it was written";
  };
  const Camera head = MakeCamera("head", Mount::kBase);
  EXPECT_THAT(error_of({head, MakeCamera("wrist", Mount::kRightGripper)}),
              testing::AllOf(testing::HasSubstr("camera 'wrist' is mounted on right_gripper"),
                             testing::HasSubstr("is read as on base")));
  EXPECT_THAT(error_of({head, MakeCamera("hand_right", Mount::kBase)}),
              testing::HasSubstr("'hand_right' is mounted on base"));
  EXPECT_THAT(error_of({head, MakeCamera("hand_left", Mount::kLeftGripper)}),
              testing::HasSubstr("'hand_left' is mounted on left_gripper"));
  EXPECT_THAT(error_of({MakeCamera("side", Mount::kBase), MakeCamera("hand_right", Mount::kRightGripper)}),
              testing::HasSubstr("found no camera 'head'"));
  EXPECT_FALSE(std::filesystem::exists(folder / "observations")) << "nothing was begun";

  RecordedEpisode fixed = OneArmEpisode();
  fixed.cameras[1] = MakeCamera("hand_left", Mount::kBase);
  EXPECT_NO_THROW(WriteRecording({folder.path(), "task", "1"}, fixed, {}));
  const Recording read = ReadRecording(folder.path() / "observations/task/1");
  ASSERT_EQ(read.cameras.size(), 2u);
  EXPECT_EQ(read.cameras[1].mount, Mount::kBase) << "of a robot without a left arm";
}

/// Whoever read such a recording saw each pixel four times, and cameras of twice as many: only packing knew better.
TEST(RecordingWriter, ShrunkAsItWasDrawnItIsThePicturesAgainToTheLastOne) {
  const TempFolder folder;
  const TreePlace place{folder.path(), "task", "1"};
  const RecordedEpisode episode = OneArmEpisode();
  WriteRecording(place, episode, {.crf = 4, .scale = 2});
  const Recording shrunk = Shrunk(ReadRecording(place.Folder()), 2);
  EXPECT_EQ(shrunk.shrink, 2);
  ASSERT_EQ(shrunk.cameras.size(), 2u);
  EXPECT_EQ(shrunk.cameras[1].height_px, kHeight_px);
  EXPECT_DOUBLE_EQ(shrunk.cameras[1].fy_px, 21);
  RecordedFrames frames(shrunk);
  for (std::size_t step = 0; step < kSteps; ++step) {
    const std::vector<cv::Mat>& images = frames.Next();
    for (std::size_t view = 0; view < 2; ++view) {
      ASSERT_EQ(images[view].size(), cv::Size(kWidth_px, kHeight_px));
      EXPECT_LT(MeanDifference(images[view], episode.pictures[step][view]), 8) << step << " " << view;
    }
  }
  EXPECT_EQ(MeanDifference(RecordedFrames(shrunk).Next()[0], shrunk.first_images[0]), 0);
}

}  // namespace
}  // namespace evac
