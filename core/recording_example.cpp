#include "core/error.h"
#include "core/file.h"
#include "core/npy.h"
#include "core/recording_parts.h"

namespace evac {
namespace {

namespace fs = std::filesystem;

constexpr double kExamplePeriod_s = 0.1;      // every third step of 30 Hz
constexpr double kAgibotPeriod_s = 1.0 / 30;  // of an h5 file
constexpr std::size_t kArmColumns = 8;        // x y z, quaternion x y z w, gripper

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
}

std::vector<Arms> ReadActions(const fs::path& path) {
  const NpyArray rows = ReadMatrix(path, 0, 2 * kArmColumns);
  if (rows.shape[0] > kMaxRecordedSteps)
    throw InvalidInput("{}: {} steps, wanted 1 … {}", path.string(), rows.shape[0], kMaxRecordedSteps);
  std::vector<Arms> steps;
  for (std::size_t step = 0; step < rows.shape[0]; ++step) {
    Arms arms;
    for (const std::size_t arm : {0, 1}) {
      const double* raw = &rows.values[(step * 2 + arm) * kArmColumns];
      const std::string where = fmt::format("{}: row {}, {} arm", path.string(), step, arm == 0 ? "left" : "right");
      arms.push_back({PoseFromRaw(Eigen::Vector3d(raw), Eigen::Vector4d(raw + 3), where),
                      ClosureFromRaw(raw[7], kClosedGripper, where)});
    }
    steps.push_back(std::move(arms));
  }
  return steps;
}

/// Whether it is `.npy`. @throws InvalidInput unless it ends in that or in `other`.
bool IsNpy(const fs::path& path, const char* other) {
  const std::string ending = path.extension().string();
  if (ending != ".npy" && ending != other) {
    throw InvalidInput("{}: found the ending '{}', wanted .npy or {}", path.string(), ending, other);
  }
  return ending == ".npy";
}

Camera ReadHead(const RecordingFiles& files, const std::vector<Arms>& arms, const cv::Size& size_px,
                const RecordingOptions& options) {
  Camera head;
  if (IsNpy(files.intrinsics, ".json")) {
    ReadIntrinsics(files.intrinsics, head);
  } else {
    head = ParseIntrinsics(ReadFile(files.intrinsics), files.intrinsics.string());
  }
  head.name = "head";
  head.width_px = size_px.width;
  head.height_px = size_px.height;
  CheckPinhole(head, files.intrinsics.string());
  if (IsNpy(files.extrinsics, ".json")) {
    head.mount_from_camera = ReadExtrinsics(files.extrinsics);
  } else {
    const std::string where = files.extrinsics.string();
    const std::vector<Eigen::Isometry3d> poses = ParseExtrinsics(ReadFile(files.extrinsics), where);
    head.mount_from_camera = FixedMount({Mount::kBase, poses, arms}, options, where);
  }
  return head;
}

}  // namespace

Recording ReadExampleLayout(const fs::path& folder, const RecordingOptions& options) {
  Recording recording = ReadRecordingFiles(
      {folder / "frame.png", folder / "action.npy", folder / "extrinsics.npy", folder / "intrinsics.npy"}, options);
  recording.id = folder.filename().string();
  recording.source = fmt::format("{}: example layout, first frame of the head camera", folder.string());
  return recording;
}

Recording ReadRecordingFiles(const RecordingFiles& files, const RecordingOptions& options) {
  if (!options.cameras.empty() && options.cameras != std::vector<std::string>{"head"}) {
    throw InvalidInput("{}: camera {} was asked for; this recording has head alone", files.frame.string(),
                       options.cameras.back());
  }
  const bool npy = IsNpy(files.actions, ".h5");
  const std::vector<Arms> arms = npy ? ReadActions(files.actions) : ReadProprio(files.actions);
  Recording recording;
  recording.id = files.frame.parent_path().filename().string();
  recording.first_images = {ReadPng(files.frame)};
  recording.cameras = {ReadHead(files, arms, recording.first_images[0].size(), options)};
  recording.arms = EveryNth(arms, options.every_nth);
  if (options.read_told && !npy) recording.told = EveryNth(ReadToldOf(files.actions, arms.size()), options.every_nth);
  const double found_period_s = npy ? kExamplePeriod_s : kAgibotPeriod_s;
  recording.says_period = options.recorded_period_s > 0;
  recording.period_s = (options.recorded_period_s > 0 ? options.recorded_period_s : found_period_s) * options.every_nth;
  recording.source = fmt::format("{}, {}", files.frame.string(), files.actions.string());
  recording.every_nth = options.every_nth;
  recording.files = {files.frame, files.actions, files.extrinsics, files.intrinsics};
  recording.arm_names = {"left", "right"};
  DropAbsentLeftArm(recording, files.actions.string());
  return recording;
}

}  // namespace evac
