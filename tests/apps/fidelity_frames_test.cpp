#include "apps/networks/fidelity_frames.h"

#include <gtest/gtest.h>

#include <cmath>
#include <opencv2/imgproc.hpp>

#include "core/video.h"
#include "tests/support/temp_folder.h"

/// Clips drawn here: a green thing that walks, and a speckled gripper that stands.
namespace evac {
namespace {

constexpr int kChunk = 4, kFrames = 1 + 2 * kChunk;
constexpr int kWidth_px = 96, kHeight_px = 64;
const cv::Point kGripper(60, 44);  ///< its middle

/// What is seen at one time.
struct Seen {
  std::optional<cv::Point> thing;    ///< its upper left corner
  std::optional<cv::Point> gripper;  ///< its middle
};

cv::Mat Drawn(const Seen& seen) {
  cv::Mat rgb(kHeight_px, kWidth_px, CV_8UC3, cv::Scalar::all(150));
  if (seen.thing) rgb(cv::Rect(*seen.thing, cv::Size(8, 8))).setTo(cv::Scalar(36, 180, 91));
  if (seen.gripper) {
    cv::Mat grey(15, 15, CV_8UC1);
    cv::RNG(7).fill(grey, cv::RNG::UNIFORM, 40, 220);
    cv::Mat speckles;
    cv::cvtColor(grey, speckles, cv::COLOR_GRAY2RGB);
    speckles.copyTo(rgb(cv::Rect(*seen.gripper - cv::Point(7, 7), speckles.size())));
  }
  return rgb;
}

Seen InReality(int time) { return {cv::Point(20 + 2 * time, 10), kGripper}; }

Task TakeBottle() {
  Task task;
  task.id = "take_bottle";
  task.cameras = {{.name = "head", .width_px = kWidth_px, .height_px = kHeight_px, .fx_px = 100, .fy_px = 100,
                   .cx_px = kWidth_px / 2.0, .cy_px = kHeight_px / 2.0}};
  return task;
}

class Drift : public testing::Test {
 protected:
  std::filesystem::path Write(const std::string& name, const std::function<Seen(int)>& seen) const {
    VideoWriter writer(folder_ / name, {.crf = 0});
    for (int time = 0; time < kFrames; ++time) writer.Append(Drawn(seen(time)));
    return writer.Finish().path;
  }

  /// Of reality against what the model shows.
  DriftMeter Of(const std::function<Seen(int)>& model) const {
    ArmState arm;  // a metre before the head camera
    arm.base_from_gripper.translation() = Eigen::Vector3d((kGripper.x + 0.5 - 48) / 100, (kGripper.y + 0.5 - 32) / 100, 1);
    DriftMeter drift(kChunk);
    drift.Add({.task = &task_,
               .real = Write("real.mp4", InReality),
               .model = Write("model.mp4", model),
               .commands = std::vector<Arms>(kFrames - 1, Arms{arm}),
               .scale = 1,
               .tool_length_m = 0});
    return drift;
  }

