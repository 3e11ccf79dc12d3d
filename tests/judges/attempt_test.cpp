#include "judges/attempt.h"

#include <gmock/gmock.h>

#include <algorithm>

#include "core/error.h"

namespace evac {
namespace {

using Eigen::Vector3d;

/// What one moment of an attempt is like.
struct Moment {
  Vector3d object_m{0.44, -0.12, 0.0};
  Vector3d gripper_m{0.30, 0.0, 0.30};
  double closure = 0;
  double fingers_n = 0;        ///< of each finger on the object
  double other_fingers_n = 0;  ///< of each finger on the plate
  double tilt_rad = 0;
};

/// A task that is done when the thing has been carried 20 cm to the left and let go.
Task CarryTask() {
  Task task;
  task.id = "carry";
  task.rubric.version = "1";
  const Condition there{"displacement", "thing", "", 0.15, std::nullopt},
      low{"height", "thing", "", std::nullopt, 0.01};
  const Condition free{"contact", "thing", "finger_left", std::nullopt, 0.05};
  task.rubric.stages = {{"release", "", {there, low, free}, 0.2, true}};
  return task;
}

class AttemptMaker {
 public:
  /// `frames` of the same moment.
  AttemptMaker& For(int frames, const Moment& moment) {
    for (int i = 0; i < frames; ++i) Add(moment);
    return *this;
  }
  WhatHappened Happened() const { return Look({task_, object_, track_, told_}); }
  Fate fate() const { return Happened().fate; }

 private:
  void Add(const Moment& moment) {
    PrivilegedFrame frame;
    const Eigen::Isometry3d thing =
        Eigen::Translation3d(moment.object_m) * Eigen::AngleAxisd(moment.tilt_rad, Vector3d::UnitX());
    const Eigen::Isometry3d gripper(Eigen::Translation3d(moment.gripper_m));
    frame.bodies = {{"finger_left", gripper},
                    {"finger_right", gripper},
                    {"gripper", gripper},
                    {"plate", Eigen::Isometry3d(Eigen::Translation3d(0.45, 0.14, 0))},
                    {"thing", thing}};
    if (moment.fingers_n > 0)
      frame.contacts = {{"finger_left", "thing", moment.fingers_n}, {"finger_right", "thing", moment.fingers_n}};
    if (moment.other_fingers_n > 0) {
      frame.contacts.push_back({"finger_left", "plate", moment.other_fingers_n});
      frame.contacts.push_back({"finger_right", "plate", moment.other_fingers_n});
    }
    track_.push_back(frame);
    told_.push_back({{gripper, moment.closure}});
  }

