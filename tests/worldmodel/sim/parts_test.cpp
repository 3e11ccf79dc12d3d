#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <atomic>
#include <cmath>

#include "core/error.h"
#include "core/file.h"
#include "core/seed.h"
#include "tests/support/temp_folder.h"
#include "tests/worldmodel/sim/scripted_pick.h"
#include "tests/worldmodel/sim/sim_test_support.h"
#include "worldmodel/sim/arm_control.h"
#include "worldmodel/sim/box_contacts.h"
#include "worldmodel/sim/mujoco_handles.h"
#include "worldmodel/sim/profile.h"
#include "worldmodel/sim/scene_page.h"
#include "worldmodel/sim/sensors.h"
#include "worldmodel/sim/variation.h"
#include "worldmodel/sim/workers.h"

namespace evac::test {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using namespace sim;  // the parts under test

ModelPtr BottleModel() {
  PrepareMujoco();
  return LoadModel(std::filesystem::path(EVAC_SOURCE_DIR) / "worldmodel/sim/scenes/take_bottle.xml");
}

TEST(ArmControl, ReachesTheWholeDocumentedWorkspacePointingDown) {
  const ModelPtr model = BottleModel();
  ArmControl control(*model, "right", {}, Joints::Zero());
  const DataPtr data = MakeData(*model);
  for (double x = 0.20; x <= 0.66; x += 0.06) {
    for (double y = -0.40; y <= 0.40; y += 0.08) {
      for (const double z : {0.02, 0.15, 0.34}) {
        if (std::hypot(x, y) > 0.66) continue;
        const Eigen::Vector3d across(0, -1, 0), along(1, 0, 0);
        EXPECT_NO_THROW(control.StartAt(*data, At({x, y, z}, Downward(across), 0))) << x << " " << y << " " << z;
        EXPECT_NO_THROW(control.StartAt(*data, At({x, y, z}, Downward(along), 0))) << x << " " << y << " " << z;
      }
    }
  }
}

TEST(ArmControl, MeasuresWhereItBelievesToBe) {
  const ModelPtr model = BottleModel();
  const Joints offset = Joints::Constant(0.01);
  ArmControl control(*model, "right", {}, offset);
  const DataPtr data = MakeData(*model);
  const ArmState home = At({0.4, 0.1, 0.3}, Downward({0, -1, 0}), 0.25);
  control.StartAt(*data, home);
  mj_kinematics(model.get(), data.get());
  const int site = IdOf(*model, mjOBJ_SITE, "gripper");
  const Eigen::Isometry3d truth = PoseOf(data->site_xpos + 3 * site, data->site_xmat + 9 * site);
  EXPECT_LT((control.Measured(*data).base_from_gripper.translation() - home.base_from_gripper.translation()).norm(),
            1e-4);
  EXPECT_NEAR(control.Measured(*data).closure, 0.25, 1e-9);
  EXPECT_GT((truth.translation() - home.base_from_gripper.translation()).norm(), 0.002);  // the hidden error
}

TEST(ArmControl, AHomeOutOfReachIsRefused) {
  const ModelPtr model = BottleModel();
  ArmControl control(*model, "right", {}, Joints::Zero());
  const DataPtr data = MakeData(*model);
  EXPECT_THROW(control.StartAt(*data, At({1.5, 0, 0.3}, Downward({0, -1, 0}), 0)), Error);
}

TEST(Profile, BothShippedPagesAreReadAndDiffer) {
  const Profile real = ReadProfile(ProfilePage("real")), simulated = ReadProfile(ProfilePage("sim"));
  EXPECT_EQ(real.name, "real");
  EXPECT_NE(real.hash, simulated.hash);
  EXPECT_GT(real.sensors.image_noise, simulated.sensors.image_noise);
}

TEST(Profile, ItsHashIsOfWhatItSaysNotOfHowItIsWritten) {
  const TempFolder folder;
  const std::filesystem::path path = folder / "profile.yaml";
  const std::string page = ReadFile(ProfilePage("real"));
  WriteFileAtomically(path, "# another comment\n" + page);
  EXPECT_EQ(ReadProfile(path).hash, ReadProfile(ProfilePage("real")).hash);
  WriteFileAtomically(path, std::string(page).replace(page.find("mass: 1.2"), 9, "mass: 1.3"));
  EXPECT_NE(ReadProfile(path).hash, ReadProfile(ProfilePage("real")).hash);
}

TEST(Profile, AnImpossibleValueIsRefusedWithItsField) {
  const TempFolder folder;
  const std::filesystem::path path = folder / "wrong.yaml";
  const std::string page = ReadFile(ProfilePage("real"));
  WriteFileAtomically(path, std::string(page).replace(page.find("mass: 1.2"), 9, "mass: -12"));
  try {
    ReadProfile(path);
    FAIL() << "accepted";
  } catch (const Error& error) {
    EXPECT_THAT(error.what(), AllOf(HasSubstr("wrong.yaml"), HasSubstr("mass"), HasSubstr("-12")));
  }
}

TEST(HiddenErrors, AreOneRigsAndShareNoStreamWithAnotherProfiles) {
  const Task task = ReadTask("take_bottle");
  Profile profile = ReadProfile(ProfilePage("real"));
  const HiddenErrors first = DrawHiddenErrors(profile, task), again = DrawHiddenErrors(profile, task);
  EXPECT_EQ(first.joint_offset, again.joint_offset);
  EXPECT_TRUE(first.camera_from_true_camera[0].isApprox(again.camera_from_true_camera[0], 0));
  profile.name = "other";
  const HiddenErrors other = DrawHiddenErrors(profile, task);
  EXPECT_NE(first.joint_offset, other.joint_offset);
  const HiddenErrors none = DrawHiddenErrors(ReadProfile(ProfilePage("sim")), task);
  EXPECT_TRUE(none.camera_from_true_camera[1].isApprox(Eigen::Isometry3d::Identity(), 0));
}

TEST(HiddenErrors, OfASecondArmAreItsOwnAndChangeNothingOfTheFirst) {
  Task two = ReadTask("take_bottle_two_arms");
  const Profile profile = ReadProfile(ProfilePage("real"));
  const HiddenErrors of_one = DrawHiddenErrors(profile, ReadTask("take_bottle")),
                     of_two = DrawHiddenErrors(profile, two);
  ASSERT_EQ(of_two.joint_offset.size(), 2U);
  EXPECT_EQ(of_two.joint_offset[1], of_one.joint_offset[0]);
  EXPECT_NE(of_two.joint_offset[0], of_two.joint_offset[1]);
}

/// Both draws of a place were arguments of one call, and which came first was the compiler's choice: with another one,
/// other states.
TEST(Clutter, LiesWhereTheOrderOfItsDrawsSays) {
  const ModelPtr model = BottleModel();
  const ScenePage page = ReadScenePage(ReadTask("take_bottle"));
  ApplyInitialState(*model, page, 41);
  SplitMix64 random(SeedFor(41, "clutter"));
  std::vector<Eigen::Vector2d> places_m = page.clutter.places_m;
  ASSERT_FALSE(page.clutter.bodies.empty());
  for (const std::string& name : page.clutter.bodies) {
    const auto chosen = static_cast<std::ptrdiff_t>(random.Below(places_m.size()));
    const double y = random.Uniform(-1, 1);
    const double x = random.Uniform(-1, 1);
    random.Uniform();  // how it is turned
    random.Uniform();  // whether it is there
    const Eigen::Vector2d place_m =
        places_m[static_cast<std::size_t>(chosen)] + page.clutter.spread_m * Eigen::Vector2d(x, y);
    places_m.erase(places_m.begin() + chosen);
    const mjtNum* found = model->body_pos + 3 * IdOf(*model, mjOBJ_BODY, name);
    EXPECT_NEAR(found[0], place_m.x(), 1e-12) << name;
    EXPECT_NEAR(found[1], place_m.y(), 1e-12) << name;
  }
}

TEST(Sensors, ImageNoiseHasItsDeviationAndNoMean) {
  cv::Mat image(64, 96, CV_8UC3, cv::Scalar::all(128));
  AddNoise(image, 4.0, 17);
  cv::Scalar mean, deviation;
  cv::meanStdDev(image, mean, deviation);
  for (int c = 0; c < 3; ++c) {
    EXPECT_NEAR(mean[c], 128, 0.3);
    EXPECT_NEAR(deviation[c], 4.0, 0.25);
  }
}

TEST(BoxContacts, AContactThatCannotBeIsNone) {
  const ModelPtr model = BottleModel();
  const DataPtr data = MakeData(*model);
  mj_kinematics(model.get(), data.get());
  const int table = IdOf(*model, mjOBJ_GEOM, "table"), box = model->body_geomadr[IdOf(*model, mjOBJ_BODY, "box")];
  mjContact contact{};
  contact.dist = -0.0005;
  contact.pos[0] = 0.44;
  contact.pos[1] = -0.12;
  EXPECT_TRUE(IsPlausible(*model, *data, contact, table, box));
  contact.pos[0] = 0.60;  // beside the box
  EXPECT_FALSE(IsPlausible(*model, *data, contact, table, box));
  contact.pos[0] = 0.44;
  contact.dist = -0.8;  // deeper than both together
  EXPECT_FALSE(IsPlausible(*model, *data, contact, table, box));
}

TEST(Workers, DoEveryItemOnceAndPassOnTheFirstError) {
  Workers workers(3);
  std::vector<std::atomic<int>> done(20);
  workers.Run(20, [&](int item, Renderer&) { ++done[static_cast<std::size_t>(item)]; });
  for (const auto& count : done) EXPECT_EQ(count, 1);
  std::atomic<int> finished = 0;
  const auto some_fail = [&](int item, Renderer&) {
    if (item == 3 || item == 7) throw InternalError("item {}", item);
    ++finished;
  };
  try {
    workers.Run(10, some_fail);
    FAIL() << "no error";
  } catch (const Error& error) {
    EXPECT_STREQ(error.what(), "item 3");
  }
  EXPECT_EQ(finished, 8);
}

}  // namespace
}  // namespace evac::test