  const TempFolder folder_;
  const Task task_ = TakeBottle();
};

TEST_F(Drift, AThingThatEndsElsewhereIsOffBySoManyPixels) {
  const DriftMeter drift = Of([](int time) { return Seen{*InReality(time).thing + cv::Point(6, 8), kGripper}; });
  ASSERT_EQ(drift.object_px().size(), 1u);
  EXPECT_NEAR(drift.object_px()[0], 10, 0.5);
}

TEST_F(Drift, AThingThatIsNowhereIsOffByTheWholePicture) {
  const DriftMeter drift = Of([](int) { return Seen{std::nullopt, kGripper}; });
  ASSERT_EQ(drift.object_px().size(), 1u);
  EXPECT_DOUBLE_EQ(drift.object_px()[0], std::hypot(kWidth_px, kHeight_px));
}

TEST_F(Drift, APictureThatStandsStillIsAsGoodAsACopyOfTheFirst) {
  const std::vector<ChunkDrift> chunks = Of([](int) { return InReality(0); }).Chunks();
  ASSERT_EQ(chunks.size(), 2u);
  for (const ChunkDrift& chunk : chunks) {
    EXPECT_EQ(chunk.clips, 1);
    EXPECT_NEAR(*chunk.psnr_moving, *chunk.psnr_moving_copy, 0.01);
    EXPECT_LT(*chunk.psnr_moving, 20);
    EXPECT_GT(*chunk.psnr, *chunk.psnr_moving) << "most of the picture stands still";
  }
}

TEST_F(Drift, ThePicturesOfRealityAreFarBetterThanACopyOfTheFirst) {
  const std::vector<ChunkDrift> chunks = Of(InReality).Chunks();
  ASSERT_EQ(chunks.size(), 2u);
  for (const ChunkDrift& chunk : chunks) {
    EXPECT_GT(*chunk.psnr_moving, *chunk.psnr_moving_copy + 20);
    EXPECT_EQ(*chunk.gripper_px, 0);
    EXPECT_EQ(*chunk.gripper_found, 1);
  }
}

TEST_F(Drift, AGripperThatIsFoundElsewhereIsOffAndOneThatIsGoneIsNotFound) {
  const std::vector<ChunkDrift> chunks = Of([](int time) {
    const bool is_gone = time > kChunk + 1;
    return Seen{InReality(time).thing, is_gone ? std::nullopt : std::optional(kGripper + cv::Point(3, 4))};
  }).Chunks();
  ASSERT_EQ(chunks.size(), 2u);
  EXPECT_DOUBLE_EQ(*chunks[0].gripper_px, 5);
  EXPECT_DOUBLE_EQ(*chunks[0].gripper_found, 1);
  EXPECT_DOUBLE_EQ(*chunks[1].gripper_px, 5) << "over those that were found";
  EXPECT_DOUBLE_EQ(*chunks[1].gripper_found, 0.25);
}

/// Only the last arm was looked at: a robot that works with its left hand was measured by the other.
TEST_F(Drift, BothArmsGrippersAreLookedFor) {
  ArmState works, idle;
  works.base_from_gripper.translation() = Eigen::Vector3d((kGripper.x + 0.5 - 48) / 100, (kGripper.y + 0.5 - 32) / 100, 1);
  idle.base_from_gripper.translation() = Eigen::Vector3d(0, 0, -1);  // behind the camera
  DriftMeter drift(kChunk);
  drift.Add({&task_, Write("real.mp4", InReality), Write("model.mp4", [](int time) { return Seen{InReality(time).thing, kGripper + cv::Point(3, 4)}; }),
             std::vector<Arms>(kFrames - 1, Arms{works, idle}), 1, 0});
  ASSERT_EQ(drift.Chunks().size(), 2u);
  EXPECT_DOUBLE_EQ(*drift.Chunks()[0].gripper_px, 5);
}

TEST_F(Drift, AGripperThatIsTooPlainToBeFoundIsNotFoundAnywhere) {
  const auto plain = [](int time) { return Seen{InReality(time).thing, std::nullopt}; };
  DriftMeter drift(kChunk);
  ArmState arm;
  arm.base_from_gripper.translation() = Eigen::Vector3d((kGripper.x + 0.5 - 48) / 100, (kGripper.y + 0.5 - 32) / 100, 1);
  drift.Add({&task_, Write("real.mp4", plain), Write("model.mp4", InReality), std::vector<Arms>(kFrames - 1, Arms{arm}), 1, 0});
  ASSERT_EQ(drift.Chunks().size(), 2u);
  for (const ChunkDrift& chunk : drift.Chunks()) {
    EXPECT_FALSE(chunk.gripper_px);
    EXPECT_FALSE(chunk.gripper_found) << "where it is plain nobody could find it";
  }
}

/// Below a lower view the picture is black in both: nobody imagined that.
TEST_F(Drift, PicturesAreComparedWhereThereIsAView) {
  Task with_hand = task_;
  with_hand.cameras.push_back({.name = "hand_right", .width_px = 32, .height_px = 16});
  const auto write = [&](const std::string& name, int grey) {
    VideoWriter writer(folder_ / name, {.crf = 0});
    for (int time = 0; time < kFrames; ++time)
      writer.Append(SideBySide({Drawn(InReality(time)), cv::Mat(16, 32, CV_8UC3, cv::Scalar::all(grey))}));
    return writer.Finish().path;
  };
  DriftMeter drift(kChunk);
  drift.Add({&with_hand, write("real.mp4", 100), write("model.mp4", 160), {}, 1, 0});
  const double head = kWidth_px * kHeight_px, hand = 32 * 16, error = 60 * 60 * hand / (head + hand);
  EXPECT_NEAR(*drift.Chunks().at(0).psnr, 10 * std::log10(255 * 255 / error), 0.2);
}

TEST(FindObject, FindsTheMiddleOfTheTasksThingByItsColour) {
  const auto found = FindObject(TakeBottle(), Drawn({cv::Point(30, 12), std::nullopt}));
  ASSERT_TRUE(found);
  EXPECT_NEAR(found->x, 34, 0.1);
  EXPECT_NEAR(found->y, 16, 0.1);
  EXPECT_FALSE(FindObject(TakeBottle(), Drawn({std::nullopt, kGripper}))) << "no green anywhere";
  Task unknown = TakeBottle();
  unknown.id = "fold_laundry";
  EXPECT_FALSE(FindObject(unknown, Drawn({cv::Point(30, 12), std::nullopt})));
}

}  // namespace
}  // namespace evac
