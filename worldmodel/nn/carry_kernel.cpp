#include "worldmodel/nn/carry_kernel.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include "worldmodel/nn/processors.h"

namespace evac::nn::kernels {
namespace {

constexpr double kFar = 1e4;      // rays' lengths; and a ray along the plane, which meets it nowhere
constexpr double kBefore = 1e-9;  // the camera

/// One row of pixels: where each is looked for, in pixels of the frame and held within it.
struct Row {
  std::vector<float> x, y;
};

EVAC_EACH_PROCESSOR void FindRow(const CarryGeometry& g, const CarryShape& shape, std::int64_t row, Row& found,
                                 bool* shown) {
  const auto finer = static_cast<double>(shape.finer), w = static_cast<double>(shape.width),
             h = static_cast<double>(shape.height);
  const double y = (static_cast<double>(row) + 0.5) / finer - 0.5, last_x = w * finer - 1, last_y = h * finer - 1;
  const double* a = g.found_from_position;
  float *at_x = found.x.data(), *at_y = found.y.data();
#pragma omp simd
  for (std::int64_t j = 0; j < shape.width * shape.finer; ++j) {
    const double x = (static_cast<double>(j) + 0.5) / finer - 0.5;
    const double distance = g.plane_above_camera_m /
                            (g.rise_from_position[0] * x + g.rise_from_position[1] * y + g.rise_from_position[2]);
    const bool meets = distance > 0 && distance < kFar;
    const double scale = meets ? distance : 1.0, shift = meets ? 1.0 : 0.0;
    const double depth = scale * (a[6] * x + a[7] * y + a[8]) + shift * g.found_from_camera[2];
    const double safe = depth > kBefore ? depth : kBefore;
    const double found_x = (scale * (a[0] * x + a[1] * y + a[2]) + shift * g.found_from_camera[0]) / safe + 0.5;
    const double found_y = (scale * (a[3] * x + a[4] * y + a[5]) + shift * g.found_from_camera[1]) / safe + 0.5;
    shown[j] = depth > kBefore && found_x >= 0 && found_x <= w && found_y >= 0 && found_y <= h;
    at_x[j] = static_cast<float>(std::min(std::max(found_x * finer - 0.5, 0.0), last_x));
    at_y[j] = static_cast<float>(std::min(std::max(found_y * finer - 0.5, 0.0), last_y));
  }
}

/// Between four pixels.
EVAC_EACH_PROCESSOR void ReadRow(const Row& at, std::int64_t width, std::int64_t height, const float* picture,
                                 float* read) {
  for (std::int64_t j = 0; j < width; ++j) {
    const float x = at.x[static_cast<std::size_t>(j)], y = at.y[static_cast<std::size_t>(j)];
    const auto left = static_cast<std::int64_t>(x), top = static_cast<std::int64_t>(y);
    const std::int64_t right = std::min(left + 1, width - 1), below = std::min(top + 1, height - 1);
    const float to_right = x - static_cast<float>(left), down = y - static_cast<float>(top);
    const float *upper = picture + top * width, *lower = picture + below * width;
    const float above = upper[left] + to_right * (upper[right] - upper[left]);
    read[j] = above + down * (lower[left] + to_right * (lower[right] - lower[left]) - above);
  }
}

}  // namespace

void Carry(const CarryShape& shape, const CarryGeometry* geometry, const float* frame, float* carried, bool* shown) {
  const std::int64_t width = shape.width * shape.finer, height = shape.height * shape.finer, pixels = width * height;
#pragma omp parallel for schedule(static)
  for (std::int64_t i = 0; i < shape.rows * shape.later; ++i) {
    const std::int64_t row = i / shape.later, later = i % shape.later;
    Row at{std::vector<float>(static_cast<std::size_t>(width)), std::vector<float>(static_cast<std::size_t>(width))};
    for (std::int64_t y = 0; y < height; ++y) {
      FindRow(geometry[i], shape, y, at, shown + i * pixels + y * width);
      for (std::int64_t c = 0; carried != nullptr && c < shape.channels; ++c)
        ReadRow(at, width, height, frame + (row * shape.channels + c) * pixels,
                carried + ((row * shape.channels + c) * shape.later + later) * pixels + y * width);
    }
  }
}

}  // namespace evac::nn::kernels
