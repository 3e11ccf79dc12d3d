#include <gtest/gtest.h>

#include <algorithm>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include "core/video.h"
#include "tests/support/command.h"
#include "tests/support/temp_folder.h"

namespace evac {
namespace {

namespace fs = std::filesystem;

constexpr int kRows = 320, kColumns = 512;
constexpr int kTheirMemory = 4;  // rows of the actions that their run took as memory

/// Our maps of a recording, RGB: map j shows row j + 1.
std::vector<cv::Mat> OurMaps(const fs::path& recording, const fs::path& out) {
  const CommandResult result =
      RunCommand({Binary("evac"), "imagine", "--maps-only", "--recording", recording.string(), "--out", out.string()});
  EXPECT_EQ(result.exit_code, 0) << result.err;
  std::vector<fs::path> paths;
  for (const auto& entry : fs::directory_iterator(out / "maps")) paths.push_back(entry.path());
  std::sort(paths.begin(), paths.end());
  std::vector<cv::Mat> maps;
  for (const fs::path& path : paths) {
    cv::Mat& map = maps.emplace_back();
    cv::cvtColor(cv::imread(path.string(), cv::IMREAD_COLOR), map, cv::COLOR_BGR2RGB);
  }
  return maps;
}

struct Error255 {
  double mean = 0, worst = 0;  ///< of the frames' mean absolute errors
};

/// Their maps against ours of the rows that are `shift` later.
Error255 Compare(const std::vector<cv::Mat>& theirs, const std::vector<cv::Mat>& ours, int shift) {
  Error255 error;
  for (std::size_t k = 0; k < theirs.size(); ++k) {
    const int row = static_cast<int>(k) + kTheirMemory + shift;
    cv::Mat difference;
    cv::absdiff(theirs[k], ours.at(static_cast<std::size_t>(row - 1)), difference);
    const cv::Scalar sums = cv::sum(difference);
    const double mean = (sums[0] + sums[1] + sums[2]) / (3.0 * kRows * kColumns);
    error.mean += mean / static_cast<double>(theirs.size());
    error.worst = std::max(error.worst, mean);
  }
  return error;
}

TEST(AuthorsMaps, OursAreTheirsFrameByFrameAndNoOtherRowsFitBetter) {
  const fs::path examples = fs::path(EVAC_SHARED_DIR) / "data/agibot_examples";
  if (!fs::exists(examples)) GTEST_SKIP() << "no shared data at " << examples;
  for (const std::string name : {"example0", "example1"}) {
    const TempFolder folder;
    const std::vector<cv::Mat> ours = OurMaps(examples / name, folder.path());
    ASSERT_EQ(ours.size(), 333u) << "one per step after the first";
    std::vector<cv::Mat> theirs;
    for (const cv::Mat& frame : ReadAllFrames(examples / name / "authors_output.mp4")) {
      ASSERT_EQ(frame.size(), cv::Size(kColumns, 2 * kRows));
      theirs.push_back(frame.rowRange(kRows, 2 * kRows));
    }
    ASSERT_EQ(theirs.size(), 160u);
    const Error255 same = Compare(theirs, ours, 0), early = Compare(theirs, ours, -1), late = Compare(theirs, ours, 1);
    std::printf("%s: mean %.3f, worst frame %.3f of 255; a row earlier %.3f, a row later %.3f\n", name.c_str(),
                same.mean, same.worst, early.mean, late.mean);
    EXPECT_LT(same.mean, 0.65) << name;
    EXPECT_LT(same.worst, 0.8) << name;
    EXPECT_LT(same.mean, early.mean) << name;
    EXPECT_LT(same.mean, late.mean) << name;
  }
}

}  // namespace
}  // namespace evac
