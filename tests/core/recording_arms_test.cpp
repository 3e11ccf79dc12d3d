#include <gmock/gmock.h>

#include <algorithm>
#include <array>

#include "core/error.h"
#include "core/npy.h"
#include "core/recording.h"
#include "core/recording_parts.h"
#include "tests/support/synthetic_recording.h"
#include "tests/support/temp_folder.h"

/// What is noticed of arms in another unit, another order, or that are not there.
namespace evac {
namespace {

namespace fs = std::filesystem;
using testing::AllOf;
using testing::HasSubstr;

enum Side { kLeft, kRight };

/// "KIND: sentence".
std::string ErrorOf(const fs::path& folder, const RecordingOptions& options = {}) {
  try {
    ReadRecording(folder, options);
  } catch (const Error& error) {
    EXPECT_EQ(error.exit_code(), ExitCode::kInvalidInput);
    return std::string(error.kind()) + ": " + error.what();
  }
  return "it was read";
}

std::string ErrorOf(const SyntheticClip& clip) {
  const TempFolder folder;
  clip.Write(OneFolder(folder / "a"));
  return ErrorOf(folder / "a");
}

/// The arm at the base's origin, open, its orientation those four numbers as they stand in the file.
void LayDown(SyntheticClip& clip, Side side, const std::array<double, 4>& orientation) {
  for (std::size_t row = side; row < clip.grippers.size(); row += 2) {
    clip.grippers[row] = 0;
    std::fill_n(&clip.positions_m[3 * row], 3, 0.0);
    std::ranges::copy(orientation, &clip.quaternions_xyzw[4 * row]);
  }
}

/// It was kept as a second arm, half turned about x at the base, in shards, statistics and the handshake.
TEST(RecordedArms, AnAbsentLeftArmWhoseQuaternionHasWFirstIsRefusedAndTheOrderNamed) {
  SyntheticClip clip(4);
  LayDown(clip, kLeft, {1, 0, 0, 0});
  EXPECT_THAT(ErrorOf(clip), AllOf(HasSubstr("absent_arm: "), HasSubstr("proprio_stats.h5: the left arm lies at"),
                                   HasSubstr("0 0 0 1 (x y z w, not w first)")));
  LayDown(clip, kLeft, {0, 0, 0, 1});
  EXPECT_EQ(ErrorOf(clip), "it was read");
}

TEST(RecordedArms, AnAbsentLeftArmThatReadsClosedIsNoSecondArm) {
  SyntheticClip clip(4);
  LayDown(clip, kLeft, {0, 0, 0, 1});
  clip.grippers[2 * 2 + kLeft] = 120;
  EXPECT_THAT(ErrorOf(clip), AllOf(HasSubstr("absent_arm: "), HasSubstr("a gripper of 0")));
}

/// It was taken for two arms, the right one drawn at the base's origin.
TEST(RecordedArms, ARobotWithALeftArmAloneIsToldToRecordItAsTheRightOne) {
  SyntheticClip clip(4);
  LayDown(clip, kRight, {0, 0, 0, 1});
  EXPECT_THAT(ErrorOf(clip), AllOf(HasSubstr("absent_arm: "), HasSubstr("proprio_stats.h5: the right arm lies at"),
                                   HasSubstr("as the right one, its camera as hand_right")));
  clip.positions_m[6 * 3 + 3] = 0.01;
  EXPECT_EQ(ErrorOf(clip), "it was read") << "it moved: it is there";
}

TEST(RecordedArms, MillimetresAreRefusedInEitherLayout) {
  SyntheticClip clip(4);
  for (double& x : clip.positions_m) x *= 1000;
  EXPECT_THAT(ErrorOf(clip),
              AllOf(HasSubstr("position_unit: "), HasSubstr("proprio_stats.h5: state/end: step 0, left arm"),
                    HasSubstr("the gripper is 538.5 m from the base's origin, wanted at most 5")));
  const TempFolder folder;
  WriteText(folder / "a/made", "");
  WriteNpy(folder / "a/action.npy", {"<f8", {1, 16}, {.4, .2, .3, 0, 0, 0, 1, 0, 400, -200, 300, 0, 0, 0, 1, 60}});
  EXPECT_THAT(ErrorOf(folder / "a"), AllOf(HasSubstr("position_unit: "), HasSubstr("action.npy: row 0, right arm")));
}

/// It was 120 times what the file holds, of a range that is the other half's, in no data set that was named.
TEST(RecordedArms, AToldGripperInTheMeasuredOnesUnitIsRefusedWithItsOwnNumberRangeAndDataSet) {
  const TempFolder folder;
  SyntheticClip(4).Write(OneFolder(folder / "a"));
  const std::vector<Arms> measured = ReadRecording(folder / "a").arms;
  const auto with_told = [&](double closure) {
    std::vector<Arms> told = measured;
    told[2][kRight].closure = closure;
    WriteText(folder / "a/proprio_stats.h5", ProprioBytes(measured, told));
    return ErrorOf(folder / "a", {.read_told = true});
  };
  EXPECT_THAT(with_told(65), HasSubstr("gripper_unit: "));
  EXPECT_THAT(with_told(65), HasSubstr("proprio_stats.h5: action/effector/position: step 2, right arm: the gripper "
                                       "reads 65, wanted 0 (open) … 1 (closed)"));
  EXPECT_EQ(ErrorOf(folder / "a"), "it was read") << "nobody asked where they were told to be";
  EXPECT_EQ(with_told(1.01), "it was read");
  EXPECT_EQ(ReadRecording(folder / "a", {.read_told = true}).told[2][kRight].closure, 1);
  SyntheticClip clip(4);
  clip.grippers[1] = 900;
  EXPECT_THAT(ErrorOf(clip), HasSubstr("state/effector/position: step 0, right arm: the gripper reads 900, wanted 0 "
                                       "(open) … 120 (closed)"));
}

}  // namespace
}  // namespace evac