  Task task_ = CarryTask();
  std::string object_ = "thing";
  PrivilegedTrack track_;
  std::vector<Arms> told_;
};

const Vector3d kThing_m(0.44, -0.12, 0.0), kPlace_m(0.44, 0.10, 0.0);
const Vector3d kUp_m(0, 0, 0.15);
const Moment kHome{};
const Moment kOpenAtThing{.gripper_m = kThing_m};
const Moment kHolding{.gripper_m = kThing_m, .closure = 1, .fingers_n = 5};
const Moment kLifted{.object_m = kThing_m + kUp_m, .gripper_m = kThing_m + kUp_m, .closure = 1, .fingers_n = 5};

TEST(Attempt, CarriedPlacedAndLetGoIsASuccess) {
  EXPECT_EQ(AttemptMaker()
                .For(5, kHome)
                .For(2, kOpenAtThing)
                .For(5, kHolding)
                .For(5, kLifted)
                .For(5, {.object_m = kPlace_m, .gripper_m = kPlace_m, .closure = 1, .fingers_n = 5})
                .For(5, {.object_m = kPlace_m})
                .fate(),
            Fate::kSuccess);
}

TEST(Attempt, WhatFallsFarOrOutOfAClosedHandWasDropped) {
  const Moment fallen{.object_m = {0.44, -0.05, 0}, .closure = 0};
  EXPECT_EQ(AttemptMaker().For(5, kHolding).For(5, kLifted).For(5, fallen).fate(), Fate::kDrop);
  const Moment low{.object_m = kThing_m + Vector3d(0, 0, 0.05), .gripper_m = kThing_m, .closure = 1, .fingers_n = 5};
  EXPECT_EQ(AttemptMaker().For(5, kHolding).For(5, low).For(5, {.closure = 1}).fate(), Fate::kDrop);
}

TEST(Attempt, WhatIsPutDownElsewhereIsMisplaced) {
  const Moment opening{
      .object_m = kThing_m + Vector3d(0, 0, 0.04), .gripper_m = kThing_m, .closure = 0.3, .fingers_n = 5};
  EXPECT_EQ(AttemptMaker().For(5, kHolding).For(5, kLifted).For(3, opening).For(5, kHome).fate(), Fate::kMisplaced);
  Moment still_closed = opening;  // it lets go within the period in which it is told to
  still_closed.closure = 1;
  EXPECT_EQ(AttemptMaker().For(5, kHolding).For(5, kLifted).For(3, still_closed).For(5, kHome).fate(),
            Fate::kMisplaced);
}

TEST(Attempt, InTheHandAtTheEndIsStillHeld) {
  EXPECT_EQ(AttemptMaker().For(5, kHolding).For(5, kLifted).fate(), Fate::kStillHeld);
}

TEST(Attempt, HeldButNeverLiftedSlipped) {
  const Moment away{.gripper_m = kThing_m + kUp_m, .closure = 1};
  EXPECT_EQ(AttemptMaker().For(2, kOpenAtThing).For(5, kHolding).For(5, away).fate(), Fate::kSlip);
}

TEST(Attempt, AHandThatClosesLowIsJudgedByHowFarItIsFromTheThing) {
  const auto closing_at = [](double off_m) {
    const Vector3d at_m = kThing_m + Vector3d(off_m, 0, 0.05);
    return AttemptMaker().For(5, kHome).For(3, {.gripper_m = at_m}).For(5, {.gripper_m = at_m, .closure = 1}).fate();
  };
  EXPECT_EQ(closing_at(0.02), Fate::kNearMiss);
  EXPECT_EQ(closing_at(0.08), Fate::kEmptyGrasp);
  EXPECT_EQ(closing_at(0.20), Fate::kPretendedGrasp);
}

TEST(Attempt, ClosingHighUpIsNoGrasp) {
  EXPECT_EQ(AttemptMaker().For(3, kHome).For(5, {.closure = 1}).For(3, kHome).fate(), Fate::kUntouched);
}

TEST(Attempt, MovedOrTippedWithoutAGraspWasPushed) {
  const Moment pushing{.gripper_m = kThing_m + Vector3d(0.1, 0, 0.05), .fingers_n = 0.2};
  EXPECT_EQ(AttemptMaker().For(3, kHome).For(2, pushing).For(3, {.object_m = kThing_m + Vector3d(0.04, 0, 0)}).fate(),
            Fate::kPush);
  EXPECT_EQ(AttemptMaker().For(3, kHome).For(2, pushing).For(3, {.tilt_rad = 1.2}).fate(), Fate::kPush);
}

TEST(Attempt, AnOpenHandBesideTheThingIsNoMoreThanThat) {
  EXPECT_EQ(AttemptMaker().For(3, kHome).For(5, kOpenAtThing).For(3, kHome).fate(), Fate::kNoGrasp);
}

TEST(Attempt, AnotherThingInTheHandIsTheWrongObject) {
  const Moment wrong{.gripper_m = {0.45, 0.05, 0.03}, .closure = 1, .other_fingers_n = 3};
  EXPECT_EQ(AttemptMaker().For(3, kHome).For(5, wrong).For(3, kHome).fate(), Fate::kWrongObject);
}

TEST(Attempt, ContactIsMarkedAroundTouchesAndReleasesAlone) {
  const WhatHappened happened = AttemptMaker().For(20, kHome).For(10, kHolding).For(20, kHome).Happened();
  EXPECT_EQ(happened.contact[10], 0);
  EXPECT_EQ(happened.contact[16], 1) << "0.4 s before the first touch";
  EXPECT_EQ(happened.contact[25], 0) << "the middle of a hold is no event";
  EXPECT_EQ(happened.contact[30], 1) << "let go";
  EXPECT_EQ(happened.contact[35], 0);
}

TEST(Attempt, AnObjectThatIsNotThereIsRefusedByName) {
  const Task task = CarryTask();
  const std::string object = "cup";
  PrivilegedTrack track(1);
  for (const char* body : {"finger_left", "finger_right", "gripper", "thing"})
    track[0].bodies.push_back({body, Eigen::Isometry3d::Identity()});
  const std::vector<Arms> told(1, Arms(1));
  EXPECT_THAT([&] { Look({task, object, track, told}); },
              testing::ThrowsMessage<Error>("the privileged track has no body 'cup'"));
}

TEST(Attempt, EveryFateHasANameOfItsOwn) {
  std::vector<std::string> names;
  for (int fate = 0; fate < kFates; ++fate) names.push_back(Name(static_cast<Fate>(fate)));
  EXPECT_THAT(names, testing::Contains("near_miss").Times(1));
  std::sort(names.begin(), names.end());
  EXPECT_EQ(std::unique(names.begin(), names.end()), names.end());
}

}  // namespace
}  // namespace evac
