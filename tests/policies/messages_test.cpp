#include "policies/messages.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <array>

#include "core/error.h"
#include "core/geometry.h"
#include "tests/policies/wire_support.h"

namespace evac {
namespace {

ArmState SomeArm() {
  return {FromXyzQuat(Eigen::Vector3d(0.4, -0.2, 0.3), Eigen::Vector4d(0.1, 0.7, -0.1, 0.7)), 0.75};
}

/// A smooth picture, as cameras make them.
cv::Mat Gradient(int height_px, int width_px) {
  cv::Mat image(height_px, width_px, CV_8UC3);
  for (int y = 0; y < height_px; ++y) {
    for (int x = 0; x < width_px; ++x)
      image.at<cv::Vec3b>(y, x) = {static_cast<uchar>(200 - y), static_cast<uchar>(x), static_cast<uchar>(30 + y / 2)};
  }
  return image;
}

template <typename Message>
void SurvivesTheWireAndNothingShorterDoes(const Message& message) {
  const std::vector<std::uint8_t> bytes = Encoded(message);
  const auto decoded = Decoded<Message>(bytes);
  ASSERT_TRUE(decoded.has_value());
  EXPECT_EQ(Encoded(*decoded), bytes);
  for (std::size_t size = 0; size < bytes.size(); ++size)
    EXPECT_FALSE(Decoded<Message>(std::span(bytes).first(size)).has_value()) << size;
}

TEST(Messages, WhatIsEncodedIsDecodedAndCutMessagesAreRefused) {
  PolicySpec spec = wire::ProbeSpec();
  spec.cameras = {{"head", 192, 128}};
  hello_t hello;
  hello.harness = ToWire(spec);
  SurvivesTheWireAndNothingShorterDoes(hello);
  episode_start_t start{};
  PutTask(wire::TwoCameraTask(), start);
  SurvivesTheWireAndNothingShorterDoes(start);
  chunk_t chunk{};
  chunk.num_targets = 3;
  chunk.num_arms = 2;
  chunk.targets.assign(3, {ToWire(SomeArm()), ToWire(SomeArm())});
  SurvivesTheWireAndNothingShorterDoes(chunk);
  image_t image{};
  PutImage(Gradient(8, 8), std::nullopt, image);
  SurvivesTheWireAndNothingShorterDoes(image);
}

TEST(Messages, AnAnnouncedSizeThatTheBytesCannotHoldIsRefusedBeforeItIsAllocated) {
  image_t image{};
  PutImage(Gradient(8, 8), std::nullopt, image);
  std::vector<std::uint8_t> bytes = Encoded(image);
  for (const std::uint8_t first : {0x7F, 0xFF}) {  // two thousand million, and a negative count
    bytes[8] = first;
    EXPECT_FALSE(Decoded<image_t>(bytes).has_value());
  }
}

TEST(Messages, ATextOfImpossibleLengthIsRefused) {
  std::vector<std::uint8_t> bytes = Encoded(bye_t{.client = "harness"});
  ASSERT_TRUE(Decoded<bye_t>(bytes).has_value());
  for (const std::array<std::uint8_t, 4> length :
       {std::array<std::uint8_t, 4>{0x80, 0, 0, 0}, {0xFF, 0xFF, 0xFF, 0xFF}, {0, 0, 0, 0}, {0, 0, 0, 9}}) {
    std::copy(length.begin(), length.end(), bytes.begin() + 8);
    EXPECT_FALSE(Decoded<bye_t>(bytes).has_value());
  }
}

TEST(Messages, AMessageOfAnotherTypeIsNotDecoded) { EXPECT_FALSE(Decoded<chunk_t>(Encoded(bye_t())).has_value()); }

TEST(Messages, AnArmComesBackAsItWas) {
  const ArmState back = FromWire(ToWire(SomeArm()), "arm");
  EXPECT_TRUE(back.base_from_gripper.isApprox(SomeArm().base_from_gripper, 1e-12));
  EXPECT_EQ(back.closure, 0.75);
}

TEST(Messages, ACameraAndADeclarationComeBackAsTheyWere) {
  const Camera camera = wire::TwoCameraTask().cameras[1], back = FromWire(ToWire(camera));
  EXPECT_EQ(back.name, "hand_right");
  EXPECT_EQ(back.mount, Mount::kRightGripper);
  EXPECT_EQ(back.cy_px, camera.cy_px);
  EXPECT_TRUE(back.mount_from_camera.isApprox(camera.mount_from_camera));
  PolicySpec spec = wire::ProbeSpec();
  spec.cameras = {{"head", 192, 128}};
  spec.arms = {"left", "right"};
  EXPECT_EQ(FromWire(ToWire(spec)), spec);
}

TEST(Messages, ACameraWithoutSizeOrFocalLengthIsRefused) {
  const camera_t whole = ToWire(wire::TwoCameraTask().cameras[0]);
  camera_t flat = whole, blind = whole, mirrored = whole;
  flat.height_px = 0;
  blind.fx_px = 0;
  mirrored.fy_px = -60;
  EXPECT_NO_THROW(FromWire(whole));
  for (const camera_t& camera : {flat, blind, mirrored}) EXPECT_THROW(FromWire(camera), Error);
}

TEST(Messages, ATaskComesBackWithWhatAPolicyMayKnow) {
  Task task = wire::TwoCameraTask();
  task.workspace_m = Eigen::AlignedBox3d(Eigen::Vector3d(0, -1, 0), Eigen::Vector3d(1, 1, 0.8));
  task.rubric.success = "a secret of the judges";
  episode_start_t start{};
  PutTask(task, start);
  const Task back = TaskOf(start);
  EXPECT_EQ(back.id, task.id);
  EXPECT_EQ(back.arms, task.arms);
  EXPECT_EQ(back.cameras.size(), 2u);
  EXPECT_TRUE(back.workspace_m.isApprox(task.workspace_m));
  EXPECT_EQ(back.rubric.success, "");
}

TEST(Messages, AQuaternionNearUnitIsTakenOneThatIsNotIsRefused) {
  arm_state_t wire = ToWire(SomeArm());
  for (double& q : wire.orientation_xyzw) q *= 1.0009;
  EXPECT_TRUE(FromWire(wire, "arm").base_from_gripper.isApprox(SomeArm().base_from_gripper, 1e-9));
  for (double& q : wire.orientation_xyzw) q *= 1.0009;
  EXPECT_THROW(FromWire(wire, "arm"), Error);
}

TEST(Messages, RawImagesAreExactAlsoWhenTheyAreCutOutOfLargerOnes) {
  const cv::Mat part = Gradient(40, 60)(cv::Rect(3, 5, 21, 17));
  image_t message{};
  PutImage(part, std::nullopt, message);
  EXPECT_EQ(cv::norm(ImageOf(message), part, cv::NORM_INF), 0);
}

TEST(Messages, JpegKeepsColoursInTheirChannels) {
  const cv::Mat image = Gradient(128, 192);
  image_t message{};
  PutImage(image, 95, message);
  EXPECT_LT(message.data.size(), image.total());
  const cv::Mat back = ImageOf(message);
  ASSERT_EQ(back.size(), image.size());
  EXPECT_LE(cv::norm(back, image, cv::NORM_INF), 8);
}

TEST(Messages, AnImageThatIsNotWhatItSaysIsRefused) {
  image_t jpeg{};
  PutImage(Gradient(16, 24), 95, jpeg);
  image_t wrong_size = jpeg, cut = jpeg, huge = jpeg, unknown = jpeg;
  wrong_size.width_px = 25;
  cut.data.resize(10);
  huge.width_px = 1 << 20;
  unknown.encoding = 7;
  for (const image_t& image : {wrong_size, cut, huge, unknown}) EXPECT_THROW(ImageOf(image), Error);
}

/// A JPEG of 16x24 whose first segment is shifted by `between`, with another size where that segment would end if what
/// stands before its length were its length.
image_t WithTwoSizes(const std::vector<std::uint8_t>& between) {
  image_t jpeg{};
  PutImage(Gradient(16, 24), 95, jpeg);
  const std::vector<std::uint8_t> other = {0xFF, 0xC0, 0, 17, 8, 0, 32, 0, 48};  // a frame of 48x32
  jpeg.data.insert(jpeg.data.begin() + 2, between.begin(), between.end());
  const std::size_t end = 4 + static_cast<std::size_t>(jpeg.data[4] << 8 | jpeg.data[5]);
  if (jpeg.data.size() < end) jpeg.data.resize(end);
  jpeg.data.insert(jpeg.data.begin() + static_cast<std::ptrdiff_t>(end), other.begin(), other.end());
  jpeg.num_bytes = static_cast<int>(jpeg.data.size());
  jpeg.height_px = 32;
  jpeg.width_px = 48;
  return jpeg;
}

TEST(Messages, AJpegThatHidesItsSizeFromWhoLooksBeforeDecodingIsRefused) {
  for (const std::vector<std::uint8_t>& between : {std::vector<std::uint8_t>{0xFF}, {0xFF, 0x01}, {0xFF, 0x00}})
    EXPECT_THROW(ImageOf(WithTwoSizes(between)), Error) << static_cast<int>(between.back());
  image_t filled{};
  PutImage(Gradient(16, 24), 95, filled);
  filled.data.insert(filled.data.begin() + 2, 0xFF);
  EXPECT_EQ(ImageOf(filled).size(), cv::Size(24, 16)) << "the standard allows it";
}

}  // namespace
}  // namespace evac
