#include "apps/golden/golden_geometry.h"

namespace evac::golden {
namespace {

template <int kSide>
Eigen::Matrix<float, kSide, kSide> MatrixOf(const Tensor& tensor) {
  nn::CheckShape("matrix", tensor, {kSide, kSide});
  const Tensor values = tensor.to(at::kFloat).contiguous();
  return Eigen::Map<const Eigen::Matrix<float, kSide, kSide, Eigen::RowMajor>>(values.data_ptr<float>());
}

}  // namespace

Eigen::Matrix3f Matrix3(const Tensor& tensor) { return MatrixOf<3>(tensor); }
Eigen::Matrix4f Matrix4(const Tensor& tensor) { return MatrixOf<4>(tensor); }

std::array<DrawnGripper, 2> GrippersOfAction(const Tensor& row) {
  const Tensor values = row.to(at::kFloat).contiguous();
  const float* at = values.data_ptr<float>();
  const auto gripper = [&](Side side, const float* v) {
    return DrawnGripper{side, {v[0], v[1], v[2]}, {v[3], v[4], v[5], v[6]}, v[7]};
  };
  return {gripper(Side::kLeft, at), gripper(Side::kRight, at + 8)};
}

PoseMapOptions ReferencePoseMap() {
  PoseMapOptions options;
  options.draw_behind_camera = true;
  return options;
}

Tensor AsTensor(const cv::Mat& picture) {
  return at::from_blob(picture.data, {picture.rows, picture.cols, 3}, at::kByte).clone();
}

Rays AsTensors(const RayMap& rays) {
  const std::vector<std::int64_t> shape = {3, rays.height, rays.width};
  const Tensor origin = at::tensor(std::vector<float>(rays.origin.begin(), rays.origin.end()));
  return {at::tensor(rays.direction).reshape(shape), origin.reshape({3, 1, 1}).expand(shape)};
}

}  // namespace evac::golden
