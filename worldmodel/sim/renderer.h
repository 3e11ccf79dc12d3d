#pragma once

#include <mujoco/mujoco.h>

#include <Eigen/Geometry>
#include <memory>
#include <opencv2/core.hpp>
#include <vector>

#include "core/types.h"

namespace evac::sim {

/// Draws scenes without a display: one OpenGL context by EGL (surfaceless, else EGL's default display; Mesa's software
/// rasteriser where there is no GPU). The same model and data give the same bytes on the same machine.
///
/// Make, use and destroy it in one thread; any number of renderers may live in threads of their own.
class Renderer {
 public:
  /// @throws InternalError naming the step that failed if there is no OpenGL.
  Renderer();
  ~Renderer();
  Renderer(const Renderer&) = delete;
  Renderer& operator=(const Renderer&) = delete;

  /// @param base    whose textures and meshes `model` has: `model` itself or what it was copied from. What is sent to
  /// OpenGL is
  ///                kept per base, which must outlive the renderer.
  /// @param camera  size and intrinsics. fx must equal fy, see RefuseUndrawable.
  /// @returns [height_px, width_px] CV_8UC3 RGB, continuous.
  cv::Mat Draw(const mjModel& base, const mjModel& model, mjData& data, const Camera& camera,
               const Eigen::Isometry3d& base_from_camera);

 private:
  class Display;
  struct Canvas;
  Canvas& CanvasFor(const mjModel& base, const Camera& camera);

  std::unique_ptr<Display> display_;
  std::vector<std::unique_ptr<Canvas>> canvases_;
};

/// MuJoCo draws square pixels with the principal point in the middle of the picture.
/// @throws InvalidInput naming the camera, what was found and what was wanted, for any other.
void RefuseUndrawable(const Camera& camera);

}  // namespace evac::sim
