#include <cmath>
#include <cstdint>
#include <limits>
#include <nlohmann/json.hpp>

#include "core/error.h"
#include "core/parse_json.h"
#include "core/store_codec.h"

namespace evac::codec {
namespace {

using Json = nlohmann::ordered_json;

constexpr std::pair<Mount, const char*> kMounts[] = {
    {Mount::kBase, "base"}, {Mount::kLeftGripper, "left_gripper"}, {Mount::kRightGripper, "right_gripper"}};

const char* MountName(Mount mount) {
  for (const auto& [known, name] : kMounts) {
    if (known == mount) return name;
  }
  throw InternalError("a camera mount without a name");
}

Mount MountFromName(const std::string& name) {
  for (const auto& [mount, known] : kMounts) {
    if (known == name) return mount;
  }
  throw InternalError("the store is damaged: '{}' is no camera mount", name);
}

/// The library converts any number to an int, whatever it is.
int IntOf(const Json& json) {
  const auto number = json.is_number_integer() ? json.get<std::int64_t>() : std::numeric_limits<std::int64_t>::max();
  if (number < std::numeric_limits<int>::min() || number > std::numeric_limits<int>::max())
    throw InternalError("the store is damaged: {} is no count", json.dump());
  return static_cast<int>(number);
}

/// The upper three rows of the 4x4 matrix, row by row.
Json PoseToJson(const Eigen::Isometry3d& pose) {
  Json rows = Json::array();
  for (int row = 0; row < 3; ++row) {
    for (int column = 0; column < 4; ++column) rows.push_back(pose.matrix()(row, column));
  }
  return rows;
}

Eigen::Isometry3d PoseFromJson(const Json& rows) {
  Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
  for (int i = 0; i < 12; ++i) pose.matrix()(i / 4, i % 4) = rows.at(static_cast<std::size_t>(i)).get<double>();
  return pose;
}

Json CameraToJson(const Camera& camera) {
  return {{"name", camera.name},
          {"width_px", camera.width_px},
          {"height_px", camera.height_px},
          {"fx_px", camera.fx_px},
          {"fy_px", camera.fy_px},
          {"cx_px", camera.cx_px},
          {"cy_px", camera.cy_px},
          {"mount", MountName(camera.mount)},
          {"mount_from_camera", PoseToJson(camera.mount_from_camera)}};
}

Camera CameraFromJson(const Json& json) {
  Camera camera;
  camera.name = json.at("name").get<std::string>();
  camera.width_px = IntOf(json.at("width_px"));
  camera.height_px = IntOf(json.at("height_px"));
  camera.fx_px = json.at("fx_px").get<double>();
  camera.fy_px = json.at("fy_px").get<double>();
  camera.cx_px = json.at("cx_px").get<double>();
  camera.cy_px = json.at("cy_px").get<double>();
  camera.mount = MountFromName(json.at("mount").get<std::string>());
  camera.mount_from_camera = PoseFromJson(json.at("mount_from_camera"));
  return camera;
}

Json CamerasToJson(const std::vector<Camera>& cameras) {
  Json list = Json::array();
  for (const Camera& camera : cameras) list.push_back(CameraToJson(camera));
  return list;
}

std::vector<Camera> CamerasFromJson(const Json& list) {
  std::vector<Camera> cameras;
  for (const Json& camera : list) cameras.push_back(CameraFromJson(camera));
  return cameras;
}

Json StillToJson(const StillRule& still) {
  return {{"enabled", still.enabled}, {"translation_m", still.translation_m}, {"rotation_rad", still.rotation_rad},
          {"closure", still.closure}, {"dwell_chunks", still.dwell_chunks},   {"min_chunks", still.min_chunks}};
}

StillRule StillFromJson(const Json& json) {
  return {json.at("enabled").get<bool>(),        json.at("translation_m").get<double>(),
          json.at("rotation_rad").get<double>(), json.at("closure").get<double>(),
          IntOf(json.at("dwell_chunks")),        IntOf(json.at("min_chunks"))};
}

Json ConditionToJson(const Condition& condition) {
  Json json = {{"kind", condition.kind}, {"a", condition.a}, {"b", condition.b}};
  if (condition.above) json["above"] = *condition.above;
  if (condition.below) json["below"] = *condition.below;
  return json;
}

Condition ConditionFromJson(const Json& json) {
  Condition condition{
      json.at("kind").get<std::string>(), json.at("a").get<std::string>(), json.at("b").get<std::string>(), {}, {}};
  if (json.contains("above")) condition.above = json.at("above").get<double>();
  if (json.contains("below")) condition.below = json.at("below").get<double>();
  return condition;
}

Json StageToJson(const Stage& stage) {
  Json conditions = Json::array();
  for (const Condition& condition : stage.all_of) conditions.push_back(ConditionToJson(condition));
  return {{"name", stage.name},
          {"description", stage.description},
          {"all_of", conditions},
          {"hold_s", stage.hold_s},
          {"at_end", stage.at_end}};
}

Stage StageFromJson(const Json& json) {
  Stage stage;
  stage.name = json.at("name").get<std::string>();
  stage.description = json.at("description").get<std::string>();
  for (const Json& condition : json.at("all_of")) stage.all_of.push_back(ConditionFromJson(condition));
  stage.hold_s = json.at("hold_s").get<double>();
  stage.at_end = json.at("at_end").get<bool>();
  return stage;
}

Json RubricToJson(const Rubric& rubric) {
  Json stages = Json::array();
  for (const Stage& stage : rubric.stages) stages.push_back(StageToJson(stage));
  return {{"version", rubric.version}, {"success", rubric.success}, {"stages", stages}};
}

Rubric RubricFromJson(const Json& json) {
  Rubric rubric{json.at("version").get<std::string>(), json.at("success").get<std::string>(), {}};
  for (const Json& stage : json.at("stages")) rubric.stages.push_back(StageFromJson(stage));
  return rubric;
}

Json PointToJson(const Eigen::Vector3d& point_m) { return {point_m.x(), point_m.y(), point_m.z()}; }
Eigen::Vector3d PointFromJson(const Json& json) {
  return {json.at(0).get<double>(), json.at(1).get<double>(), json.at(2).get<double>()};
}

/// Reads stored JSON; what is wrong with it is the store's damage.
template <typename Read>
auto Decoded(const std::string& text, const Read& read) {
  try {
    return read(ParseJson<Json>(text));
  } catch (const nlohmann::json::exception& error) {
    throw InternalError("the store is damaged: {}", error.what());
  }
}

/// JSON has no infinity and no NaN; nlohmann's would silently become null.
std::string Dumped(const Json& json, const std::string& what) {
  const Json flat = json.flatten();
  for (const auto& [field, value] : flat.items()) {
    if (value.is_number_float() && !std::isfinite(value.get<double>()))
      throw InvalidInput("{} cannot be stored: {} is not finite", what, field);
  }
  try {
    return json.dump();
  } catch (const nlohmann::json::exception& error) {
    throw InvalidInput("{} cannot be stored: {}", what, error.what());
  }
}

}  // namespace

std::string EncodeCameras(const std::vector<Camera>& cameras) { return Dumped(CamerasToJson(cameras), "cameras"); }
std::vector<Camera> DecodeCameras(const std::string& json) { return Decoded(json, CamerasFromJson); }

std::string EncodeTask(const Task& task) {
  const Json json = {
      {"id", task.id},
      {"instruction", task.instruction},
      {"arms", task.arms},
      {"cameras", CamerasToJson(task.cameras)},
      {"period_s", task.period_s},
      {"max_chunks", task.max_chunks},
      {"still", StillToJson(task.still)},
      {"workspace_m", {{"min", PointToJson(task.workspace_m.min())}, {"max", PointToJson(task.workspace_m.max())}}},
      {"rubric", RubricToJson(task.rubric)}};
  return Dumped(json, "task '" + task.id + "'");
}

Task DecodeTask(const std::string& text) {
  return Decoded(text, [](const Json& json) {
    Task task;
    task.id = json.at("id").get<std::string>();
    task.instruction = json.at("instruction").get<std::string>();
    task.arms = json.at("arms").get<std::vector<std::string>>();
    task.cameras = CamerasFromJson(json.at("cameras"));
    task.period_s = json.at("period_s").get<double>();
    task.max_chunks = IntOf(json.at("max_chunks"));
    task.still = StillFromJson(json.at("still"));
    task.workspace_m = {PointFromJson(json.at("workspace_m").at("min")),
                        PointFromJson(json.at("workspace_m").at("max"))};
    task.rubric = RubricFromJson(json.at("rubric"));
    return task;
  });
}

std::string EncodeStages(const std::map<std::string, bool>& stages) {
  return Dumped(Json(stages), "a verdict's stages");
}

std::map<std::string, bool> DecodeStages(const std::string& text) {
  return Decoded(text, [](const Json& json) { return json.get<std::map<std::string, bool>>(); });
}

}  // namespace evac::codec
