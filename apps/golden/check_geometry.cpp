#include <fmt/format.h>

#include <opencv2/core.hpp>

#include "apps/golden/golden_checks.h"
#include "apps/golden/golden_geometry.h"
#include "worldmodel/action_delta.h"
#include "worldmodel/frame_memory.h"

namespace evac::golden {
namespace {

/// A row of a recording: left xyz, quaternion xyzw, gripper 0 … 120, then right.
BothGrippers GrippersOfRow(const Tensor& row) {
  const double* values = row.data_ptr<double>();
  BothGrippers both;
  for (std::size_t arm = 0; arm < 2; ++arm) {
    const double* at = values + 8 * arm;
    both[arm] = {{at[0], at[1], at[2]}, Eigen::Quaterniond(at[6], at[3], at[4], at[5]).normalized(), at[7] / 120};
  }
  return both;
}

std::vector<float> DrawnRow(const BothGrippers& grippers) {
  std::vector<float> row;
  for (const Side side : {Side::kLeft, Side::kRight}) {
    const DrawnGripper drawn = Drawn(side, grippers[static_cast<std::size_t>(side)]);
    row.insert(row.end(), drawn.xyz_m.begin(), drawn.xyz_m.end());
    row.insert(row.end(), drawn.quat_xyzw.begin(), drawn.quat_xyzw.end());
    row.push_back(drawn.gripper);
  }
  return row;
}

void CheckRecording(const GoldenFile& file, const std::string& name, Comparison& comparison) {
  const Tensor raw = file.Get(name + ".raw").contiguous();
  const std::int64_t rows = raw.size(0), padding = file.Get(name + ".action").size(0) - rows;
  std::vector<Tensor> drawn, deltas, by_three, by_one;
  std::optional<BothGrippers> before;
  for (std::int64_t i = 0; i < rows; ++i) {
    const BothGrippers grippers = GrippersOfRow(raw[i]);
    const Tensor row = at::tensor(DrawnRow(grippers));
    drawn.insert(drawn.end(), static_cast<std::size_t>(i == 0 ? padding + 1 : 1), row);
    if (before) {
      const ActionDelta delta = DeltaBetween(*before, grippers);
      const auto normalised = [&](double stride) {
        const auto values = Normalised(delta, AgiBotWorldStatistics(), stride);
        return at::tensor(std::vector<float>(values.begin(), values.end()));
      };
      deltas.push_back(at::tensor(std::vector<double>(delta.begin(), delta.end()), at::kDouble));
      by_three.push_back(normalised(3));
      by_one.push_back(normalised(1));
    }
    before = grippers;
  }
  comparison.Close(name + ".action", at::stack(drawn), file.Get(name + ".action"), 1e-6);
  comparison.Within(name + ".delta_raw_f64", at::stack(deltas), file.Get(name + ".delta_raw_f64"), 1e-12);
  comparison.Close(name + ".delta_norm_sep3", at::stack(by_three), file.Get(name + ".delta_norm_sep3"), 1e-6);
  comparison.Close(name + ".delta_norm_sep1", at::stack(by_one), file.Get(name + ".delta_norm_sep1"), 1e-6);
}

/// CRC-32 as zlib counts it (polynomial 0xEDB88320, reflected).
std::uint32_t Crc32(const cv::Mat& picture) {
  std::uint32_t crc = ~0U;
  for (std::size_t i = 0; i < picture.total() * picture.elemSize(); ++i) {
    crc ^= picture.data[i];
    for (int bit = 0; bit < 8; ++bit) crc = crc >> 1 ^ (crc & 1 ? 0xEDB88320U : 0);
  }
  return ~crc;
}

/// The recording's rows stand in the file of actions of the same folder.
Tensor ActionRows(const Workshop& workshop, const std::string& name) {
  for (const auto& entry : std::filesystem::directory_iterator(workshop.folder())) {
    if (entry.path().extension() != ".safetensors") continue;
    const GoldenFile file(entry.path());
    if (file.Has(name + ".action")) return file.Get(name + ".action").clone();
  }
  throw TensorError(workshop.folder().string() + ": no file of the folder holds " + name +
                    ".action, the poses that were drawn");
}

void CheckDrawnRecording(const GoldenFile& file, const Workshop& workshop, const std::string& name,
                         Comparison& comparison) {
  const Tensor rows = ActionRows(workshop, name), crcs = file.Get(name + ".crc32_all").contiguous();
  const PoseMapView view{Matrix4(file.Get(name + ".w2c")), Matrix3(file.Get(name + ".K_resized"))};
  Tensor found = at::empty_like(crcs);
  for (std::int64_t i = 0; i < crcs.numel(); ++i) {
    const cv::Mat map = DrawPoseMap(GrippersOfAction(rows[i]), view, ReferencePoseMap());
    found.data_ptr<std::int64_t>()[i] = Crc32(map);
    const std::string frame = name + ".frame" + std::to_string(i);
    if (file.Has(frame)) comparison.Same(frame, AsTensor(map), file.Get(frame));
  }
  comparison.Same(name + ".crc32_all", found.ne(crcs).to(at::kLong), at::zeros_like(crcs));
}

void CheckSynthetic(const GoldenFile& file, Comparison& comparison) {
  const Tensor poses = file.Get("syn.pose"), cameras = file.Get("syn.w2c"), crcs = file.Get("syn.crc32").contiguous();
  const Tensor wanted = file.Get("syn.maps_v0");
  Tensor found = at::empty_like(crcs);
  for (std::int64_t v = 0; v < crcs.size(0); ++v) {
    for (std::int64_t i = 0; i < crcs.size(1); ++i) {
      const PoseMapView view{Matrix4(cameras[v][i]), Matrix3(file.Get("syn.K")), static_cast<int>(wanted.size(2)),
                             static_cast<int>(wanted.size(1))};
      const cv::Mat map = DrawPoseMap(GrippersOfAction(poses[i]), view, ReferencePoseMap());
      found.data_ptr<std::int64_t>()[v * crcs.size(1) + i] = Crc32(map);
      if (v == 0) comparison.Same(fmt::format("syn.maps_v0[{}]", i), AsTensor(map), wanted[i]);
    }
  }
  comparison.Same("syn.crc32", found.ne(crcs).to(at::kLong), at::zeros_like(crcs));
}

}  // namespace

void CheckActions(const GoldenFile& file, Workshop&, Comparison& comparison) {
  for (const std::string& name : file.PrefixesOf(".raw")) CheckRecording(file, name, comparison);
}

void CheckActionMaps(const GoldenFile& file, Workshop& workshop, Comparison& comparison) {
  for (const std::string& name : file.PrefixesOf(".crc32_all")) CheckDrawnRecording(file, workshop, name, comparison);
  if (file.Has("syn.pose")) CheckSynthetic(file, comparison);
}

void CheckRayMaps(const GoldenFile& file, Workshop&, Comparison& comparison) {
  const auto compare = [&](const std::string& name, const Tensor& intrinsics, const Tensor& base_from_camera,
                           const Tensor& direction, const Tensor& origin) {
    const RayMap rays = MakeRayMap(Matrix3(intrinsics), Matrix4(base_from_camera), static_cast<int>(direction.size(0)),
                                   static_cast<int>(direction.size(1)));
    const Rays tensors = AsTensors(rays);
    comparison.Within(name + " direction", tensors.direction.permute({1, 2, 0}), direction, 1e-6);
    comparison.Within(name + " origin", tensors.origin.permute({1, 2, 0}), origin, 1e-6);
  };
  for (const std::string& name : file.PrefixesOf(".dir_hwc"))
    compare(name, file.Get(name + ".K_lat"), file.Get(name + ".c2w"), file.Get(name + ".dir_hwc"),
            file.Get(name + ".origin_hwc"));
  if (!file.Has("syn.dir")) return;
  const Tensor cameras = file.Get("syn.c2w"), directions = file.Get("syn.dir"), origins = file.Get("syn.origin");
  const Tensor intrinsics =
      file.Get("syn.K") * at::tensor({0.125F, 0.125F, 1.0F}).unsqueeze(1);  // of the picture; stride 8
  for (std::int64_t v = 0; v < cameras.size(0); ++v)
    compare("syn view " + std::to_string(v), intrinsics, cameras[v], directions[v], origins[v]);
}

}  // namespace evac::golden
