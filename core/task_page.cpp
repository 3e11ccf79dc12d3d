#include "core/task_page.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <set>

#include "core/config.h"
#include "core/file.h"

namespace evac {
namespace {

using Eigen::Vector3d;

constexpr double kDegree = std::numbers::pi / 180;

Vector3d ReadVector(const Config& page, const std::string& key) {
  const auto numbers = page.Get<std::vector<double>>(key);
  page.Require(
      numbers.size() == 3 && std::all_of(numbers.begin(), numbers.end(), [](double x) { return std::isfinite(x); }),
      key, "three finite numbers [x, y, z]");
  return Vector3d(numbers[0], numbers[1], numbers[2]);
}

std::string ReadName(const Config& page, const std::string& key) {
  const auto name = page.Get<std::string>(key);
  const bool plain =
      std::all_of(name.begin(), name.end(), [](unsigned char c) { return std::isalnum(c) || c == '_' || c == '-'; });
  page.Require(!name.empty() && plain, key, "a name of letters, digits, '_' and '-'");
  return name;
}

std::string ReadText(const Config& page, const std::string& key) {
  auto text = page.Get<std::string>(key);
  page.Require(!text.empty(), key, "a text that is not empty");
  return text;
}

/// Of two ways to say the same only one may be there: which of them was meant?
void DemandNone(const Config& page, const std::string& given, std::initializer_list<const char*> others) {
  for (const char* other : others) page.Require(!page.Has(other), other, "none where " + given + " is given");
}

/// Axes as OpenCV's: z towards the point looked at, x right, y down. `up` is what is up in the picture.
Eigen::Matrix3d LookAt(const Config& page, const Vector3d& position_m) {
  const Vector3d forward = ReadVector(page, "look_at_m") - position_m;
  page.Require(forward.norm() > 1e-6, "look_at_m", "a point other than position_m");
  const Vector3d right = forward.cross(ReadVector(page, "up"));
  page.Require(right.norm() > 1e-6 * forward.norm(), "up", "a direction that is not the viewing direction");
  Eigen::Matrix3d mount_from_camera;
  mount_from_camera.col(0) = right.normalized();
  mount_from_camera.col(2) = forward.normalized();
  mount_from_camera.col(1) = mount_from_camera.col(2).cross(mount_from_camera.col(0));
  return mount_from_camera;
}

Eigen::Matrix3d ReadRotation(const Config& page, const Vector3d& position_m) {
  if (!page.Has("quat_xyzw")) return LookAt(page, position_m);
  DemandNone(page, "quat_xyzw", {"look_at_m", "up"});
  const auto q = page.Get<std::vector<double>>("quat_xyzw");
  const bool unit = q.size() == 4 && std::abs(Eigen::Vector4d(q.data()).norm() - 1) < 1e-3;
  page.Require(unit, "quat_xyzw", "four numbers x, y, z, w of length 1");
  return Eigen::Quaterniond(q[3], q[0], q[1], q[2]).normalized().toRotationMatrix();
}

void ReadIntrinsics(const Config& page, Camera& camera) {
  camera.cx_px = page.Get<double>("cx_px", camera.width_px / 2.0);
  camera.cy_px = page.Get<double>("cy_px", camera.height_px / 2.0);
  if (page.Has("fovy_deg")) {
    DemandNone(page, "fovy_deg", {"fx_px", "fy_px"});
    const auto fovy_deg = page.Get<double>("fovy_deg");
    page.Require(fovy_deg > 1 && fovy_deg < 170, "fovy_deg", "degrees between 1 and 170");
    camera.fx_px = camera.fy_px = camera.height_px / 2.0 / std::tan(fovy_deg / 2 * kDegree);
    return;
  }
  camera.fx_px = page.Get<double>("fx_px");
  camera.fy_px = page.Get<double>("fy_px");
  page.Require(std::isfinite(camera.fx_px) && camera.fx_px > 0, "fx_px", "a positive number");
  page.Require(std::isfinite(camera.fy_px) && camera.fy_px > 0, "fy_px", "a positive number");
}

Mount ReadMount(const Config& page) {
  const auto name = page.Get<std::string>("mount");
  if (name == "base") return Mount::kBase;
  if (name == "left_gripper") return Mount::kLeftGripper;
  page.Require(name == "right_gripper", "mount", "base, left_gripper or right_gripper");
  return Mount::kRightGripper;
}

Camera ReadCamera(const Config& page) {
  page.AllowOnly({"name", "mount", "width_px", "height_px", "fovy_deg", "fx_px", "fy_px", "cx_px", "cy_px",
                  "position_m", "look_at_m", "up", "quat_xyzw"});
  Camera camera;
  camera.name = ReadName(page, "name");
  camera.mount = ReadMount(page);
  camera.width_px = page.Get<int>("width_px");
  camera.height_px = page.Get<int>("height_px");
  page.Require(camera.width_px >= 8 && camera.width_px <= 4096, "width_px", "8 … 4096");
  page.Require(camera.height_px >= 8 && camera.height_px <= 4096, "height_px", "8 … 4096");
  ReadIntrinsics(page, camera);
  const Vector3d position_m = ReadVector(page, "position_m");
  camera.mount_from_camera.linear() = ReadRotation(page, position_m);
  camera.mount_from_camera.translation() = position_m;
  return camera;
}

std::vector<Camera> ReadCameras(const Config& page) {
  std::vector<Camera> cameras;
  std::set<std::string> names;
  for (const Config& item : page.List("cameras")) {
    cameras.push_back(ReadCamera(item));
    item.Require(names.insert(cameras.back().name).second, "name", "a name that no other camera has");
  }
  page.Require(!cameras.empty(), "cameras", "at least one camera");
  return cameras;
}

std::optional<double> ReadBound(const Config& page, const std::string& key) {
  if (!page.Has(key)) return std::nullopt;
  return page.Get<double>(key);
}

Condition ReadCondition(const Config& page) {
  static const std::map<std::string, bool> kNeedsB = {
      {"distance", true},     {"horizontal_distance", true}, {"contact", true}, {"height", false},
      {"height_gain", false}, {"displacement", false},       {"tilt", false},   {"speed", false}};
  page.AllowOnly({"kind", "a", "b", "above", "below"});
  Condition condition;
  condition.kind = page.Get<std::string>("kind");
  const auto kind = kNeedsB.find(condition.kind);
  page.Require(kind != kNeedsB.end(), "kind",
               "distance, horizontal_distance, height, height_gain, displacement, contact, tilt or speed");
  condition.a = ReadName(page, "a");
  if (kind->second) condition.b = ReadName(page, "b");
  page.Require(kind->second || !page.Has("b"), "b", "none: " + condition.kind + " is about one body");
  condition.above = ReadBound(page, "above");
  condition.below = ReadBound(page, "below");
  if (!condition.above && !condition.below)
    throw InvalidInput("{}: found neither 'above' nor 'below', wanted one or both", page.Where());
  return condition;
}

Stage ReadStage(const Config& page) {
  page.AllowOnly({"name", "description", "all_of", "hold_s", "at_end"});
  Stage stage;
  stage.name = ReadName(page, "name");
  stage.description = ReadText(page, "description");
  for (const Config& item : page.List("all_of")) stage.all_of.push_back(ReadCondition(item));
  page.Require(!stage.all_of.empty(), "all_of", "at least one condition");
  stage.hold_s = page.Get<double>("hold_s", 0.0);
  page.Require(stage.hold_s >= 0, "hold_s", "0 or more");
  stage.at_end = page.Get<bool>("at_end", false);
  return stage;
}

Rubric ReadRubric(const Config& page) {
  page.AllowOnly({"version", "success", "stages"});
  Rubric rubric;
  rubric.version = ReadText(page, "version");
  rubric.success = ReadText(page, "success");
  std::set<std::string> names;
  for (const Config& item : page.List("stages")) {
    rubric.stages.push_back(ReadStage(item));
    item.Require(names.insert(rubric.stages.back().name).second, "name", "a name that no other stage has");
  }
  page.Require(!rubric.stages.empty(), "stages", "at least one stage");
  return rubric;
}

std::vector<std::string> ReadArms(const Config& page) {
  const auto arms = page.Get<std::vector<std::string>>("arms");
  const bool known = arms == std::vector<std::string>{"right"} || arms == std::vector<std::string>{"left", "right"};
  page.Require(known, "arms", "[right] or [left, right]");
  return arms;
}

Task ReadTask(const Config& page) {
  page.AllowOnly(
      {"id", "instruction", "arms", "cameras", "period_s", "max_chunks", "still", "workspace_m", "rubric", "mujoco"});
  Task task;
  task.id = ReadName(page, "id");
  task.instruction = ReadText(page, "instruction");
  task.arms = ReadArms(page);
  task.cameras = ReadCameras(page);
  for (const Camera& camera : task.cameras)
    page.Require(task.arms.size() == 2 || camera.mount != Mount::kLeftGripper, "arms",
                 "[left, right]: camera " + camera.name + " is mounted on the left gripper");
  task.period_s = page.Get<double>("period_s");
  page.Require(task.period_s >= 0.001 && task.period_s <= 10, "period_s", "seconds, 0.001 … 10");
  task.max_chunks = page.Get<int>("max_chunks");
  page.Require(task.max_chunks >= 1, "max_chunks", "1 or more");
  if (page.Has("still")) task.still = ReadStillRule(page.Section("still"), {});
  task.workspace_m = ReadWorkspace(page.Section("workspace_m"));
  task.rubric = ReadRubric(page.Section("rubric"));
  return task;
}

}  // namespace

Eigen::AlignedBox3d ReadWorkspace(const Config& page) {
  page.AllowOnly({"min", "max"});
  const Eigen::AlignedBox3d workspace_m(ReadVector(page, "min"), ReadVector(page, "max"));
  page.Require(!workspace_m.isEmpty(), "max", "no coordinate below that of min");
  return workspace_m;
}

Rubric ReadRubricInWords(const Config& page) {
  page.AllowOnly({"version", "success", "stages"});
  Rubric rubric;
  rubric.version = page.Has("version") ? ReadText(page, "version") : "1";
  page.Require(rubric.version != kNoRubric, "version", std::string("another word than ") + kNoRubric);
  rubric.success = ReadText(page, "success");
  if (!page.Has("stages")) return rubric;
  std::set<std::string> names;
  for (const Config& item : page.List("stages")) {
    item.AllowOnly({"name", "description"});
    Stage& stage = rubric.stages.emplace_back();
    stage.name = ReadName(item, "name");
    stage.description = ReadText(item, "description");
    item.Require(names.insert(rubric.stages.back().name).second, "name", "a name that no other stage has");
  }
  return rubric;
}

StillRule ReadStillRule(const Config& page, const StillRule& otherwise) {
  page.AllowOnly({"enabled", "translation_m", "rotation_rad", "closure", "dwell_chunks", "min_chunks"});
  StillRule still;
  still.enabled = page.Get<bool>("enabled", otherwise.enabled);
  still.translation_m = page.Get<double>("translation_m", otherwise.translation_m);
  still.rotation_rad = page.Get<double>("rotation_rad", otherwise.rotation_rad);
  still.closure = page.Get<double>("closure", otherwise.closure);
  still.dwell_chunks = page.Get<int>("dwell_chunks", otherwise.dwell_chunks);
  still.min_chunks = page.Get<int>("min_chunks", otherwise.min_chunks);
  page.Require(still.translation_m >= 0, "translation_m", "0 or more");
  page.Require(still.rotation_rad >= 0, "rotation_rad", "0 or more");
  page.Require(still.closure >= 0, "closure", "0 or more");
  page.Require(still.dwell_chunks >= 1, "dwell_chunks", "1 or more");
  page.Require(still.min_chunks >= 0, "min_chunks", "0 or more");
  return still;
}

Task ReadTaskPage(const std::filesystem::path& path) { return ParseTaskPage(ReadFile(path), path); }

Task ParseTaskPage(const std::string& text, const std::filesystem::path& path) {
  Task task = ReadTask(Config::FromText(text, path));
  task.page = text;
  task.page_path = std::filesystem::absolute(path).lexically_normal().string();
  return task;
}

}  // namespace evac
