#include "core/recording.h"

#include <gmock/gmock.h>

#include <algorithm>
#include <array>
#include <fstream>
#include <opencv2/imgcodecs.hpp>

#include "core/check.h"
#include "core/error.h"
#include "core/file.h"
#include "core/geometry.h"
#include "core/npy.h"
#include "core/recording_folders.h"
#include "tests/support/synthetic_recording.h"
#include "tests/support/temp_folder.h"

namespace evac {
namespace {

namespace fs = std::filesystem;
using testing::AllOf;
using testing::HasSubstr;

std::string ErrorOf(const fs::path& folder, const RecordingOptions& options = {}) {
  try {
    ReadRecording(folder, options);
  } catch (const Error& error) {
    EXPECT_EQ(error.exit_code(), ExitCode::kInvalidInput);
    return error.what();
  }
  return "it was read";
}

/// A small recording in the example layout.
void WriteExample(const fs::path& folder, NpyArray actions) {
  WriteText(folder / "made", "");
  WriteNpy(folder / "action.npy", actions);
  WriteNpy(folder / "intrinsics.npy", {"<f8", {3, 3}, {40, 0, 24, 0, 41, 16, 0, 0, 1}});
  WriteNpy(folder / "extrinsics.npy", {"<f8", {4, 4}, {0, -1, 0, .5, -1, 0, 0, 0, 0, 0, -1, .8, 0, 0, 0, 1}});
  cv::imwrite((folder / "frame.png").string(), cv::Mat(32, 48, CV_8UC3, cv::Scalar(10, 20, 200)));  // BGR
}

NpyArray Actions(std::size_t steps) {
  NpyArray actions{"<f8", {steps, 16}, {}};
  for (std::size_t step = 0; step < steps; ++step) {
    const double x_m = 0.4 + 0.01 * static_cast<double>(step);
    actions.values.insert(actions.values.end(), {x_m, .2, .3, 0, 0, 0, 1, 0, x_m, -.2, .3, 0, 0, 0, 1, 60});
  }
  return actions;
}

int GreyOf(const cv::Mat& image) { return image.at<cv::Vec3b>(image.rows / 2, image.cols / 2)[1]; }

TEST(Recording, AnExampleFolderBecomesArmsAHeadCameraAndItsFirstFrame) {
  const TempFolder folder;
  WriteExample(folder / "pour", Actions(5));
  const Recording recording = ReadRecording(folder / "pour");
  EXPECT_EQ(recording.id, "pour");
  EXPECT_EQ(recording.period_s, 0.1);
  ASSERT_EQ(recording.arms.size(), 5u);
  EXPECT_NEAR(recording.arms[3][1].base_from_gripper.translation().x(), 0.43, 1e-12);
  EXPECT_EQ(recording.arms[0][1].closure, 0.5);
  ASSERT_EQ(recording.cameras.size(), 1u);
  EXPECT_EQ(recording.cameras[0].name, "head");
  EXPECT_EQ(recording.cameras[0].width_px, 48);
  EXPECT_EQ(recording.cameras[0].mount_from_camera.translation(), Eigen::Vector3d(.5, 0, .8));
  EXPECT_EQ(recording.first_images[0].at<cv::Vec3b>(0, 0), cv::Vec3b(200, 20, 10)) << "RGB";
  EXPECT_TRUE(recording.videos.empty());
}

TEST(Recording, AGripperThatReadsALittlePastClosedIsClosedAndFarPastIsRefused) {
  const TempFolder folder;
  NpyArray actions = Actions(2);
  actions.values[7] = 121.2;
  WriteExample(folder / "a", actions);
  EXPECT_EQ(ReadRecording(folder / "a").arms[0][0].closure, 1);
  actions.values[16 + 15] = 900;
  WriteNpy(folder / "a" / "action.npy", actions);
  EXPECT_THAT(ErrorOf(folder / "a"),
              AllOf(HasSubstr("action.npy: row 1, right arm"), HasSubstr("900"), HasSubstr("120")));
}

TEST(Recording, ABrokenExampleIsRefusedWithTheFileAndTheRow) {
  const TempFolder folder;
  const fs::path bad = folder / "bad";
  NpyArray actions = Actions(3);
  actions.values[2 * 16 + 6] = 0.5;
  WriteExample(bad, actions);
  EXPECT_THAT(ErrorOf(bad),
              AllOf(HasSubstr("action.npy: row 2, left arm"), HasSubstr("length 0.5"), HasSubstr("wanted 1")));
  actions.values[2 * 16 + 1] = std::nan("");
  WriteExample(bad, actions);
  EXPECT_THAT(ErrorOf(bad), HasSubstr("not finite"));
  WriteExample(bad, {"<f8", {2, 14}, std::vector<double>(28, 1)});
  EXPECT_THAT(ErrorOf(bad), HasSubstr("wanted the shape (T, 16)"));
  WriteExample(bad, Actions(3));
  WriteNpy(bad / "intrinsics.npy", {"<f8", {3, 3}, {400, 0, 320, 0, 400, 240, 0, 0, 1}});
  EXPECT_THAT(ErrorOf(bad), AllOf(HasSubstr("intrinsics.npy"), HasSubstr("48x32")));
  // Of the picture before it was made smaller: of a lens that was a little off its middle lay inside the small one too.
  for (const double cx : {47.0, 41.0, 7.0}) {
    WriteNpy(bad / "intrinsics.npy", {"<f8", {3, 3}, {40, 0, cx, 0, 40, 16, 0, 0, 1}});
    EXPECT_THAT(ErrorOf(bad), AllOf(HasSubstr("wanted one within 0.15 … 0.85"), HasSubstr("intrinsics of another size?")));
  }
  WriteNpy(bad / "intrinsics.npy", {"<f8", {3, 3}, {40, 0, 40.5, 0, 40, 5, 0, 0, 1}});
  EXPECT_EQ(ErrorOf(bad), "it was read") << "a lens may be off by a third of the picture";
  WriteExample(bad, Actions(3));
  WriteNpy(bad / "extrinsics.npy", {"<f8", {4, 4}, {2, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1}});
  EXPECT_THAT(ErrorOf(bad), AllOf(HasSubstr("extrinsics.npy"), HasSubstr("no rotation")));
  WriteExample(bad, Actions(3));
  const auto whole = fs::file_size(bad / "frame.png");
  for (const auto length : {whole - 20, whole / 2, std::uintmax_t{60}, std::uintmax_t{5}}) {
    fs::resize_file(bad / "frame.png", length);
    EXPECT_THAT(ErrorOf(bad), HasSubstr("frame.png")) << length;
  }
  fs::remove(bad / "frame.png");
  EXPECT_THAT(ErrorOf(bad), HasSubstr("frame.png"));
}

TEST(Recording, AClipAndATreeHoldTheSameRecording) {
  const TempFolder folder;
  SyntheticClip clip(6);
  clip.cameras = {"head", "hand_left", "hand_right"};
  clip.Write(OneFolder(folder / "327-648642"));
  clip.Write(TreeUnder(folder / "tree"));
  const fs::path episode = folder.path() / "tree/observations/327/648642";
  for (const fs::path& path : {folder / "327-648642", episode, episode / "videos"}) {
    const Recording recording = ReadRecording(path);
    EXPECT_EQ(recording.id, "327-648642");
    EXPECT_NEAR(recording.period_s, 1.0 / 30, 1e-12);
    ASSERT_EQ(recording.arms.size(), 6u);
    for (const int arm : {0, 1})
      EXPECT_TRUE(recording.arms[4][arm].base_from_gripper.isApprox(clip.BaseFromGripper(4, arm), 1e-9));
    EXPECT_NEAR(recording.arms[3][0].closure, 30.0 / 120, 1e-6);
    ASSERT_EQ(recording.videos.size(), 3u);
    EXPECT_NEAR(GreyOf(recording.first_images[0]), SyntheticClip::FrameGrey(0), 2);
  }
}

TEST(Recording, AWristCameraIsDescribedByItsPlaceOnTheGripper) {
  const TempFolder folder;
  SyntheticClip clip(6);
  clip.cameras = {"head", "hand_left", "hand_right"};
  clip.Write(OneFolder(folder / "a"));
  const Recording recording = ReadRecording(folder / "a");
  const Mount mounts[] = {Mount::kBase, Mount::kLeftGripper, Mount::kRightGripper};
  for (const int camera : {0, 1, 2}) {
    EXPECT_EQ(recording.cameras[camera].mount, mounts[camera]);
    EXPECT_TRUE(recording.cameras[camera].mount_from_camera.isApprox(SyntheticClip::MountFromCamera(), 1e-6));
  }
  const Eigen::Isometry3d at_last = BaseFromCamera(recording.cameras[2], recording.arms[5]);
  EXPECT_TRUE(at_last.isApprox(clip.BaseFromGripper(5, 1) * SyntheticClip::MountFromCamera(), 1e-6));
}

TEST(Recording, ASecondFixedCameraOfARobotWithOneArmStaysWhereItIsWhileTheHandMoves) {
  const TempFolder folder;
  SyntheticClip clip(6);
  clip.cameras = {"head", "hand_left", "hand_right"};
  clip.LoseLeftArm();
  clip.Write(OneFolder(folder / "a"));
  const Recording recording = ReadRecording(folder / "a");
  EXPECT_THAT(recording.arm_names, testing::ElementsAre("right"));
  const Mount mounts[] = {Mount::kBase, Mount::kBase, Mount::kRightGripper};
  for (const int camera : {0, 1, 2}) EXPECT_EQ(recording.cameras[camera].mount, mounts[camera]);
  for (const Arms& arms : recording.arms)
    EXPECT_TRUE(BaseFromCamera(recording.cameras[1], arms).isApprox(SyntheticClip::MountFromCamera(), 1e-6));
}

TEST(Recording, ACameraThatMovesOnItsMountIsRefusedUnlessToldToTolerateIt) {
  const TempFolder folder;
  for (const std::string camera : {"head", "hand_left"}) {
    SyntheticClip clip(6);
    clip.cameras = camera == "head" ? std::vector<std::string>{"head"} : std::vector<std::string>{"head", "hand_left"};
    clip.slip_m = 0.06;
    const fs::path path = folder / camera;
    clip.Write(OneFolder(path));
    EXPECT_THAT(ErrorOf(path), AllOf(HasSubstr("extrinsic_params_aligned.json: at step 2"), HasSubstr("0.024 m")));
    EXPECT_EQ(ErrorOf(path, {.camera_tolerance_m = 0.07}), "it was read");
  }
}

TEST(Recording, ItsFramesComeInOrderAndTheLastOneStays) {
  const TempFolder folder;
  SyntheticClip(7).Write(OneFolder(folder / "a"));
  for (const int every_nth : {1, 3}) {
    const Recording recording = ReadRecording(folder / "a", {.every_nth = every_nth});
    ASSERT_EQ(recording.arms.size(), every_nth == 1 ? 7u : 3u);
    EXPECT_NEAR(recording.period_s, every_nth / 30.0, 1e-12);
    EXPECT_NEAR(recording.arms[1][0].base_from_gripper.translation().x(), 0.4 + 0.01 * every_nth, 1e-9);
    RecordedFrames frames(recording);
    for (std::size_t step = 0; step < 10; ++step) {
      const int frame = static_cast<int>(std::min(step, recording.arms.size() - 1)) * every_nth;
      EXPECT_NEAR(GreyOf(frames.Next()[0]), SyntheticClip::FrameGrey(frame), 3)
          << "step " << step << " of every " << every_nth;
    }
  }
}

TEST(Recording, ThinnedToAPeriodItIsTheSameAsReadSo) {
  const TempFolder folder;
  SyntheticClip(7).Write(OneFolder(folder / "a"));
  const Recording recording = ReadRecording(folder / "a"), thinned = Thinned(recording, 0.1);
  EXPECT_EQ(thinned.period_s, 0.1);
  EXPECT_EQ(thinned.every_nth, 3);
  ASSERT_EQ(thinned.arms.size(), 3u);
  EXPECT_EQ(thinned.arms[2][1].base_from_gripper.matrix(), recording.arms[6][1].base_from_gripper.matrix());
  RecordedFrames frames(thinned);
  for (const int frame : {0, 3, 6, 6}) EXPECT_NEAR(GreyOf(frames.Next()[0]), SyntheticClip::FrameGrey(frame), 3);

  EXPECT_EQ(Thinned(recording, 0.033).period_s, 0.033) << "meant exactly";
  EXPECT_EQ(Thinned(recording, 0.033).arms.size(), 7u);
  EXPECT_EQ(Thinned(thinned, 0.2).every_nth, 6);
  for (const double period_s : {0.05, 0.01}) {
    EXPECT_THAT([&] { Thinned(recording, period_s); },
                testing::ThrowsMessage<Error>(AllOf(HasSubstr("steps of 0.03333 s"), HasSubstr("wanted steps of 0.0"))));
  }
}

TEST(Recording, AVideoShorterThanTheArmsTrackIsRefused) {
  const TempFolder folder;
  SyntheticClip clip(6);
  clip.frames = 4;
  clip.Write(OneFolder(folder / "a"));
  EXPECT_THAT(ErrorOf(folder / "a"), AllOf(HasSubstr("head_color.mp4: 4 frames"), HasSubstr("6 steps")));
  const Recording believed = ReadRecording(folder / "a", {.count_video_frames = false});
  RecordedFrames frames(believed);
  for (int step = 0; step < 4; ++step) frames.Next();
  EXPECT_THROW(frames.Next(), Error);
}

/// Frames of 30 Hz beside arms of 10 Hz: picture k was shown with the arms of three times its time.
TEST(Recording, AVideoFarLongerThanTheArmsTrackIsRefused) {
  const TempFolder folder;
  SyntheticClip clip(16);
  std::ranges::fill(clip.grippers, 60.0F);
  clip.frames = 19;
  clip.Write(OneFolder(folder / "a"));
  EXPECT_EQ(ErrorOf(folder / "a"), "it was read") << "it went on a little longer";
  clip.frames = 32;
  clip.Write(OneFolder(folder / "b"));
  EXPECT_THAT(ErrorOf(folder / "b"), AllOf(HasSubstr("head_color.mp4: 32 frames for the 16 steps"), HasSubstr("another rate")));
  SyntheticClip beginning(2);
  beginning.frames = 20;
  beginning.Write(OneFolder(folder / "c"));
  EXPECT_EQ(ErrorOf(folder / "c"), "it was read") << "of an initial state a step or two are enough, beside its whole video";
}

TEST(Recording, WhatIsMissingIsNamed) {
  const TempFolder folder;
  const fs::path clip = folder / "a";
  EXPECT_THAT(ErrorOf(clip), HasSubstr("no such folder"));
  fs::create_directories(clip);
  EXPECT_THAT(ErrorOf(clip), HasSubstr("no recording; wanted"));
  SyntheticClip(4).Write(OneFolder(clip));
  EXPECT_THAT(ErrorOf(clip, {.cameras = {"head", "hand_left"}}), HasSubstr("camera hand_left has no video"));
  fs::copy_file(clip / "head_intrinsic_params.json", clip / "hand_right_intrinsic_params.json");
  EXPECT_THAT(ErrorOf(clip), HasSubstr("camera hand_right, but no video"));
  EXPECT_EQ(ErrorOf(clip, {.cameras = {"head"}}), "it was read");
  fs::copy_file(clip / "head_color.mp4", clip / "hand_right_color.mp4");
  EXPECT_THAT(ErrorOf(clip), HasSubstr("hand_right_extrinsic_params_aligned.json"));
  fs::remove(clip / "head_color.mp4");
  EXPECT_THAT(ErrorOf(clip, {.cameras = {"head"}}), HasSubstr("head_color.mp4: missing"));
  EXPECT_THAT(ErrorOf(clip), HasSubstr("head_color.mp4: missing: camera head")) << "the hand's video is there";
}

/// One such folder among many ended the command as if it were our fault, with nothing packed.
TEST(Recording, AFolderThatCannotBeLookedIntoIsFoundAndRefused) {
  const TempFolder folder;
  const fs::path all = fs::canonical(folder.path()) / "all", tree = fs::canonical(folder.path()) / "tree";
  fs::create_directories(tree / "observations");
  WriteExample(all / "good", Actions(3));
  for (const fs::path& loop : {all / "loop", tree / "observations/loop"}) {
    fs::create_symlink("loop", loop);
    EXPECT_THAT(ErrorOf(loop), HasSubstr("loop: no such folder"));
    EXPECT_FALSE(IsRecording(loop));
    EXPECT_EQ(RecordingId(loop), "loop");
    EXPECT_THAT(FoldersOf(loop), testing::ElementsAre(loop));
  }
  EXPECT_THAT(FindRecordings(all), testing::ElementsAre(all / "good", all / "loop"));
  EXPECT_THAT(FindRecordings(tree), testing::ElementsAre(tree / "observations/loop"));
  const fs::path far_too_long = all / std::string(300, 'a');
  EXPECT_THAT(ErrorOf(far_too_long), HasSubstr("no such folder"));
  EXPECT_FALSE(IsRecording(far_too_long));
  EXPECT_THROW(FindRecordings(far_too_long), Error);
  SyntheticClip(4).Write(OneFolder(all / "clip"));
  fs::create_symlink("hand_left_color.mp4", all / "clip/hand_left_color.mp4");
  EXPECT_THAT(ErrorOf(all / "clip"), HasSubstr("hand_left_color.mp4: cannot be looked at"));
}

TEST(Recording, AClipWithOnlyAFirstFrameIsReadAtThirtyHertz) {
  const TempFolder folder;
  SyntheticClip(4).Write(OneFolder(folder / "a"));
  fs::remove(folder / "a" / "head_color.mp4");
  cv::imwrite((folder / "a" / "frame.png").string(), cv::Mat(32, 48, CV_8UC3, cv::Scalar::all(77)));
  const Recording recording = ReadRecording(folder / "a");
  EXPECT_NEAR(recording.period_s, 1.0 / 30, 1e-12);
  EXPECT_EQ(GreyOf(recording.first_images[0]), 77);
  EXPECT_TRUE(recording.videos.empty());
  EXPECT_EQ(ReadRecording(folder / "a", {.recorded_period_s = 0.05}).period_s, 0.05);
}

/// A first frame and a step or two could begin no episode of a network whose frames are .05 s apart.
TEST(Recording, ABeginningOfWhichNoVideoSaysTheRateIsInStepsOfThePeriodThatIsWanted) {
  const TempFolder folder;
  const auto without_video = [&](const std::string& name, int steps) {
    SyntheticClip clip(steps);
    std::ranges::fill(clip.grippers, 60.0F);
    clip.Write(OneFolder(folder / name));
    fs::remove(folder / name / "head_color.mp4");
    cv::imwrite((folder / name / "frame.png").string(), cv::Mat(32, 48, CV_8UC3, cv::Scalar::all(77)));
    return ReadRecording(folder / name);
  };
  const Recording beginning = BegunFrom(without_video("a", 2), 0.05);
  EXPECT_EQ(beginning.period_s, 0.05);
  EXPECT_EQ(beginning.arms.size(), 2u);
  EXPECT_THAT(beginning.source, HasSubstr("taken to be 0.05 s apart"));
  EXPECT_EQ(BegunFrom(without_video("b", 7), 0.1).arms.size(), 3u) << "thinned where it can be";
  const auto refused = testing::ThrowsMessage<Error>(HasSubstr("wanted steps of 0.05 s, or of a whole part of it"));
  EXPECT_THAT([&] { BegunFrom(without_video("c", 16), 0.05); }, refused) << "an episode";
  SyntheticClip(2).Write(OneFolder(folder / "d"));
  EXPECT_THAT([&] { BegunFrom(ReadRecording(folder / "d"), 0.05); }, refused) << "its video says 30 Hz";
}

TEST(Recording, BrokenNumbersInTheTrackAreRefusedWithStepAndArm) {
  const TempFolder folder;
  SyntheticClip clip(4);
  clip.positions_m[(2 * 2 + 1) * 3] = std::numeric_limits<double>::infinity();
  clip.Write(OneFolder(folder / "infinite"));
  EXPECT_THAT(ErrorOf(folder / "infinite"),
              HasSubstr("proprio_stats.h5: state/end: step 2, right arm: the pose is not finite"));
  clip = SyntheticClip(4);
  clip.quaternions_xyzw[3] = 0;
  clip.Write(OneFolder(folder / "zero"));
  EXPECT_THAT(ErrorOf(folder / "zero"), HasSubstr("step 0, left arm: the quaternion has length 0"));
}

TEST(Recording, ABrokenTrackFileIsRefused) {
  const TempFolder folder;
  const fs::path clip = folder / "a";
  SyntheticClip(4).Write(OneFolder(clip));
  const std::string whole = ReadFile(clip / "proprio_stats.h5");
  for (const std::size_t length : {std::size_t{0}, std::size_t{100}, whole.size() / 2, whole.size() - 100}) {
    WriteText(clip / "proprio_stats.h5", whole.substr(0, length));
    EXPECT_THAT(ErrorOf(clip), HasSubstr("proprio_stats.h5")) << length;
  }
}

TEST(Recording, CameraPagesAreCheckedFieldByField) {
  const auto intrinsics = [](const std::string& json) {
    try {
      ParseIntrinsics(json, "page.json");
    } catch (const Error& error) {
      return std::string(error.what());
    }
    return std::string("it was read");
  };
  EXPECT_EQ(intrinsics(R"({"intrinsic": {"fx": 1, "fy": 1, "ppx": 1, "ppy": 1, "k1": 0, "distortion_model": "none"}})"),
            "it was read");
  EXPECT_THAT(intrinsics(R"({"intrinsic": {"fx": 1, "fy": 1, "ppx": 1, "ppy": 1, "k1": 0.1}})"),
              HasSubstr("intrinsic.k1 holds 0.1"));
  EXPECT_THAT(intrinsics(R"({"intrinsic": {"fx": 1, "fy": 1, "ppx": 1, "ppy": 1, "dist_coeffs": [0, 0.2]}})"),
              HasSubstr("0.2"));
  EXPECT_THAT(intrinsics(R"({"intrinsic": {"fx": 1, "fy": 1, "ppx": 1, "ppy": 1, "distortion": {"k1": "-0.3"}}})"),
              HasSubstr("intrinsic.distortion holds -0.3"));
  EXPECT_THAT(intrinsics(R"({"intrinsic": {"fx": 1, "fy": 1, "ppx": 1, "ppy": 1}, "D": [[0, 0], [1e-3]]})"),
              HasSubstr("D holds 0.001"));
  EXPECT_THAT(intrinsics(R"({"intrinsic": {"fx": 1, "fy": 1, "ppx": 1, "ppy": 1}, "lens": [{"k2": 0.4}]})"),
              HasSubstr("k2 holds 0.4"));
  EXPECT_THAT(intrinsics(R"({"intrinsic": {"fx": 1, "fy": "2", "ppx": 1, "ppy": 1}})"),
              HasSubstr("intrinsic.fy: found string"));
  EXPECT_THAT(intrinsics(R"({"intrinsic": {"fx": 1}})"), HasSubstr("field fy is missing"));
  EXPECT_THAT(intrinsics("[1]"), HasSubstr("field intrinsic is missing"));
  EXPECT_THAT(intrinsics("{"), HasSubstr("page.json: no JSON"));
  EXPECT_THAT(intrinsics(std::string(1000000, '[') + std::string(1000000, ']')), HasSubstr("more than 32 deep"));
  EXPECT_THROW(ParseExtrinsics("[]", "page.json"), Error);
  EXPECT_THROW(
      ParseExtrinsics(R"([{"extrinsic": {"rotation_matrix": [[1,0,0],[0,1,0]], "translation_vector": [0,0,0]}}])",
                      "page.json"),
      Error);
  EXPECT_THROW(ParseExtrinsics(
                   R"([{"extrinsic": {"rotation_matrix": [[1,0,0],[0,1,0],[0,0,-1]], "translation_vector": [0,0,0]}}])",
                   "page.json"),
               Error);
}

/// Of an .h5 file they were refused, as the page on formats says.
TEST(Recording, AnExampleOfMoreThanAMillionStepsIsRefused) {
  const TempFolder folder;
  WriteExample(folder / "long", {"|u1", {1'000'001, 16}, std::vector<double>(16'000'016, 0)});
  EXPECT_THAT(ErrorOf(folder / "long"), HasSubstr("action.npy: 1000001 steps, wanted 1 … 1000000"));
}

TEST(Recording, FourFilesOfAnyNameAreReadAsTheFoldersThatHoldThem) {
  const TempFolder folder;
  const fs::path example = folder / "pour", clip = folder / "clip";
  WriteExample(example, Actions(5));
  SyntheticClip(6).Write(OneFolder(clip));
  const Recording by_name = ReadRecordingFiles({example / "frame.png", example / "action.npy",
                                                example / "extrinsics.npy", example / "intrinsics.npy"});
  EXPECT_EQ(by_name.period_s, 0.1);
  EXPECT_EQ(by_name.arms.size(), 5u);
  EXPECT_EQ(by_name.cameras[0].fy_px, 41);
  const fs::path extrinsics = clip / "head_extrinsic_params_aligned.json";
  const Recording mixed = ReadRecordingFiles(
      {example / "frame.png", clip / "proprio_stats.h5", extrinsics, example / "intrinsics.npy"}, {.every_nth = 3});
  EXPECT_EQ(mixed.period_s, 0.1);
  EXPECT_EQ(mixed.arms.size(), 2u);
  EXPECT_TRUE(mixed.cameras[0].mount_from_camera.isApprox(SyntheticClip::MountFromCamera(), 1e-9));
  try {
    ReadRecordingFiles({example / "frame.png", example / "frame.png", extrinsics, example / "intrinsics.npy"});
    ADD_FAILURE() << "it was read";
  } catch (const Error& error) {
    EXPECT_THAT(error.what(), HasSubstr("found the ending '.png', wanted .npy or .h5"));
  }
}

TEST(Recording, FourFilesOfARobotWithoutALeftArmHaveTheRightOneAlone) {
  const TempFolder folder;
  NpyArray actions = Actions(3);
  for (std::size_t i = 0; i < actions.values.size(); ++i) {
    if (i % 16 < 8) actions.values[i] = i % 16 == 6 ? 1 : 0;
  }
  WriteExample(folder / "a", actions);
  const Recording recording = ReadRecordingFiles({folder / "a" / "frame.png", folder / "a" / "action.npy",
                                                  folder / "a" / "extrinsics.npy", folder / "a" / "intrinsics.npy"});
  EXPECT_EQ(recording.arm_names, std::vector<std::string>{"right"});
  ASSERT_EQ(recording.arms[2].size(), 1u);
  EXPECT_EQ(recording.arms[2][0].base_from_gripper.translation().y(), -0.2);
}

TEST(Recording, ItsTaskAcceptsEveryRecordedStep) {
  const TempFolder folder;
  WriteExample(folder / "a b", Actions(9));
  const Recording recording = ReadRecording(folder / "a b");
  const Task task = TaskFromRecording(recording);
  EXPECT_EQ(task.id, "a_b");
  EXPECT_FALSE(task.still.enabled);
  EXPECT_EQ(task.max_chunks, 8);
  EXPECT_EQ(WhatIsWrong(ActionChunk{{recording.arms.begin() + 1, recording.arms.end()}}, task, 100), std::nullopt);
  EXPECT_EQ(WhatIsWrong(Observation{recording.first_images, recording.arms[0], true}, task), std::nullopt);
  EXPECT_EQ(InitialSceneOf(recording).cameras.size(), 1u);
}

TEST(Recording, AModelIsToldWhereTheArmsWereAtFirstAndThenWhereTheyWereToldToBe) {
  const auto at_x_m = [](double x_m) {
    ArmState arm;
    arm.base_from_gripper.translation().x() = x_m;
    return Arms{arm};
  };
  Recording recording;
  recording.arms = {at_x_m(0.1), at_x_m(0.2), at_x_m(0.3)};
  EXPECT_EQ(ToldTrack(recording)[1][0].base_from_gripper.translation().x(), 0.2);
  recording.told = {at_x_m(0.15), at_x_m(0.25), at_x_m(0.35)};
  const std::vector<Arms> track = ToldTrack(recording);
  ASSERT_EQ(track.size(), 3u);
  EXPECT_EQ(track[0][0].base_from_gripper.translation().x(), 0.1);
  EXPECT_EQ(track[2][0].base_from_gripper.translation().x(), 0.35);
}

TEST(Recording, TheRealExamplesAreReadWhole) {
  const fs::path examples = fs::path(EVAC_SHARED_DIR) / "data/agibot_examples";
  if (!fs::exists(examples)) GTEST_SKIP() << "no shared data at " << examples;
  for (const std::string name : {"example0", "example1"}) {
    const Recording recording = ReadRecording(examples / name);
    EXPECT_EQ(recording.arms.size(), 334u);
    EXPECT_EQ(recording.cameras[0].width_px, 640);
    EXPECT_EQ(recording.first_images[0].rows, 480);
    double most_closed = 0;
    for (const Arms& arms : recording.arms) most_closed = std::max({most_closed, arms[0].closure, arms[1].closure});
    EXPECT_EQ(most_closed, 1) << "the gripper exceeds 120 in both";
    const auto pixel = Project(recording.cameras[0], recording.cameras[0].mount_from_camera.inverse() *
                                                         recording.arms[0][0].base_from_gripper.translation());
    ASSERT_TRUE(pixel.has_value()) << "the camera looks at the left gripper";
  }
  EXPECT_EQ(ReadRecording(examples / "example0").arms[0][0].closure, 35.279998779296875 / 120);
}

}  // namespace
}  // namespace evac
