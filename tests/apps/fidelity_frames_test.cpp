#include "apps/networks/fidelity_frames.h"

#include <gtest/gtest.h>

#include <atomic>
#include <cmath>
#include <functional>
#include <opencv2/imgproc.hpp>

#include "core/error.h"
#include "core/file.h"
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

/// Chunks that only one of the clips has to their end count nothing, nor do clips that cannot be read to theirs.
TEST_F(Drift, WhatEndsWithinAChunkChangesNothingOfIt) {
  const auto write = [&](const std::string& name, int frames) {
    VideoWriter writer(folder_ / name, {.crf = 0});
    for (int time = 0; time < frames; ++time)
      writer.Append(Drawn({InReality(time % kFrames).thing, kGripper + cv::Point(1, 0)}));
    return writer.Finish().path;
  };
  DriftMeter drift = Of([](int) { return InReality(0); });
  const std::vector<ChunkDrift> before = drift.Chunks();
  ClipPair clips{&task_, Write("other.mp4", InReality), write("short.mp4", kFrames - 1), {}, 1, 0};
  drift.Add(clips);
  const std::vector<ChunkDrift> after = drift.Chunks();
  ASSERT_EQ(after.size(), 2u);
  EXPECT_EQ(after[0].clips, 2);
  EXPECT_NE(*after[0].psnr, *before[0].psnr);
  EXPECT_EQ(after[1].clips, 1);
  EXPECT_EQ(*after[1].psnr, *before[1].psnr);
  EXPECT_EQ(*after[1].psnr_moving, *before[1].psnr_moving);
  EXPECT_EQ(drift.object_px().size(), 2u);

  const std::filesystem::path cut = folder_ / "cut.mp4";
  const std::string whole = ReadFile(write("long.mp4", 20 * kFrames));
  WriteFileAtomically(cut, whole.substr(0, whole.size() * 3 / 4));
  for (const bool is_real : {true, false}) {
    ClipPair broken = clips;
    (is_real ? broken.real : broken.model) = cut;
    EXPECT_THROW(drift.Add(broken), Error) << "behind the other's end";
  }
  EXPECT_EQ(drift.Chunks()[0].clips, 2);
  EXPECT_EQ(*drift.Chunks()[0].psnr, *after[0].psnr);
}

/// Counts how many bytes of pictures are held at once; OpenCV's own allocator does the work.
class CountedPictures final : public cv::MatAllocator {
 public:
  /// The most while this is done.
  static std::int64_t PeakOf(const std::function<void()>& work) {
    static CountedPictures& counted = *new CountedPictures;  // a picture that outlives the work is freed by it too
    cv::Mat::setDefaultAllocator(&counted);
    counted.peak_ = counted.now_.load();
    work();
    cv::Mat::setDefaultAllocator(counted.own_);
    return counted.peak_;
  }

  cv::UMatData* allocate(int dims, const int* sizes, int type, void* data, std::size_t* step, cv::AccessFlag flags,
                         cv::UMatUsageFlags usage) const override {
    cv::UMatData* made = own_->allocate(dims, sizes, type, data, step, flags, usage);
    made->prevAllocator = made->currAllocator = this;
    const std::int64_t now = now_ += static_cast<std::int64_t>(made->size);
    for (std::int64_t peak = peak_; now > peak && !peak_.compare_exchange_weak(peak, now);) {
    }
    return made;
  }
  bool allocate(cv::UMatData* data, cv::AccessFlag flags, cv::UMatUsageFlags usage) const override {
    return own_->allocate(data, flags, usage);
  }
  void deallocate(cv::UMatData* data) const override {
    if (data == nullptr) return;
    now_ -= static_cast<std::int64_t>(data->size);
    own_->deallocate(data);
  }

 private:
  cv::MatAllocator* own_ = cv::Mat::getStdAllocator();
  mutable std::atomic<std::int64_t> now_ = 0, peak_ = 0;
};

/// Both clips lay in memory as they were decoded: at four times the size, of 320 frames, gigabytes.
TEST_F(Drift, LongClipsTakeNoMoreMemoryThanShortOnes) {
  constexpr int kScale = 4, kLong = 120;
  const auto write = [&](const std::string& name) {
    VideoWriter writer(folder_ / name, {.preset = "ultrafast", .scale = kScale});
    for (int time = 0; time < kLong; ++time) writer.Append(Drawn(InReality(time % 30)));
    return writer.Finish().path;
  };
  const ClipPair clips{&task_, write("real.mp4"), write("model.mp4"), {}, kScale, 0};
  DriftMeter drift(kChunk);
  constexpr std::int64_t kFrame_bytes = std::int64_t{3} * kScale * kWidth_px * kScale * kHeight_px;
  const std::int64_t peak = CountedPictures::PeakOf([&] { drift.Add(clips); });
  EXPECT_EQ(drift.Chunks().size(), std::size_t{(kLong - 1) / kChunk});
  EXPECT_GT(peak, kFrame_bytes) << "or nothing was counted";
  EXPECT_LT(peak, 10 * kFrame_bytes);
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
