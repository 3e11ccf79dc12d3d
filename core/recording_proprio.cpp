#include <hdf5.h>

#include <algorithm>
#include <array>
#include <cstring>
#include <functional>
#include <limits>

#include "core/error.h"
#include "core/in_child.h"
#include "core/recording_parts.h"

namespace evac {
namespace {

namespace fs = std::filesystem;

constexpr std::size_t kMaxNumberBytes = 8;
constexpr hsize_t kMaxChunkNumbers = hsize_t{1} << 24;  // the library allocates whole chunks
constexpr int kArms = 2;
constexpr double kClosedAction = 1;  // what a closed gripper is told; measured it reads 120

/// Owns an identifier of the HDF5 library.
class Handle {
 public:
  Handle(hid_t id, herr_t (*close)(hid_t)) : id_(id), close_(close) {}
  ~Handle() {
    if (id_ >= 0) close_(id_);
  }
  Handle(const Handle&) = delete;
  Handle& operator=(const Handle&) = delete;
  hid_t id() const { return id_; }
  bool valid() const { return id_ >= 0; }

 private:
  hid_t id_;
  herr_t (*close_)(hid_t);
};

/// The library is this thread's while this lives, and its own error printing is off: what goes wrong is said by our
/// messages.
class QuietHdf5 {
 public:
  QuietHdf5() {
    H5Eget_auto2(H5E_DEFAULT, &function_, &data_);
    H5Eset_auto2(H5E_DEFAULT, nullptr, nullptr);
  }
  ~QuietHdf5() { H5Eset_auto2(H5E_DEFAULT, function_, data_); }
  QuietHdf5(const QuietHdf5&) = delete;
  QuietHdf5& operator=(const QuietHdf5&) = delete;

 private:
  std::unique_lock<std::mutex> lock_ = LockHdf5();
  H5E_auto2_t function_ = nullptr;
  void* data_ = nullptr;
};

struct Track {
  hsize_t steps = 0;
  hsize_t width = 0;           ///< numbers per arm
  std::vector<double> values;  ///< [steps, 2, width]

