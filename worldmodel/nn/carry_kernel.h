#pragma once

#include <cstdint>

/// A frame carried along a plane (worldmodel/nn/carried_frame.h), in one pass over its pixels: floats in memory, on the
/// CPU. The results do not depend on the number of threads.
namespace evac::nn::kernels {

/// Where one later frame's places are looked for in the frame that is carried. A position p is (x, y, 1) in places;
/// what is found is a position times its depth. Matrices row by row.
struct CarryGeometry {
  double found_from_position[9];  ///< of what is infinitely far
  double found_from_camera[3];    ///< added to `distance` times that, where the ray meets the plane
  double rise_from_position[3];   ///< the z of the later ray, base frame
  double plane_above_camera_m;
};

struct CarryShape {
  std::int64_t rows = 0, later = 0;    ///< rows * later geometries, row by row
  std::int64_t channels = 0;
  std::int64_t width = 0, height = 0;  ///< places of the rays
  std::int64_t finer = 1;              ///< a place is so many pixels wide and high
};

/// @param frame    [rows, channels, height finer, width finer]
/// @param carried  [rows, channels, later, height finer, width finer]; null: only what is shown is asked for
/// @param shown    [rows, later, height finer, width finer]: 1 where the frame shows the place
void Carry(const CarryShape& shape, const CarryGeometry* geometry, const float* frame, float* carried, bool* shown);

}  // namespace evac::nn::kernels
