#include "core/error.h"
#include "core/npy.h"
#include "core/recording_parts.h"

namespace evac {
namespace {

namespace fs = std::filesystem;

constexpr double kExamplePeriod_s = 0.1;  // every third step of 30 Hz
constexpr std::size_t kArmColumns = 8;    // x y z, quaternion x y z w, gripper

/// A matrix of a known number of columns and, if `rows` is not 0, rows.
NpyArray ReadMatrix(const fs::path& path, std::size_t rows, std::size_t columns) {
  NpyArray matrix = ReadNpy(path);
  const bool fits = matrix.shape.size() == 2 && matrix.shape[1] == columns &&
                    (rows == 0 ? matrix.shape[0] > 0 : matrix.shape[0] == rows);
  if (!fits) {
    throw InvalidInput("{}: wanted the shape ({}, {})", path.string(), rows == 0 ? "T" : std::to_string(rows), columns);
  }
  return matrix;
}

Eigen::Isometry3d ReadExtrinsics(const fs::path& path) {
  const NpyArray matrix = ReadMatrix(path, 4, 4);
  const Eigen::Matrix4d pose = Eigen::Matrix<double, 4, 4, Eigen::RowMajor>(matrix.values.data());
  if (pose.row(3) != Eigen::RowVector4d(0, 0, 0, 1))
    throw InvalidInput("{}: the last row is not 0 0 0 1", path.string());
  return RigidOrThrow(pose.topLeftCorner<3, 3>(), pose.topRightCorner<3, 1>(), path.string());
}

void ReadIntrinsics(const fs::path& path, Camera& camera) {
  const NpyArray matrix = ReadMatrix(path, 3, 3);
  const bool pinhole = matrix.At(0, 1) == 0 && matrix.At(1, 0) == 0 && matrix.At(2, 0) == 0 && matrix.At(2, 1) == 0 &&
                       matrix.At(2, 2) == 1;
  if (!pinhole) throw InvalidInput("{}: wanted a pinhole matrix [fx 0 cx; 0 fy cy; 0 0 1]", path.string());
  camera.fx_px = matrix.At(0, 0);
  camera.fy_px = matrix.At(1, 1);
  camera.cx_px = matrix.At(0, 2);
  camera.cy_px = matrix.At(1, 2);
  CheckPinhole(camera, path.string());
}

std::vector<Arms> ReadActions(const fs::path& path) {
  const NpyArray rows = ReadMatrix(path, 0, 2 * kArmColumns);
  std::vector<Arms> steps;
  for (std::size_t step = 0; step < rows.shape[0]; ++step) {
    Arms arms;
    for (const std::size_t arm : {0, 1}) {
      const double* raw = &rows.values[(step * 2 + arm) * kArmColumns];
      const std::string where = fmt::format("{}: row {}, {} arm", path.string(), step, arm == 0 ? "left" : "right");
      arms.push_back(ArmFromRaw({Eigen::Vector3d(raw), Eigen::Vector4d(raw + 3), raw[7]}, where));
    }
    steps.push_back(std::move(arms));
  }
  return steps;
}

}  // namespace

Recording ReadExampleLayout(const fs::path& folder, const RecordingOptions& options) {
  if (!options.cameras.empty() && options.cameras != std::vector<std::string>{"head"}) {
    throw InvalidInput("{}: camera {} was asked for; this recording has head alone", folder.string(),
                       options.cameras.back());
  }
  Recording recording;
  recording.id = folder.filename().string();
  recording.arms = EveryNth(ReadActions(folder / "action.npy"), options.every_nth);
  recording.first_images = {ReadPng(folder / "frame.png")};
  Camera head;
  head.name = "head";
  head.width_px = recording.first_images[0].cols;
  head.height_px = recording.first_images[0].rows;
  ReadIntrinsics(folder / "intrinsics.npy", head);
  head.mount_from_camera = ReadExtrinsics(folder / "extrinsics.npy");
  recording.cameras = {head};
  recording.period_s =
      (options.recorded_period_s > 0 ? options.recorded_period_s : kExamplePeriod_s) * options.every_nth;
  recording.source = fmt::format("{}: example layout, first frame of the head camera", folder.string());
  return recording;
}

}  // namespace evac
