#include "core/task_page.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <string>

#include "core/error.h"
#include "core/geometry.h"

namespace evac {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;

const std::filesystem::path kPages = std::filesystem::path(EVAC_SOURCE_DIR) / "worldmodel/sim/scenes";

constexpr const char* kPage = R"(
id: push
instruction: Push it.
arms: [right]
period_s: 0.1
max_chunks: 4
workspace_m: {min: [0, -1, 0], max: [1, 1, 1]}
cameras:
  - {name: head, mount: base, width_px: 96, height_px: 64, fovy_deg: 40, position_m: [1, 0, 1], look_at_m: [0, 0, 0], up: [0, 0, 1]}
rubric:
  version: "1"
  success: It moved.
  stages:
    - {name: place, description: It moved., all_of: [{kind: displacement, a: cube, above: 0.1}], at_end: true}
)";

std::string Replaced(std::string text, const std::string& what, const std::string& with) {
  const auto at = text.find(what);
  EXPECT_NE(at, std::string::npos) << what;
  return text.replace(at, what.size(), with);
}

std::string ComplaintAbout(const std::string& text) {
  try {
    ParseTaskPage(text, "/pages/push.yaml");
  } catch (const Error& error) {
    EXPECT_EQ(error.exit_code(), ExitCode::kInvalidInput);
    return error.what();
  }
  return "no complaint";
}

TEST(TaskPage, TheShippedTasksAreThePapersWithTheirFiveStages) {
  for (const std::string id : {"take_bottle", "take_toast"}) {
    const Task task = ReadTaskPage(kPages / (id + ".yaml"));
    EXPECT_EQ(task.id, id);
    EXPECT_EQ(task.arms, std::vector<std::string>{"right"});
    EXPECT_DOUBLE_EQ(task.period_s, 0.1);
    ASSERT_EQ(task.cameras.size(), 2U);
    EXPECT_EQ(task.cameras[0].name, "head");
    EXPECT_EQ(task.cameras[1].name, "hand_right");
    EXPECT_EQ(task.cameras[1].mount, Mount::kRightGripper);
    std::vector<std::string> stages;
    for (const Stage& stage : task.rubric.stages) stages.push_back(stage.name);
    EXPECT_EQ(stages, (std::vector<std::string>{"reach", "grasp", "lift", "place", "release"}));
    EXPECT_TRUE(task.rubric.stages.back().at_end);
    EXPECT_TRUE(std::filesystem::path(task.page_path).is_absolute());
  }
}

TEST(TaskPage, ATaskReadFromItsStoredTextIsTheTaskReadFromItsFile) {
  const Task from_file = ReadTaskPage(kPages / "take_bottle.yaml");
  const Task from_text = ParseTaskPage(from_file.page, from_file.page_path);
  EXPECT_EQ(from_text.page, from_file.page);
  EXPECT_EQ(from_text.page_path, from_file.page_path);
  EXPECT_EQ(from_text.rubric.success, from_file.rubric.success);
  EXPECT_TRUE(from_text.cameras[1].mount_from_camera.isApprox(from_file.cameras[1].mount_from_camera, 0));
}

TEST(TaskPage, ACameraLooksAtItsPointWithUpBeingUpInThePicture) {
  const Camera camera = ParseTaskPage(kPage, "push.yaml").cameras[0];
  const auto pixel = [&](double x, double y, double z) {
    return Project(camera, camera.mount_from_camera.inverse() * Eigen::Vector3d(x, y, z)).value();
  };
  EXPECT_NEAR((pixel(0, 0, 0) - Eigen::Vector2d(48, 32)).norm(), 0, 1e-9);
  EXPECT_LT(pixel(0, 0, 0.1).y(), 32);  // higher up is higher in the picture
  EXPECT_GT(pixel(0, 0.1, 0).x(), 48);  // seen from the front, the robot's left is on the right
  EXPECT_NEAR(camera.mount_from_camera.linear().determinant(), 1, 1e-12);
}

TEST(TaskPage, AFieldOfViewIsAFocalLength) {
  const Camera by_angle = ParseTaskPage(kPage, "push.yaml").cameras[0];
  EXPECT_NEAR(by_angle.fy_px, 32 / std::tan(20 * M_PI / 180), 1e-9);
  const Camera by_pixels =
      ParseTaskPage(Replaced(kPage, "fovy_deg: 40", "fx_px: 90, fy_px: 91, cx_px: 47"), "push.yaml").cameras[0];
  EXPECT_DOUBLE_EQ(by_pixels.fx_px, 90);
  EXPECT_DOUBLE_EQ(by_pixels.fy_px, 91);
  EXPECT_DOUBLE_EQ(by_pixels.cx_px, 47);
  EXPECT_DOUBLE_EQ(by_pixels.cy_px, 32);
}

