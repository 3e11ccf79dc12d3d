#include "worldmodel/clip.h"

#include <gmock/gmock.h>

#include <algorithm>
#include <cmath>
#include <set>

#include "core/file.h"
#include "core/geometry.h"
#include "core/tensor_file.h"
#include "tests/support/temp_folder.h"
#include "worldmodel/action_delta.h"
#include "worldmodel/conditioning.h"
#include "worldmodel/motion_statistics.h"
#include "worldmodel/shard_writer.h"

namespace evac {
namespace {

constexpr int kWidth_px = 96, kHeight_px = 64, kSteps = 6;

Camera Head() {
  Camera camera{"head", kWidth_px, kHeight_px, 88, 88, 48, 32, Mount::kBase, Eigen::Isometry3d::Identity()};
  camera.mount_from_camera = Eigen::Translation3d(0.4, 0, 1.0) * Eigen::AngleAxisd(M_PI, Eigen::Vector3d::UnitX());
  return camera;
}

Arms ArmAt(int step) {
  Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
  pose.translation() = Eigen::Vector3d(0.35 + 0.01 * step * step, 0.02 * step, 0.3);
  return {{pose, 0.1 * step}};
}

/// A bright dot on black at the object's place.
ClipSource Source(const Eigen::Vector2d& dot_px) {
  ClipSource source;
  source.cameras = {Head()};
  source.truth.cameras = {"head"};
  for (int step = 0; step < kSteps; ++step) {
    source.arms.push_back(ArmAt(step));
    cv::Mat picture(kHeight_px, kWidth_px, CV_8UC3, cv::Scalar::all(0));
    picture.at<cv::Vec3b>(static_cast<int>(dot_px.y()), static_cast<int>(dot_px.x())) = cv::Vec3b(255, 255, 255);
    source.pictures.push_back({picture});
    source.truth.object_px.insert(source.truth.object_px.end(),
                                  {static_cast<float>(dot_px.x()), static_cast<float>(dot_px.y())});
    source.truth.contact.push_back(step == 2);
  }
  return source;
}

ClipOptions Options() {
  ClipOptions options;
  options.picture_px = {kWidth_px, kHeight_px};
  options.statistics = AgiBotWorldStatistics();
  options.pose_map = PoseMapOptions::ForHeight(kHeight_px);
  return options;
}

TEST(Clip, TheWholePictureIsCopiedAsItIs) {
  const ClipSource source = Source({30.5, 20.5});
  const Clip clip = MakeClip(source, {0, 0, kWidth_px, kHeight_px}, Options());
  ASSERT_EQ(clip.frames.size(), std::size_t{kSteps} * kHeight_px * kWidth_px * 3);
  EXPECT_TRUE(std::equal(source.pictures[0][0].datastart, source.pictures[0][0].dataend, clip.frames.begin()));
  EXPECT_FLOAT_EQ(clip.object_px[0], 30.5F);
  EXPECT_EQ(clip.contact, (std::vector<std::uint8_t>{0, 0, 1, 0, 0, 0}));
}

TEST(Clip, ACropMovesPictureObjectAndIntrinsicsTogether) {
  const Crop crop{8, 4, 84, 56};
  const Clip clip = MakeClip(Source({40.5, 30.5}), crop, Options());
  double sum = 0, x = 0, y = 0;  // the dot's middle, by its light
  for (int v = 0; v < kHeight_px; ++v) {
    for (int u = 0; u < kWidth_px; ++u) {
      const double light = clip.frames[static_cast<std::size_t>((v * kWidth_px + u) * 3)];
      sum += light;
      x += light * (u + 0.5);
      y += light * (v + 0.5);
    }
  }
  ASSERT_GT(sum, 0);
  EXPECT_NEAR(x / sum, clip.object_px[0], 0.15);
  EXPECT_NEAR(y / sum, clip.object_px[1], 0.15);
  // A point of the scene lands where the crop has moved its pixel to.
  const Eigen::Vector3d point_m(0.1, -0.05, 0.8);
  const Eigen::Vector2d before_px = *Project(Head(), point_m);
  const double u_px = (clip.k[0] * point_m.x() + clip.k[2] * point_m.z()) / point_m.z();
  EXPECT_NEAR(u_px, (before_px.x() - crop.x_px) * kWidth_px / crop.width_px, 1e-4);
}

TEST(Clip, MapsAreThoseThatAWorldWouldDrawForTheCroppedCamera) {
  const Crop crop{5, 3, 88, 60};
  const ClipSource source = Source({40.5, 30.5});
  const Clip clip = MakeClip(source, crop, Options());
  const Camera cropped = Cropped(Head(), crop, {kWidth_px, kHeight_px});
  const cv::Mat map = DrawPoseMaps(source.arms[3], std::span(&cropped, 1), Options().pose_map).front();
  const std::size_t size = map.total() * 3;
  EXPECT_TRUE(std::equal(map.datastart, map.dataend, clip.maps.begin() + static_cast<std::ptrdiff_t>(3 * size)));
}

TEST(Clip, ArmsThatFollowLateAreDrawnAndCarryTheirCamerasWhereTheyAreSeen) {
  ClipSource source = Source({40.5, 30.5});
  source.cameras[0].mount = Mount::kRightGripper;
  source.cameras[0].mount_from_camera = Eigen::Isometry3d(Eigen::Translation3d(0, 0.05, 0.1));
  ClipOptions options = Options();
  options.pose_map.lag_frames = 0.25;
  const Clip clip = MakeClip(source, {0, 0, kWidth_px, kHeight_px}, options);
  const auto x_m = [&](std::size_t step) { return clip.c2w[step * 16 + 3]; };
  EXPECT_NEAR(x_m(0), 0.35, 1e-6) << "nothing came before the first";
  EXPECT_NEAR(x_m(3), 0.35 + 0.75 * 0.09 + 0.25 * 0.04, 1e-6);
  EXPECT_FLOAT_EQ(clip.actions[3 * 16 + 8], 0.35F + 0.09F) << "told is told";
  const Arms seen = SeenArms(source.arms[2], source.arms[3], 0.25);
  const cv::Mat map = DrawPoseMaps(seen, source.cameras, options.pose_map).front();
  EXPECT_TRUE(std::equal(map.datastart, map.dataend,
                         clip.maps.begin() + static_cast<std::ptrdiff_t>(3 * map.total() * 3)));
}

TEST(Clip, DeltasAreTheStepsIntoEachFrameAsTheWorldModelIsTold) {
  const ClipSource source = Source({40.5, 30.5});
  const Clip clip = MakeClip(source, {0, 0, kWidth_px, kHeight_px}, Options());
  for (int i = 0; i < 14; ++i) EXPECT_EQ(clip.deltas[static_cast<std::size_t>(i)], 0);
  const auto wanted =
      Normalised(DeltaBetween(GrippersOf(source.arms[2]), GrippersOf(source.arms[3])), AgiBotWorldStatistics(), 3);
  for (std::size_t i = 0; i < 14; ++i) EXPECT_EQ(clip.deltas[3 * 14 + i], wanted[i]);
}

TEST(Clip, AnArmThatIsNotThereIsAtTheOriginInTheActions) {
  const std::vector<float> row = ActionRow(ArmAt(5));
  EXPECT_THAT(std::vector<float>(row.begin(), row.begin() + 8), testing::ElementsAre(0, 0, 0, 0, 0, 0, 1, 0));
  EXPECT_FLOAT_EQ(row[15], 60);
}

/// Three quarters passed, and would have been other training than the reference's.
TEST(Clip, RandomCropsStayInThePictureAndKeepSevenEighthsOfIt) {
  SplitMix64 random(5);
  std::set<int> widths_px, lefts_px;
  for (int i = 0; i < 1000; ++i) {
    const Crop crop = RandomCrop({kWidth_px, kHeight_px}, random);
    EXPECT_GE(crop.x_px, 0);
    EXPECT_GE(crop.y_px, 0);
    EXPECT_LE(crop.x_px, kWidth_px / 8);
    EXPECT_LE(crop.y_px, kHeight_px / 8);
    EXPECT_LE(crop.x_px + crop.width_px, kWidth_px);
    EXPECT_LE(crop.y_px + crop.height_px, kHeight_px);
    EXPECT_GE(crop.width_px, 7 * kWidth_px / 8);
    EXPECT_GE(crop.height_px, 7 * kHeight_px / 8);
    widths_px.insert(crop.width_px);
    lefts_px.insert(crop.x_px);
  }
  EXPECT_EQ(*widths_px.begin(), 7 * kWidth_px / 8);
  EXPECT_EQ(*widths_px.rbegin(), kWidth_px) << "all of it";
  EXPECT_EQ(*lefts_px.begin(), 0);
  EXPECT_EQ(*lefts_px.rbegin(), kWidth_px / 8);
}

TEST(MotionSums, HowFarArmsAreBehindWhatTheyAreToldIsFoundInFrames) {
  std::vector<Arms> told, measured;
  for (int step = 0; step < kSteps; ++step) {
    told.push_back(ArmAt(step));
    measured.push_back(SeenArms(ArmAt(std::max(0, step - 1)), ArmAt(step), 0.4));
  }
  LagSums lag, nothing;
  lag.Add(told, measured);
  ASSERT_TRUE(lag.Frames());
  EXPECT_NEAR(*lag.Frames(), 0.4, 1e-9);
  nothing.Add({told[0], told[0]}, {told[1], told[1]});
  EXPECT_FALSE(nothing.Frames()) << "what stands still says nothing";
}

TEST(MotionStatistics, NormalisedDeltasOfTheSameTrackHaveMeanZeroAndDeviationOne) {
  MotionSums sums;
  std::vector<Arms> track;
  for (int step = 0; step < kSteps; ++step) track.push_back(ArmAt(step));
  sums.Add(track);
  const ActionStatistics statistics = sums.Statistics("desk", 3);
  double sum = 0, squares = 0;
  for (int step = 1; step < kSteps; ++step) {
    const auto k = static_cast<std::size_t>(step);
    const double value = Normalised(DeltaBetween(GrippersOf(track[k - 1]), GrippersOf(track[k])), statistics, 3)[7];
    sum += value;
    squares += value * value;
  }
  EXPECT_NEAR(sum / (kSteps - 1), 0, 1e-5);
  EXPECT_NEAR(squares / (kSteps - 1), 1, 1e-4);
  EXPECT_EQ(statistics.deviation[0], 1) << "the left arm, which is not there";
}

TEST(MotionStatistics, ThePageComesBackToTheLastBit) {
  const TempFolder folder;
  MotionSums sums;
  sums.Add({ArmAt(0), ArmAt(1), ArmAt(3)});
  const ActionStatistics statistics = sums.Statistics("desk", 3);
  WriteFileAtomically(folder / "page.yaml", StatisticsPage(statistics));
  const ActionStatistics read = ReadActionStatistics(folder / "page.yaml");
  EXPECT_EQ(read.mean, statistics.mean);
  EXPECT_EQ(read.deviation, statistics.deviation);
}

TEST(MotionStatistics, ARobotsNameComesBackWhateverItIs) {
  for (const char* name : {"desk", "G1: mine", "", "7", "- \"a\" #1", "two\nlines"}) {
    ActionStatistics statistics = AgiBotWorldStatistics();
    statistics.robot = name;
    EXPECT_EQ(ParseActionStatistics(StatisticsPage(statistics), "page").robot, name);
  }
}

TEST(Shard, HoldsItsClipsOneAfterTheOther) {
  const TempFolder folder;
  std::vector<Clip> clips = {MakeClip(Source({40.5, 30.5}), {0, 0, kWidth_px, kHeight_px}, Options()),
                             MakeClip(Source({20.5, 10.5}), {2, 2, 90, 60}, Options())};
  clips[1].recording = 7;
  clips[1].outcome = 1;
  WriteShard(folder / "shard.safetensors", clips, {kWidth_px, kHeight_px}, {{"split", "train"}});
  const TensorFile file = TensorFile::Open(folder / "shard.safetensors");
  EXPECT_EQ(file.metadata().at("format"), "evac-shard");
  EXPECT_EQ(file.metadata().at("version"), "1");
  EXPECT_EQ(file.Get("frames").shape, (std::vector<std::int64_t>{2 * kSteps, 1, kHeight_px, kWidth_px, 3}));
  const auto numbers = [&](const char* name) {
    return reinterpret_cast<const std::int64_t*>(file.Get(name).bytes.data());
  };
  EXPECT_EQ(numbers("clip_start")[2], 2 * kSteps);
  EXPECT_EQ(numbers("clip_id")[1], 7);
  EXPECT_EQ(std::to_integer<int>(file.Get("outcome").bytes[0]), 255) << "-1: unknown";
  EXPECT_EQ(std::to_integer<int>(file.Get("outcome").bytes[1]), 1);
}

}  // namespace
}  // namespace evac
