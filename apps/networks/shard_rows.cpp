#include "apps/networks/shard_rows.h"

#include "core/geometry.h"

namespace evac {
namespace {

constexpr double kClosedGripper = 120;  // AgiBot's raw reading
constexpr std::size_t kHandNumbers = 8;

}  // namespace

ArmState ArmOf(const float* numbers) {
  ArmState arm;
  arm.base_from_gripper =
      FromXyzQuat({numbers[0], numbers[1], numbers[2]}, {numbers[3], numbers[4], numbers[5], numbers[6]});
  arm.closure = numbers[7] / kClosedGripper;
  return arm;
}

Arms ArmsOfRow(const float* row, std::size_t arms) {
  if (arms == 1) return {ArmOf(row + kHandNumbers)};
  return {ArmOf(row), ArmOf(row + kHandNumbers)};
}

Camera CameraAt(const train::Shard& shard, std::int64_t row, std::int64_t view) {
  const auto* k = shard.k[row][view].data_ptr<float>();
  return {.name = "",
          .width_px = static_cast<int>(shard.frames.size(3)),
          .height_px = static_cast<int>(shard.frames.size(2)),
          .fx_px = k[0],
          .fy_px = k[4],
          .cx_px = k[2],
          .cy_px = k[5]};
}

}  // namespace evac
