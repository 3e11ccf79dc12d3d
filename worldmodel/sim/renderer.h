#pragma once

#include <mujoco/mujoco.h>

#include <Eigen/Geometry>
#include <memory>
#include <opencv2/core.hpp>
#include <vector>

#include "core/types.h"
#include "worldmodel/sim/draw_process.h"

namespace evac::sim {

/// Where a picture is taken from. `camera`: size and intrinsics, see RefuseUndrawable.
struct SceneView {
  const Camera& camera;
  Eigen::Isometry3d base_from_camera;
};

/// Draws scenes without a display, in a process of its own (draw_server.h): one OpenGL context by EGL (surfaceless,
/// else EGL's default display; Mesa's software rasteriser where there is no GPU). The same model and data give the same
/// bytes on the same machine. Several renderers draw at the same time; one is for one thread at a time.
class Renderer {
 public:
  /// @throws InternalError naming the step that failed if there is no OpenGL.
  Renderer();
  ~Renderer();
  Renderer(const Renderer&) = delete;
  Renderer& operator=(const Renderer&) = delete;

  /// @param base    whose textures and meshes `model` has: `model` itself or what it was copied from. It must outlive
  ///                the renderer, which sends it to the drawing process once.
  /// @param views   of one state, drawn together: shadows are cast once, by the first
  /// @returns per view [height_px, width_px] CV_8UC3 RGB, continuous; the same bytes as if it were drawn alone.
  /// @throws InvalidInput if the scene has more shapes than kMaxGeoms, or skins; InternalError if the drawing process
  ///         dies at this picture twice: the first time another one is started and stderr told.
  std::vector<cv::Mat> Draw(const mjModel& base, const mjModel& model, mjData& data,
                            const std::vector<SceneView>& views);

  /// Of the process that draws; another one after a crash.
  pid_t DrawingPid() const { return process_->pid(); }

 private:
  struct Shapes;
  Shapes& ShapesOf(const mjModel& base);
  /// @returns pictures, or how the process died.
  std::optional<std::string> TryToDraw(int base, const mjvScene& scene, const std::vector<SceneView>& views,
                                       std::vector<cv::Mat>& pictures);
  std::optional<std::string> TeachTheRest();

  std::unique_ptr<DrawProcess> process_;
  std::vector<std::unique_ptr<Shapes>> shapes_;  ///< per base model, in the order in which they are sent
  std::size_t taught_ = 0;                       ///< how many of them the process has
};

/// MuJoCo draws square pixels with the principal point in the middle of the picture.
/// @throws InvalidInput naming the camera, what was found and what was wanted, for any other, and for pictures larger
///         than kMaxPicture_px.
void RefuseUndrawable(const Camera& camera);

}  // namespace evac::sim
