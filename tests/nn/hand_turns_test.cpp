#include "worldmodel/nn/hand_turns.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <stdexcept>

namespace evac::nn {
namespace {

/// Rows of one number per frame: how closed the right hand is told to be. Both hands move on by 1 cm a frame.
std::vector<float> Rows(const std::vector<float>& right_gripper) {
  std::vector<float> rows;
  for (std::size_t frame = 0; frame < right_gripper.size(); ++frame) {
    const float x_m = 0.01F * static_cast<float>(frame);
    rows.insert(rows.end(), {x_m, 1, 0, 0, 0, 0, 1, 0});
    rows.insert(rows.end(), {x_m, 2, 0, 0, 0, 0, 1, right_gripper[frame]});
  }
  return rows;
}

struct Turn {
  explicit Turn(const std::vector<float>& turns, std::size_t t, std::size_t hand, std::size_t kind) {
    const float* at = &turns[t * kTurnRow + (hand * kTurnKinds + kind) * kTurnNumbers];
    was = at[0], since = at[1], x_m = at[2], y_m = at[3], gripper = at[9], x_before_m = at[10], gripper_before = at[17];
  }
  float was, since, x_m, y_m, gripper, x_before_m, gripper_before;
};
constexpr std::size_t kLeft = 0, kRight = 1, kClosing = 0, kOpening = 1;

TEST(HandTurns, SayWhereAHandLastClosedAndOpened) {
  const std::vector<float> rows = Rows({0, 50, 70, 120, 120, 40, 0, 90});
  const std::vector<std::size_t> frames = {1, 2, 4, 6, 7};
  const std::vector<float> turns = HandTurns(rows, frames);
  ASSERT_EQ(turns.size(), frames.size() * kTurnRow);

  EXPECT_EQ(Turn(turns, 0, kRight, kClosing).was, 0) << "not yet beyond half";
  const Turn at_once(turns, 1, kRight, kClosing), held(turns, 2, kRight, kClosing), let_go(turns, 3, kRight, kClosing);
  EXPECT_EQ(at_once.was, 1);
  EXPECT_EQ(at_once.since, 0);
  EXPECT_EQ(held.since, 2);
  EXPECT_EQ(let_go.since, 4) << "what it had closed about is known after it opened";
  EXPECT_FLOAT_EQ(held.x_m, 0.02F);
  EXPECT_FLOAT_EQ(held.x_before_m, 0.01F);
  EXPECT_EQ(held.y_m, 2);
  EXPECT_EQ(held.gripper, 70);
  EXPECT_EQ(held.gripper_before, 50);

  EXPECT_EQ(Turn(turns, 2, kRight, kOpening).was, 0);
  const Turn opened(turns, 3, kRight, kOpening);
  EXPECT_EQ(opened.since, 1);
  EXPECT_FLOAT_EQ(opened.x_m, 0.05F);
  EXPECT_FLOAT_EQ(Turn(turns, 4, kRight, kClosing).x_m, 0.07F) << "the last closing, not the first";
  EXPECT_EQ(Turn(turns, 4, kLeft, kClosing).was, 0) << "the other hand";
}

TEST(HandTurns, SayHowTheHandCameAndWentOnAsFarAsItIsKnown) {
  const std::vector<float> rows = Rows({0, 0, 120, 120, 110, 120, 120});
  const std::vector<std::size_t> frames = {2, 4, 6};
  const std::vector<float> turns = HandTurns(rows, frames);
  const auto number = [&](std::size_t t, int moment, std::size_t which) {
    const auto place = static_cast<std::size_t>(std::ranges::find(kTurnMoments, moment) - kTurnMoments.begin());
    return turns[t * kTurnRow + kRight * kTurnKinds * kTurnNumbers + 2 + place * kHandNumbers + which];
  };
  const auto x_m = [&](std::size_t t, int moment) { return number(t, moment, 0); };
  EXPECT_FLOAT_EQ(x_m(2, -2), 0);
  EXPECT_FLOAT_EQ(x_m(2, -4), 0) << "before the first frame it was where it was in that";
  EXPECT_FLOAT_EQ(x_m(0, 2), 0.02F) << "the frames behind the one that is asked about are not told";
  EXPECT_FLOAT_EQ(x_m(1, 2), 0.04F);
  EXPECT_FLOAT_EQ(x_m(1, 4), 0.04F);
  EXPECT_FLOAT_EQ(x_m(2, 4), 0.06F);
  EXPECT_FLOAT_EQ(number(2, 2, 7), 110);
}

TEST(HandTurns, AreNoneOfAHandThatBeginsClosed) {
  const std::vector<std::size_t> frames = {0, 1, 2};
  const std::vector<float> turns = HandTurns(Rows({120, 120, 0}), frames);
  for (const std::size_t t : frames) EXPECT_EQ(Turn(turns, t, kRight, kClosing).was, 0);
  EXPECT_EQ(Turn(turns, 2, kRight, kOpening).was, 1);
}

TEST(HandTurns, OfFramesThatAreNotThereAreRefused) {
  const std::vector<std::size_t> frames = {3};
  EXPECT_THROW(HandTurns(Rows({0, 0, 0}), frames), std::out_of_range);
}

}  // namespace
}  // namespace evac::nn
