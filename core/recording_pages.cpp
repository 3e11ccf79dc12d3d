#include <cctype>
#include <cstdlib>
#include <nlohmann/json.hpp>
#include <optional>

#include "core/error.h"
#include "core/recording_parts.h"

namespace evac {
namespace {

using Json = nlohmann::json;

constexpr int kMaxDepth = 32;

/// What walks through a page calls itself: a page of a million brackets must not reach it.
void CheckDepth(const Json& value, int depth, const std::string& file) {
  if (depth > kMaxDepth) throw InvalidInput("{}: lists and objects lie more than {} deep", file, kMaxDepth);
  if (!value.is_structured()) return;
  for (const Json& part : value) CheckDepth(part, depth + 1, file);
}

Json Parse(const std::string& text, const std::string& file) {
  Json page = Json::parse(text, nullptr, /*allow_exceptions=*/false);
  if (page.is_discarded()) throw InvalidInput("{}: no JSON", file);
  CheckDepth(page, 0, file);
  return page;
}

/// A field of an object. @throws InvalidInput if it is not there.
const Json& Field(const Json& object, const std::string& name, const std::string& where) {
  const auto found = object.is_object() ? object.find(name) : object.end();
  if (!object.is_object() || found == object.end()) throw InvalidInput("{}: field {} is missing", where, name);
  return *found;
}

double Number(const Json& value, const std::string& where) {
  if (!value.is_number()) throw InvalidInput("{}: found {}, wanted a number", where, value.type_name());
  return value.get<double>();
}

Eigen::Vector3d Vector3(const Json& list, const std::string& where) {
  if (!list.is_array() || list.size() != 3) throw InvalidInput("{}: wanted a list of 3", where);
  return {Number(list[0], where), Number(list[1], where), Number(list[2], where)};
}

/// k1 … k6, p1, p2, s1 … s4 and names such as "distortion_coefficients" or "D": those that calibration tools use.
bool NamesDistortion(std::string name) {
  for (char& letter : name) letter = static_cast<char>(std::tolower(static_cast<unsigned char>(letter)));
  const bool numbered = name.size() == 2 && name[1] >= '1' && name[1] <= '6';
  if (name == "d" || (numbered && (name[0] == 'k' || name[0] == 'p' || name[0] == 's'))) return true;
  return name.find("dist") != std::string::npos || name.find("coeff") != std::string::npos;
}

/// Anything in it that reads as a number other than 0, as text; or nothing.
std::optional<std::string> NonZero(const Json& value) {
  if (value.is_structured()) {
    for (const Json& part : value) {
      if (auto found = NonZero(part)) return found;
    }
    return std::nullopt;
  }
  if (value.is_number() && value.get<double>() != 0) return value.dump();
  if (!value.is_string()) return std::nullopt;
  const auto& text = value.get_ref<const std::string&>();
  char* end = nullptr;
  const double number = std::strtod(text.c_str(), &end);
  const bool is_number = !text.empty() && end == text.c_str() + text.size();
  return is_number && number != 0 ? std::optional(text) : std::nullopt;
}

/// Looks at every field, however deep: distortion stands beside `intrinsic` as often as in it.
void RefuseDistortion(const Json& object, const std::string& field, const std::string& file) {
  for (const auto& [name, value] : object.items()) {
    const std::string path = field.empty() || object.is_array() ? field + name : field + "." + name;
    const std::optional<std::string> found =
        object.is_object() && NamesDistortion(name) ? NonZero(value) : std::nullopt;
    if (found) {
      throw InvalidInput(
          "{}: {} holds {}, wanted 0: a distorted camera is no pinhole; undistort its images first, or leave the "
          "camera out",
          file, path, *found).Called("distorted");
    }
    if (value.is_structured()) RefuseDistortion(value, path, file);
  }
}

}  // namespace

Camera ParseIntrinsics(const std::string& json, const std::string& file) {
  const Json page = Parse(json, file);
  const Json& intrinsic = Field(page, "intrinsic", file);
  const auto number = [&](const char* name) {
    return Number(Field(intrinsic, name, file), file + ": intrinsic." + name);
  };
  Camera camera;
  camera.fx_px = number("fx");
  camera.fy_px = number("fy");
  camera.cx_px = number("ppx");
  camera.cy_px = number("ppy");
  RefuseDistortion(page, "", file);
  return camera;
}

std::vector<Eigen::Isometry3d> ParseExtrinsics(const std::string& json, const std::string& file) {
  const Json page = Parse(json, file);
  if (!page.is_array() || page.empty()) throw InvalidInput("{}: wanted a list of extrinsics, at least one", file);
  std::vector<Eigen::Isometry3d> base_from_camera;
  base_from_camera.reserve(page.size());
  for (const Json& entry : page) {
    const std::string where = fmt::format("{}: entry {}", file, base_from_camera.size());
    const Json& extrinsic = Field(entry, "extrinsic", where);
    const Json& rows = Field(extrinsic, "rotation_matrix", where);
    if (!rows.is_array() || rows.size() != 3) throw InvalidInput("{}: rotation_matrix: wanted 3 rows", where);
    Eigen::Matrix3d rotation;
    for (int row = 0; row < 3; ++row) rotation.row(row) = Vector3(rows[row], where + ": rotation_matrix").transpose();
    const Json& translation = Field(extrinsic, "translation_vector", where);
    base_from_camera.push_back(RigidOrThrow(rotation, Vector3(translation, where + ": translation_vector"), where));
  }
  return base_from_camera;
}

}  // namespace evac
