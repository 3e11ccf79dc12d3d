#include "tests/support/synthetic_recording.h"

#include <hdf5.h>

#include <algorithm>
#include <array>
#include <fstream>
#include <nlohmann/json.hpp>

#include "core/geometry.h"
#include "core/video.h"

namespace evac {
namespace {

namespace fs = std::filesystem;

template <typename T>
void WriteDataSet(hid_t file, const char* name, const std::vector<hsize_t>& shape, const std::vector<T>& values) {
  const hid_t type = std::is_same_v<T, float> ? H5T_NATIVE_FLOAT : H5T_NATIVE_DOUBLE;
  const hid_t space = H5Screate_simple(static_cast<int>(shape.size()), shape.data(), nullptr);
  const hid_t links = H5Pcreate(H5P_LINK_CREATE);
  H5Pset_create_intermediate_group(links, 1);
  const hid_t data = H5Dcreate2(file, name, type, space, links, H5P_DEFAULT, H5P_DEFAULT);
  H5Dwrite(data, type, H5S_ALL, H5S_ALL, H5P_DEFAULT, values.data());
  H5Dclose(data);
  H5Pclose(links);
  H5Sclose(space);
}

}  // namespace

SyntheticClip::SyntheticClip(int step_count) : steps(step_count), frames(step_count) {
  for (int step = 0; step < steps; ++step) {
    for (const int arm : {0, 1}) {
      const Eigen::Quaterniond turn(Eigen::AngleAxisd(0.05 * step, Eigen::Vector3d(0, arm, 1).normalized()));
      grippers.push_back(static_cast<float>(10 * step));
      positions_m.insert(positions_m.end(), {0.4 + 0.01 * step, arm == 0 ? 0.2 : -0.2, 0.3});
      quaternions_xyzw.insert(quaternions_xyzw.end(), {turn.x(), turn.y(), turn.z(), turn.w()});
    }
  }
}

void SyntheticClip::LoseLeftArm() {
  for (std::size_t step = 0; step < static_cast<std::size_t>(steps); ++step) {
    grippers[2 * step] = 0;
    std::fill_n(&positions_m[6 * step], 3, 0.0);
    std::copy_n(std::array{0.0, 0.0, 0.0, 1.0}.begin(), 4, &quaternions_xyzw[8 * step]);
  }
}

Eigen::Isometry3d SyntheticClip::MountFromCamera() {
  return Eigen::Translation3d(0.05, 0.01, -0.1) * Eigen::AngleAxisd(0.4, Eigen::Vector3d::UnitY());
}

Eigen::Isometry3d SyntheticClip::BaseFromGripper(int step, int arm) const {
  const int row = step * 2 + arm;
  return FromXyzQuat(Eigen::Vector3d(&positions_m[3 * row]), Eigen::Vector4d(&quaternions_xyzw[4 * row]));
}

std::string SyntheticClip::Extrinsics(const std::string& camera) const {
  nlohmann::json list = nlohmann::json::array();
  for (int step = 0; step < steps; ++step) {
    Eigen::Isometry3d base_from_camera = MountFromCamera();
    if (camera != "head") base_from_camera = BaseFromGripper(step, camera == "hand_left" ? 0 : 1) * base_from_camera;
    if (steps > 1) base_from_camera.translation().z() += slip_m * step / (steps - 1);
    nlohmann::json rows = nlohmann::json::array(), translation = nlohmann::json::array();
    for (int row = 0; row < 3; ++row) {
      const Eigen::RowVector3d values = base_from_camera.linear().row(row);
      rows.push_back({values[0], values[1], values[2]});
      translation.push_back(base_from_camera.translation()[row]);
    }
    list.push_back({{"extrinsic", {{"rotation_matrix", rows}, {"translation_vector", translation}}}});
  }
  return list.dump();
}

void SyntheticClip::Write(const ClipFolders& folders) const {
  for (const fs::path& folder : {folders.images, folders.pages, folders.proprio.parent_path()})
    fs::create_directories(folder);
  const hid_t file = H5Fcreate(folders.proprio.c_str(), H5F_ACC_TRUNC, H5P_DEFAULT, H5P_DEFAULT);
  const auto count = static_cast<hsize_t>(steps);
  WriteDataSet(file, "state/effector/position", {count, 2}, grippers);
  WriteDataSet(file, "state/end/position", {count, 2, 3}, positions_m);
  WriteDataSet(file, "state/end/orientation", {count, 2, 4}, quaternions_xyzw);
  H5Fclose(file);
  for (const std::string& camera : cameras) {
    WriteText(folders.pages / (camera + "_intrinsic_params.json"),
              R"({"intrinsic": {"fx": 40, "fy": 41, "ppx": 24, "ppy": 16}})");
    WriteText(folders.pages / (camera + "_extrinsic_params_aligned.json"), Extrinsics(camera));
    VideoWriter video(folders.images / (camera + "_color.mp4"), {.period_s = 1.0 / 30});
    for (int frame = 0; frame < frames; ++frame)
      video.Append(cv::Mat(kHeight_px, kWidth_px, CV_8UC3, cv::Scalar::all(FrameGrey(frame))));
    video.Finish();
  }
}

ClipFolders OneFolder(const fs::path& folder) {
  return {folder.filename().string(), folder, folder, folder / "proprio_stats.h5"};
}

ClipFolders TreeUnder(const fs::path& root) {
  return {"327-648642", root / "observations/327/648642/videos", root / "parameters/327/648642/parameters/camera",
          root / "proprio_stats/327/648642/proprio_stats.h5"};
}

void WriteText(const fs::path& path, const std::string& text) {
  fs::create_directories(path.parent_path());
  std::ofstream(path, std::ios::binary) << text;
}

}  // namespace evac
