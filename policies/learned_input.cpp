#include "policies/learned_input.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <sstream>
#include <vector>

#include "core/error.h"

namespace evac {
namespace {

constexpr std::size_t kCardNumbers = 16;  // focal lengths and middle, then three rows of mount_from_camera

const char* NameOf(Mount mount) {
  return mount == Mount::kBase ? "base" : mount == Mount::kLeftGripper ? "left_gripper" : "right_gripper";
}

}  // namespace

void PutArm(const ArmState& arm, float* numbers) {
  const Eigen::Matrix3d turn = arm.base_from_gripper.linear();
  for (int i = 0; i < 3; ++i) {
    numbers[i] = static_cast<float>(arm.base_from_gripper.translation()[i]);
    numbers[3 + i] = static_cast<float>(turn(i, 0));
    numbers[6 + i] = static_cast<float>(turn(i, 1));
  }
  numbers[9] = static_cast<float>(arm.closure);
}

ArmState ArmFrom(const float* numbers) {
  const auto column = [&](int from) { return Eigen::Vector3d(numbers[from], numbers[from + 1], numbers[from + 2]); };
  ArmState arm;
  Eigen::Matrix3d turn;
  turn.col(0) = column(3).normalized();
  turn.col(1) = (column(6) - turn.col(0) * turn.col(0).dot(column(6))).normalized();
  turn.col(2) = turn.col(0).cross(turn.col(1));
  arm.base_from_gripper.linear() = turn;
  arm.base_from_gripper.translation() = column(0);
  arm.closure = std::clamp<double>(numbers[9], 0, 1);
  return arm;
}

void PutRays(const Camera& camera, const Eigen::Isometry3d& base_from_camera, float* rays, float* eye) {
  Eigen::Matrix3d ray_from_part;
  ray_from_part << camera.width_px / camera.fx_px, 0, -camera.cx_px / camera.fx_px,  //
      0, camera.height_px / camera.fy_px, -camera.cy_px / camera.fy_px,              //
      0, 0, 1;
  const Eigen::Matrix3d in_base = base_from_camera.linear() * ray_from_part;
  for (int row = 0; row < 3; ++row) {
    for (int column = 0; column < 3; ++column) rays[3 * row + column] = static_cast<float>(in_base(row, column));
    eye[row] = static_cast<float>(base_from_camera.translation()[row]);
  }
}

std::string CardLine(const Camera& camera) {
  std::string line =
      fmt::format("{} {:.6g} {:.6g} {:.6g} {:.6g}", NameOf(camera.mount), camera.fx_px / camera.width_px,
                  camera.fy_px / camera.height_px, camera.cx_px / camera.width_px, camera.cy_px / camera.height_px);
  for (int row = 0; row < 3; ++row) {
    for (int column = 0; column < 4; ++column) line += fmt::format(" {:.6g}", camera.mount_from_camera(row, column));
  }
  return line;
}

Camera CameraOfCard(const WeightFile& file, const std::string& name) {
  const std::string field = "camera." + name;
  std::istringstream line(file.Text(field));
  std::string mount;
  std::vector<double> numbers(kCardNumbers);
  line >> mount;
  for (double& number : numbers) line >> number;
  const bool is_whole = !line.fail() && (line >> std::ws).eof();
  Camera camera{.name = name,
                .width_px = 1,
                .height_px = 1,
                .fx_px = numbers[0],
                .fy_px = numbers[1],
                .cx_px = numbers[2],
                .cy_px = numbers[3]};
  for (const Mount known : {Mount::kBase, Mount::kLeftGripper, Mount::kRightGripper}) {
    if (mount == NameOf(known)) camera.mount = known;
  }
  const bool is_finite = std::all_of(numbers.begin(), numbers.end(), [](double n) { return std::isfinite(n); });
  if (!is_whole || !is_finite || mount != NameOf(camera.mount) || camera.fx_px <= 0 || camera.fy_px <= 0)
    throw InvalidInput("{}: card field '{}': found '{}', wanted a mount and 16 numbers", file.name(), field,
                       file.Text(field));
  for (int row = 0; row < 3; ++row) {
    for (int column = 0; column < 4; ++column)
      camera.mount_from_camera(row, column) = numbers[static_cast<std::size_t>(4 + 4 * row + column)];
  }
  return camera;
}

}  // namespace evac
