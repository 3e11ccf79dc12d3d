#include <hdf5.h>

#include <algorithm>

#include "core/error.h"
#include "core/recording_parts.h"

namespace evac {
namespace {

constexpr std::size_t kGrowth_bytes = 1 << 20;

hid_t Demand(hid_t id, const char* step) {
  if (id < 0) throw InternalError("HDF5 does not {}", step);
  return id;
}

/// An HDF5 file in memory. Its objects carry no times, so that the same numbers are the same bytes.
class MemoryH5 {
 public:
  MemoryH5()
      : access_(H5Pcreate(H5P_FILE_ACCESS)), links_(H5Pcreate(H5P_LINK_CREATE)), data_(H5Pcreate(H5P_DATASET_CREATE)) {
    H5Pset_fapl_core(access_, kGrowth_bytes, /*backing_store=*/0);
    H5Pset_create_intermediate_group(links_, 1);
    H5Pset_obj_track_times(data_, 0);
    file_ = Demand(H5Fcreate("proprio_stats.h5", H5F_ACC_TRUNC, H5P_DEFAULT, access_), "open a file in memory");
  }
  ~MemoryH5() {
    H5Fclose(file_);
    for (const hid_t list : {access_, links_, data_}) H5Pclose(list);
  }
  MemoryH5(const MemoryH5&) = delete;
  MemoryH5& operator=(const MemoryH5&) = delete;

  void Add(const std::string& name, const std::vector<hsize_t>& shape, const std::vector<double>& values) {
    const hid_t space = H5Screate_simple(static_cast<int>(shape.size()), shape.data(), nullptr);
    const hid_t set =
        Demand(H5Dcreate2(file_, name.c_str(), H5T_IEEE_F64LE, space, links_, data_, H5P_DEFAULT), "add a track");
    const herr_t written = H5Dwrite(set, H5T_NATIVE_DOUBLE, H5S_ALL, H5S_ALL, H5P_DEFAULT, values.data());
    H5Dclose(set);
    H5Sclose(space);
    Demand(written, "write a track");
  }

  std::string Bytes() const {
    Demand(H5Fflush(file_, H5F_SCOPE_GLOBAL), "finish a file in memory");
    const ssize_t size = H5Fget_file_image(file_, nullptr, 0);
    std::string bytes(static_cast<std::size_t>(Demand(size, "tell a file's size")), '\0');
    Demand(H5Fget_file_image(file_, bytes.data(), bytes.size()), "give a file's bytes");
    return bytes;
  }

 private:
  std::unique_lock<std::mutex> lock_ = LockHdf5();
  hid_t access_, links_, data_, file_ = -1;
};

void AddHalf(MemoryH5& file, const std::string& half, const std::vector<Arms>& track, double closed_gripper) {
  std::vector<double> grippers, positions_m, quaternions_xyzw;
  for (const Arms& arms : track) {
    if (arms.size() == 1) {  // no left arm: at the base's origin
      grippers.push_back(0);
      positions_m.insert(positions_m.end(), {0, 0, 0});
      quaternions_xyzw.insert(quaternions_xyzw.end(), {0, 0, 0, 1});
    }
    for (const ArmState& arm : arms) {
      const Eigen::Vector3d& xyz_m = arm.base_from_gripper.translation();
      const Eigen::Quaterniond turn(arm.base_from_gripper.linear());
      grippers.push_back(closed_gripper * arm.closure);
      positions_m.insert(positions_m.end(), {xyz_m.x(), xyz_m.y(), xyz_m.z()});
      quaternions_xyzw.insert(quaternions_xyzw.end(), {turn.x(), turn.y(), turn.z(), turn.w()});
    }
  }
  const hsize_t steps = track.size();
  file.Add(half + "/effector/position", {steps, 2}, grippers);
  file.Add(half + "/end/position", {steps, 2, 3}, positions_m);
  file.Add(half + "/end/orientation", {steps, 2, 4}, quaternions_xyzw);
}

/// Whether the arm is at the base's origin at every step, where no gripper can be.
bool LiesAtOrigin(const std::vector<Arms>& track, std::size_t arm) {
  const auto is_there = [&](const Arms& arms) { return !arms[arm].base_from_gripper.translation().isZero(0); };
  return std::ranges::none_of(track, is_there);
}

}  // namespace

std::string ProprioBytes(const std::vector<Arms>& arms, const std::vector<Arms>& told) {
  MemoryH5 file;
  AddHalf(file, "state", arms, kClosedGripper);
  if (!told.empty()) AddHalf(file, "action", told, 1);
  return file.Bytes();
}

void DropAbsentLeftArm(Recording& recording, const std::string& file) {
  if (LiesAtOrigin(recording.arms, 1)) {
    throw InvalidInput("{}: the right arm lies at the base's origin at every step, where no gripper can be; wanted the "
                       "only arm of a robot as the right one, its camera as hand_right",
                       file)
        .Called("absent_arm");
  }
  if (!LiesAtOrigin(recording.arms, 0)) return;
  const auto is_unturned_and_open = [](const Arms& arms) {
    return arms.front().closure == 0 && arms.front().base_from_gripper.matrix().isIdentity(0);
  };
  if (!std::ranges::all_of(recording.arms, is_unturned_and_open)) {
    throw InvalidInput("{}: the left arm lies at the base's origin at every step, turned or not open; wanted of a "
                       "robot without one the quaternion 0 0 0 1 (x y z w, not w first) and a gripper of 0",
                       file)
        .Called("absent_arm");
  }
  for (std::vector<Arms>* track : {&recording.arms, &recording.told}) {
    for (Arms& arms : *track) arms.erase(arms.begin());
  }
  for (Camera& camera : recording.cameras) {  // named after the left hand, fixed to where that lies: the base
    if (camera.mount == Mount::kLeftGripper) camera.mount = Mount::kBase;
  }
  recording.arm_names = {"right"};
}

}  // namespace evac