TEST(TaskPage, AQuaternionTurnsACameraAsTheSameLookDoes) {
  const std::string down =
      Replaced(kPage, "look_at_m: [0, 0, 0], up: [0, 0, 1]", "look_at_m: [1, 0, 0], up: [1, 0, 0]");
  const Camera looking = ParseTaskPage(down, "push.yaml").cameras[0];
  const Eigen::Quaterniond q(looking.mount_from_camera.linear());
  const std::string quat = fmt::format("quat_xyzw: [{}, {}, {}, {}]", q.x(), q.y(), q.z(), q.w());
  const Camera turned =
      ParseTaskPage(Replaced(down, "look_at_m: [1, 0, 0], up: [1, 0, 0]", quat), "push.yaml").cameras[0];
  EXPECT_TRUE(turned.mount_from_camera.isApprox(looking.mount_from_camera, 1e-12));
}

TEST(TaskPage, ACameraThatIsToldTwoThingsIsRefused) {
  EXPECT_THAT(ComplaintAbout(Replaced(kPage, "fovy_deg: 40", "fovy_deg: 40, fx_px: 90, fy_px: 90")),
              AllOf(HasSubstr("push.yaml"), HasSubstr("fx_px"), HasSubstr("'90'"), HasSubstr("fovy_deg is given")));
  EXPECT_THAT(ComplaintAbout(Replaced(kPage, "up: [0, 0, 1]", "up: [0, 0, 1], quat_xyzw: [0, 0, 0, 1]")),
              AllOf(HasSubstr("look_at_m"), HasSubstr("quat_xyzw is given")));
}

TEST(TaskPage, EveryComplaintNamesFileFieldAndWhatWasFound) {
  EXPECT_THAT(ComplaintAbout(Replaced(kPage, "max_chunks: 4", "max_chunk: 4")),
              AllOf(HasSubstr("push.yaml"), HasSubstr("max_chunk"), HasSubstr("max_chunks")));
  EXPECT_THAT(ComplaintAbout(Replaced(kPage, "arms: [right]", "arms: [right, left]")),
              AllOf(HasSubstr("arms"), HasSubstr("[left, right]")));
  EXPECT_THAT(ComplaintAbout(Replaced(kPage, "above: 0.1", "more: 0.1")), HasSubstr("more"));
  EXPECT_THAT(ComplaintAbout(Replaced(kPage, ", above: 0.1", "")), AllOf(HasSubstr("above"), HasSubstr("below")));
  EXPECT_THAT(ComplaintAbout(Replaced(kPage, "displacement", "distanse")),
              AllOf(HasSubstr("distanse"), HasSubstr("distance")));
  EXPECT_THAT(ComplaintAbout(Replaced(kPage, "displacement", "distance")), HasSubstr("all_of.0.b"));
  EXPECT_THAT(ComplaintAbout(Replaced(kPage, "max: [1, 1, 1]", "max: [1, -2, 1]")), HasSubstr("max"));
  EXPECT_THAT(ComplaintAbout(Replaced(kPage, "look_at_m: [0, 0, 0]", "look_at_m: [1, 0, 1]")), HasSubstr("look_at_m"));
  EXPECT_THAT(ComplaintAbout(Replaced(kPage, "up: [0, 0, 1]", "up: [1, 0, 1]")), HasSubstr("up"));
  EXPECT_THAT(ComplaintAbout(Replaced(kPage, "id: push", "id: ../push")), HasSubstr("id"));
}

TEST(TaskPage, ACameraOnALeftGripperWantsALeftArm) {
  const std::string on_the_left = Replaced(kPage, "mount: base", "mount: left_gripper");
  EXPECT_THAT(ComplaintAbout(on_the_left),
              AllOf(HasSubstr("arms"), HasSubstr("camera head"), HasSubstr("left gripper")));
  EXPECT_EQ(ComplaintAbout(Replaced(on_the_left, "arms: [right]", "arms: [left, right]")), "no complaint");
}

TEST(TaskPage, TwoCamerasOfOneNameAreRefused) {
  const std::string camera =
      "  - {name: head, mount: base, width_px: 96, height_px: 64, fovy_deg: 40, position_m: [1, 0, 1], look_at_m: [0, "
      "0, 0], up: [0, 0, 1]}\n";
  EXPECT_THAT(ComplaintAbout(Replaced(kPage, camera, camera + camera)),
              AllOf(HasSubstr("cameras.1"), HasSubstr("head")));
}

}  // namespace
}  // namespace evac