  const double* At(hsize_t step, int arm) const { return &values[(step * kArms + static_cast<hsize_t>(arm)) * width]; }
};

/// The shape of a data set, checked to be [T, 2] (width 1) or [T, 2, width] before anything of its size is allocated.
hsize_t StepsOf(const Handle& data, hsize_t width, const std::string& where) {
  const Handle space(H5Dget_space(data.id()), H5Sclose);
  const int wanted_rank = width == 1 ? 2 : 3;
  std::array<hsize_t, 3> shape = {0, 0, width};
  const int rank = space.valid() ? H5Sget_simple_extent_ndims(space.id()) : -1;
  if (rank == wanted_rank) H5Sget_simple_extent_dims(space.id(), shape.data(), nullptr);
  if (rank != wanted_rank || shape[1] != kArms || shape[2] != width) {
    throw InvalidInput("{}: its shape is not [T, 2{}]: one row per step, left and right arm", where,
                       width == 1 ? "" : fmt::format(", {}", width));
  }
  if (shape[0] == 0 || shape[0] > kMaxRecordedSteps)
    throw InvalidInput("{}: {} steps, wanted 1 … {}", where, shape[0], kMaxRecordedSteps);
  return shape[0];
}

/// The library believes what a file says of its numbers' and chunks' sizes and allocates accordingly: we do not.
void CheckSizes(const Handle& data, const std::string& where) {
  const Handle type(H5Dget_type(data.id()), H5Tclose);
  const H5T_class_t kind = type.valid() ? H5Tget_class(type.id()) : H5T_NO_CLASS;
  if (kind != H5T_FLOAT && kind != H5T_INTEGER) throw InvalidInput("{}: it holds no numbers", where);
  const std::size_t bytes = H5Tget_size(type.id());
  if (bytes == 0 || bytes > kMaxNumberBytes)
    throw InvalidInput("{}: numbers of {} bytes, wanted at most {}", where, bytes, kMaxNumberBytes);
  const Handle creation(H5Dget_create_plist(data.id()), H5Pclose);
  if (!creation.valid()) throw InvalidInput("{}: the data set cannot be read", where);
  if (H5Pget_layout(creation.id()) != H5D_CHUNKED) {
    const Handle space(H5Dget_space(data.id()), H5Sclose);
    const hssize_t numbers = space.valid() ? H5Sget_simple_extent_npoints(space.id()) : -1;
    if (numbers < 0 || H5Dget_storage_size(data.id()) / bytes < static_cast<hsize_t>(numbers))
      throw InvalidInput("{}: it declares {} numbers and holds fewer", where, numbers);
    return;
  }
  std::array<hsize_t, 3> chunk = {1, 1, 1};
  const int rank = H5Pget_chunk(creation.id(), static_cast<int>(chunk.size()), chunk.data());
  hsize_t numbers = 1;
  for (const hsize_t side : chunk) {
    if (numbers <= kMaxChunkNumbers) numbers = side > kMaxChunkNumbers ? side : numbers * std::max<hsize_t>(1, side);
  }
  if (rank < 0 || rank > 3 || numbers > kMaxChunkNumbers) throw InvalidInput("{}: its chunks are too large", where);
}

Track ReadTrack(const Handle& file, const char* name, hsize_t width, const std::string& path) {
  const std::string where = fmt::format("{}: {}", path, name);
  const Handle data(H5Dopen2(file.id(), name, H5P_DEFAULT), H5Dclose);
  if (!data.valid()) throw InvalidInput("{}: there is no such data set", where);
  CheckSizes(data, where);
  Track track{StepsOf(data, width, where), width, {}};
  // What the file does not fill stays NaN and is refused as such.
  track.values.assign(track.steps * kArms * width, std::numeric_limits<double>::quiet_NaN());
  if (H5Dread(data.id(), H5T_NATIVE_DOUBLE, H5S_ALL, H5S_ALL, H5P_DEFAULT, track.values.data()) < 0) {
    throw InvalidInput("{}: the data set cannot be read", where);
  }
  return track;
}

Handle OpenH5(const fs::path& path) {
  const hid_t file = H5Fopen(path.c_str(), H5F_ACC_RDONLY, H5P_DEFAULT);
  if (file < 0) throw InvalidInput("{}: no HDF5 file, or a broken one", path.string());
  return {file, H5Fclose};
}

/// The arms of one of the file's two halves: `state` or `action`.
/// @param closed  what the half's gripper is when closed
std::vector<Arms> ReadHalf(const Handle& file, const std::string& half, double closed, const fs::path& path) {
  const Track gripper = ReadTrack(file, (half + "/effector/position").c_str(), 1, path.string());
  const Track position = ReadTrack(file, (half + "/end/position").c_str(), 3, path.string());
  const Track orientation = ReadTrack(file, (half + "/end/orientation").c_str(), 4, path.string());
  if (gripper.steps != position.steps || gripper.steps != orientation.steps) {
    throw InvalidInput(
        "{}: {}/effector/position has {} steps, {}/end/position {}, {}/end/orientation {}; wanted the same",
        path.string(), half, gripper.steps, half, position.steps, half, orientation.steps);
  }
  std::vector<Arms> arms;
  arms.reserve(gripper.steps);
  for (hsize_t step = 0; step < gripper.steps; ++step) {
    Arms both;
    for (int arm = 0; arm < kArms; ++arm) {
      const auto in = [&](const char* set) {
        return fmt::format("{}: {}/{}: step {}, {} arm", path.string(), half, set, step, arm == 0 ? "left" : "right");
      };
      const Eigen::Vector3d xyz_m(position.At(step, arm));
      const Eigen::Vector4d quat_xyzw(orientation.At(step, arm));
      both.push_back({PoseFromRaw(xyz_m, quat_xyzw, in("end")),
                      ClosureFromRaw(*gripper.At(step, arm), closed, in("effector/position"))});
    }
    arms.push_back(std::move(both));
  }
  return arms;
}

constexpr std::size_t kNumbers = 17;  // of an arm: its pose as a 4x4 matrix, column by column, and its closure

std::string BytesOf(const std::vector<Arms>& steps) {
  std::vector<double> numbers;
  for (const Arms& arms : steps) {
    for (const ArmState& arm : arms) {
      numbers.insert(numbers.end(), arm.base_from_gripper.data(), arm.base_from_gripper.data() + kNumbers - 1);
      numbers.push_back(arm.closure);
    }
  }
  return {reinterpret_cast<const char*>(numbers.data()), numbers.size() * sizeof(double)};
}

std::vector<Arms> ArmsOf(const std::string& bytes) {
  std::vector<double> numbers(bytes.size() / sizeof(double));
  if (!numbers.empty()) std::memcpy(numbers.data(), bytes.data(), numbers.size() * sizeof(double));
  std::vector<Arms> steps(numbers.size() / (kArms * kNumbers));
  for (std::size_t i = 0; i < steps.size() * kArms; ++i) {
    ArmState& arm = steps[i / kArms].emplace_back();
    std::copy_n(&numbers[i * kNumbers], kNumbers - 1, arm.base_from_gripper.data());
    arm.closure = numbers[i * kNumbers + kNumbers - 1];
  }
  return steps;
}

/// The library reads beyond its memory where a file lies cleverly enough; in a process of its own nobody minds.
std::vector<Arms> Guarded(const fs::path& path, const std::function<std::vector<Arms>()>& read) {
  const QuietHdf5 quiet;
  return ArmsOf(InChild(path.string(), [&] { return BytesOf(read()); }));
}

}  // namespace

std::unique_lock<std::mutex> LockHdf5() {
  static std::mutex mutex;
  return std::unique_lock(mutex);
}

std::vector<Arms> ReadProprio(const fs::path& path) {
  return Guarded(path, [&] { return ReadHalf(OpenH5(path), "state", kClosedGripper, path); });
}

std::vector<Arms> ReadTold(const fs::path& path) {
  return Guarded(path, [&]() -> std::vector<Arms> {
    const Handle file = OpenH5(path);
    for (const char* part : {"action", "action/end", "action/end/position", "action/effector"}) {
      if (H5Lexists(file.id(), part, H5P_DEFAULT) <= 0) return {};
    }
    return ReadHalf(file, "action", kClosedAction, path);
  });
}

std::vector<Arms> ReadToldOf(const fs::path& path, std::size_t steps) {
  std::vector<Arms> told = Calling("broken_track", [&] { return ReadTold(path); });
  if (told.empty() || told.size() == steps) return told;
  throw InvalidInput("{}: action/end/position has {} steps, wanted the {} of state/end/position", path.string(), told.size(), steps)
      .Called("broken_track");
}

}  // namespace evac
