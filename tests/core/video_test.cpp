#include "core/video.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <fstream>
#include <opencv2/imgproc.hpp>

#include "core/error.h"
#include "core/file.h"
#include "core/hash.h"
#include "core/seed.h"
#include "tests/support/temp_folder.h"

namespace evac {
namespace {

using testing::HasSubstr;

cv::Mat Flat(int width_px, int height_px, const cv::Scalar& rgb) { return cv::Mat(height_px, width_px, CV_8UC3, rgb); }

/// A disc that moves over a shaded ground: something for the encoder to do.
cv::Mat Scene(int frame, int width_px = 96, int height_px = 64) {
  cv::Mat image(height_px, width_px, CV_8UC3);
  for (int y = 0; y < height_px; ++y) {
    for (int x = 0; x < width_px; ++x) image.at<cv::Vec3b>(y, x) = cv::Vec3b(40 + x, 200 - 2 * y, 90);
  }
  cv::circle(image, {10 + 3 * frame, height_px / 2}, 8, cv::Scalar(220, 40, 30), cv::FILLED);
  return image;
}

FinishedVideo Write(const std::filesystem::path& path, const std::vector<cv::Mat>& frames,
                    const VideoOptions& options = {}) {
  VideoWriter writer(path, options);
  for (const cv::Mat& frame : frames) writer.Append(frame);
  return writer.Finish();
}

std::vector<cv::Mat> Scenes(int count) {
  std::vector<cv::Mat> frames;
  for (int i = 0; i < count; ++i) frames.push_back(Scene(i));
  return frames;
}

double LargestDifference(const cv::Mat& a, const cv::Mat& b) { return cv::norm(a, b, cv::NORM_INF); }

TEST(Video, FlatColoursComeBackWithinAFewLevels) {
  const TempFolder folder;
  const std::vector<cv::Scalar> colours = {{255, 0, 0}, {0, 255, 0},    {0, 0, 255},   {255, 255, 255},
                                           {0, 0, 0},   {200, 120, 40}, {30, 90, 160}, {128, 128, 128}};
  for (const cv::Scalar& colour : colours) {
    Write(folder / "flat.mp4", {Flat(96, 64, colour)}, {.crf = 10});
    const std::vector<cv::Mat> read = ReadAllFrames(folder / "flat.mp4");
    ASSERT_EQ(read.size(), 1u);
    EXPECT_LE(LargestDifference(read[0], Flat(96, 64, colour)), 4) << colour;
  }
}

TEST(Video, EveryFrameComesBackAtItsTimeAndInItsPlace) {
  const TempFolder folder;
  const std::vector<cv::Mat> frames = Scenes(60);
  for (const double period_s : {0.1, 1.0 / 30, 1.0 / 3, 0.033, 2.5, 1001.0 / 30000}) {
    const FinishedVideo video = Write(folder / "v.mp4", frames, {.period_s = period_s});
    EXPECT_EQ(video.frames, 60);
    VideoReader reader(folder / "v.mp4");
    int k = 0;
    for (cv::Mat frame = reader.Next(); !frame.empty(); frame = reader.Next(), ++k) {
      ASSERT_LT(k, 60);
      EXPECT_NEAR(reader.mean_period_s(), period_s, 0.01 * period_s) << "as the file says";
      EXPECT_NEAR(reader.time_s(), k * period_s, 1e-9 * (1 + k * period_s))
          << "frame " << k << " of period " << period_s;
      EXPECT_LT(cv::norm(frame, frames[k], cv::NORM_L1) / (frame.total() * 3), 5) << "frame " << k;
    }
    EXPECT_EQ(k, 60);
  }
}

TEST(Video, LosslessGreyRampKeepsItsLevels) {
  const TempFolder folder;
  cv::Mat ramp(64, 256, CV_8UC3);
  for (int x = 0; x < 256; ++x) ramp.col(x).setTo(cv::Scalar::all(x));
  Write(folder / "ramp.mp4", {ramp}, {.crf = 0});
  EXPECT_LE(LargestDifference(ReadAllFrames(folder / "ramp.mp4").at(0), ramp), 2);  // 8 bit, limited range: 220 levels
}

TEST(Video, TheSameFramesGiveTheSameBytes) {
  const TempFolder folder;
  const FinishedVideo a = Write(folder / "a.mp4", Scenes(30)), b = Write(folder / "b.mp4", Scenes(30));
  EXPECT_EQ(a.sha256, b.sha256);
  EXPECT_EQ(ReadFile(a.path), ReadFile(b.path));
}

TEST(Video, TheHashIsTheFilesAndNothingElseIsLeft) {
  const TempFolder folder;
  const FinishedVideo video = Write(folder / "v.mp4", Scenes(5));
  EXPECT_EQ(video.path, folder / "v.mp4");
  EXPECT_EQ(video.sha256, Sha256HexOfFile(video.path));
  EXPECT_FALSE(std::filesystem::exists(folder / "v.mp4.tmp"));
}

TEST(Video, ThePlayersIndexComesBeforeThePictures) {
  const TempFolder folder;
  const std::string bytes = ReadFile(Write(folder / "v.mp4", Scenes(5)).path);
  ASSERT_NE(bytes.find("moov"), std::string::npos);
  EXPECT_LT(bytes.find("moov"), bytes.find("mdat"));
}

/// Big-endian numbers of the file's track header, from its matrix on: nine of that, then width and height.
void SetTrackHeader(const std::filesystem::path& path, std::size_t number, const std::vector<std::uint32_t>& values) {
  constexpr std::size_t kFromName = 44;  // of a header of version 0
  std::string bytes = ReadFile(path);
  const std::size_t name = bytes.find("tkhd");
  ASSERT_NE(name, std::string::npos);
  ASSERT_EQ(bytes[name + 4], 0) << "the header's version";
  for (std::size_t i = 0; i < values.size(); ++i) {
    for (std::size_t byte = 0; byte < 4; ++byte)
      bytes[name + kFromName + 4 * (number + i) + byte] = static_cast<char>(values[i] >> (24 - 8 * byte));
  }
  WriteFileAtomically(path, bytes);
}

/// Pictures were read as they are stored, whatever was to be done to them: they did not fit their camera's page.
TEST(Video, OneThatIsToBeShownTurnedOrStretchedIsRefused) {
  constexpr std::uint32_t kOne = 1 << 16, kMinus = ~kOne + 1;
  const TempFolder folder;
  const std::filesystem::path path = folder / "v.mp4";
  const auto refusal = [&](std::size_t number, const std::vector<std::uint32_t>& values) -> std::string {
    Write(path, Scenes(3));
    SetTrackHeader(path, number, values);
    try {
      VideoReader reader(path);
    } catch (const Error& error) {
      EXPECT_EQ(error.exit_code(), ExitCode::kInvalidInput);
      return error.what();
    }
    return "it was read";
  };
  EXPECT_EQ(refusal(0, {kOne, 0, 0, 0, kOne}), "it was read") << "as it was written";
  EXPECT_EQ(refusal(6, {7 * kOne, 9 * kOne}), "it was read") << "elsewhere on the screen";
  for (const std::vector<std::uint32_t>& turned :
       {std::vector{0U, kOne, 0U, kMinus, 0U}, {kMinus, 0U, 0U, 0U, kMinus}, {kMinus, 0U, 0U, 0U, kOne}})
    EXPECT_THAT(refusal(0, turned), testing::AllOf(HasSubstr("v.mp4"), HasSubstr("turned"), HasSubstr("upright")));
  EXPECT_THAT(refusal(9, {192 * kOne, 64 * kOne}), testing::AllOf(HasSubstr("v.mp4"), HasSubstr("pixels are 2:1")));
}

TEST(Video, AnUnfinishedVideoLeavesNoFile) {
  const TempFolder folder;
  {
    VideoWriter writer(folder / "v.mp4", {});
    writer.Append(Scene(0));
    EXPECT_TRUE(std::filesystem::exists(folder / "v.mp4.tmp"));
  }
  EXPECT_TRUE(std::filesystem::is_empty(folder.path()));
}

TEST(Video, AVideoWithoutFramesIsRefused) {
  const TempFolder folder;
  VideoWriter writer(folder / "v.mp4", {});
  EXPECT_THROW(writer.Finish(), Error);
}

TEST(Video, OddSidesArePaddedByTheirLastRowAndColumn) {
  const TempFolder folder;
  Write(folder / "odd.mp4", {Flat(33, 17, {60, 160, 220})}, {.crf = 10});
  const cv::Mat read = ReadAllFrames(folder / "odd.mp4").at(0);
  EXPECT_EQ(read.size(), cv::Size(34, 18));
  EXPECT_LE(LargestDifference(read, Flat(34, 18, {60, 160, 220})), 4);
}

TEST(Video, TheSmallestImagesCanBeWritten) {
  const TempFolder folder;
  for (const cv::Size size : {cv::Size(1, 1), cv::Size(2, 2), cv::Size(3, 40)}) {
    Write(folder / "small.mp4",
          {Flat(size.width, size.height, {128, 128, 128}), Flat(size.width, size.height, {90, 90, 90})});
    EXPECT_EQ(ReadAllFrames(folder / "small.mp4").size(), 2u) << size;
  }
}

TEST(Video, AScaledPixelIsABlockOfItsColour) {
  const TempFolder folder;
  cv::Mat checker(8, 8, CV_8UC3);
  for (int i = 0; i < 64; ++i)
    checker.at<cv::Vec3b>(i / 8, i % 8) = (i / 8 + i % 8) % 2 ? cv::Vec3b(230, 30, 30) : cv::Vec3b(30, 30, 230);
  Write(folder / "big.mp4", {checker}, {.crf = 5, .scale = 8});
  const cv::Mat read = ReadAllFrames(folder / "big.mp4").at(0);
  ASSERT_EQ(read.size(), cv::Size(64, 64));
  for (int i = 0; i < 64; ++i) {
    const cv::Vec3b centre = read.at<cv::Vec3b>(8 * (i / 8) + 4, 8 * (i % 8) + 4);
    EXPECT_LE(cv::norm(centre, checker.at<cv::Vec3b>(i / 8, i % 8), cv::NORM_INF), 6) << i;
  }
}

TEST(Video, AFrameOfAnotherSizeOrTypeIsRefused) {
  const TempFolder folder;
  VideoWriter writer(folder / "v.mp4", {});
  writer.Append(Scene(0));
  const auto refuses = [](const std::string& message) { return testing::ThrowsMessage<Error>(HasSubstr(message)); };
  EXPECT_THAT([&] { writer.Append(Flat(64, 48, {0, 0, 0})); }, refuses("frame 1 is 64x48, the first was 96x64"));
  EXPECT_THAT([&] { writer.Append(cv::Mat(64, 96, CV_8UC1)); }, refuses("a frame is no 8-bit RGB image"));
  EXPECT_THAT([&] { writer.Append(cv::Mat()); }, refuses("a frame is no 8-bit RGB image"));
}

TEST(Video, ImpossibleOptionsAreRefusedWithTheirValue) {
  const TempFolder folder;
  const auto refuses = [](const std::string& message) { return testing::ThrowsMessage<Error>(HasSubstr(message)); };
  for (const auto& [options, message] : {std::pair(VideoOptions{.period_s = 0}, "period is 0 s, wanted .001 … 1000"),
                                         {VideoOptions{.crf = 52}, "crf is 52, wanted 0 … 51"},
                                         {VideoOptions{.scale = 0}, "scale is 0, wanted 1 … 64"}})
    EXPECT_THAT([&] { VideoWriter(folder / "v.mp4", options); }, refuses(message));
  EXPECT_THAT([&] { Write(folder / "v.mp4", Scenes(1), {.preset = "no such preset"}); },
              refuses("the H.264 encoder does not start"));
  EXPECT_TRUE(std::filesystem::is_empty(folder.path()));
}

TEST(Video, AFolderThatIsNotThereIsNamed) {
  const TempFolder folder;
  try {
    VideoWriter writer(folder / "missing" / "v.mp4", {});
    FAIL() << "wanted an error";
  } catch (const Error& error) {
    EXPECT_THAT(error.what(), HasSubstr((folder / "missing" / "v.mp4").string()));
  }
}

TEST(Video, AFullDiskIsAnErrorAndLeavesNoFile) {
  const std::filesystem::path full = "/dev/full";
  if (!std::filesystem::exists(full)) GTEST_SKIP() << "there is no /dev/full here";
  const TempFolder folder;
  std::filesystem::create_symlink(full, folder / "v.mp4.tmp");
  EXPECT_THROW(Write(folder / "v.mp4", Scenes(40)), Error);
  EXPECT_TRUE(std::filesystem::is_empty(folder.path()));
}

TEST(VideoReader, AFileThatIsNoVideoIsAnErrorThatNamesIt) {
  const TempFolder folder;
  for (const std::string& bytes : {std::string(), std::string("hello"), std::string(5000, '\0')}) {
    WriteFileAtomically(folder / "not a:video.mp4", bytes);
    try {
      ReadAllFrames(folder / "not a:video.mp4");
      ADD_FAILURE() << "wanted an error for " << bytes.size() << " bytes";
    } catch (const Error& error) {
      EXPECT_EQ(error.exit_code(), ExitCode::kInvalidInput);
      EXPECT_THAT(error.what(), HasSubstr("not a:video.mp4"));
    }
  }
  EXPECT_THROW(VideoReader(folder / "missing.mp4"), Error);
}

TEST(VideoReader, ACutFileIsAnErrorWhereverItIsCut) {
  const TempFolder folder;
  const std::string bytes = ReadFile(Write(folder / "v.mp4", Scenes(12)).path);
  for (std::size_t size = 0; size < bytes.size(); size += 97) {
    WriteFileAtomically(folder / "cut.mp4", bytes.substr(0, size));
    EXPECT_THROW(ReadAllFrames(folder / "cut.mp4"), Error) << size << " of " << bytes.size() << " bytes";
  }
}

TEST(VideoReader, ADamagedFileEndsInFramesOrAnErrorNeverInACrash) {
  const TempFolder folder;
  const std::string bytes = ReadFile(Write(folder / "v.mp4", Scenes(12)).path);
  SplitMix64 random(1);
  int errors = 0;
  for (int i = 0; i < 300; ++i) {
    std::string damaged = bytes;
    for (int flips = 0; flips < 8; ++flips) damaged[random.Below(damaged.size())] = static_cast<char>(random.Next());
    std::ofstream(folder / "damaged.mp4", std::ios::binary) << damaged;
    try {
      EXPECT_LE(ReadAllFrames(folder / "damaged.mp4").size(), 1000u);
    } catch (const Error&) {
      ++errors;
    }
  }
  EXPECT_GT(errors, 50);
}

TEST(VideoReader, ItsSizeIsKnownBeforeTheFirstFrame) {
  const TempFolder folder;
  const VideoReader reader(Write(folder / "v.mp4", Scenes(2)).path);
  EXPECT_EQ(reader.width_px(), 96);
  EXPECT_EQ(reader.height_px(), 64);
}

TEST(SideBySide, ViewsStandInTheirOrderAndLowerOnesArePaddedBelow) {
  const cv::Mat together = SideBySide({Flat(4, 6, {1, 2, 3}), Flat(3, 2, {9, 8, 7})});
  ASSERT_EQ(together.size(), cv::Size(7, 6));
  EXPECT_EQ(together.at<cv::Vec3b>(5, 3), cv::Vec3b(1, 2, 3));
  EXPECT_EQ(together.at<cv::Vec3b>(1, 4), cv::Vec3b(9, 8, 7));
  EXPECT_EQ(together.at<cv::Vec3b>(2, 4), cv::Vec3b(0, 0, 0));
  EXPECT_THROW(SideBySide({}), Error);
}

}  // namespace
}  // namespace evac
