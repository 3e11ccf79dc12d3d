#include "worldmodel/sim/renderer.h"

#include <EGL/egl.h>
#include <EGL/eglext.h>

#include <algorithm>
#include <cmath>
#include <mutex>
#include <opencv2/imgproc.hpp>

#include "core/error.h"
#include "worldmodel/sim/mujoco_handles.h"

namespace evac::sim {
namespace {

constexpr float kNearM = 0.01F, kFarM = 6.0F;
constexpr int kMaxGeoms = 400;
constexpr int kSupersampling =
    2;  // drawn twice as large and averaged: cheaper in software than multisampling, and shadows gain too

void Check(bool ok, const char* step) {
  if (!ok)
    throw InternalError("cannot render: {} failed with EGL error 0x{:x}; is libegl1 with libgl1-mesa-dri installed?",
                        step, eglGetError());
}

EGLDisplay OpenDisplay() {
  EGLDisplay display = eglGetPlatformDisplay(EGL_PLATFORM_SURFACELESS_MESA, EGL_DEFAULT_DISPLAY, nullptr);
  if (display != EGL_NO_DISPLAY && eglInitialize(display, nullptr, nullptr)) return display;
  display = eglGetDisplay(EGL_DEFAULT_DISPLAY);
  Check(display != EGL_NO_DISPLAY && eglInitialize(display, nullptr, nullptr), "opening a display");
  return display;
}

/// Held wherever OpenGL works. Mesa's software rasteriser keeps one screen per process, and two contexts that drew at the same time
/// crashed inside it now and then (Mesa 22.3, LP_NUM_THREADS=0); physics, codecs and everything else run beside it.
std::mutex& OpenGlTurn() {
  static std::mutex mutex;
  return mutex;
}

void Copy(const Eigen::Vector3d& from, float* to) {
  for (int i = 0; i < 3; ++i) to[i] = static_cast<float>(from[i]);
}

mjvGLCamera ViewOf(const Camera& camera, const Eigen::Isometry3d& base_from_camera) {
  mjvGLCamera view{};
  Copy(base_from_camera.translation(), view.pos);
  Copy(base_from_camera.linear().col(2), view.forward);
  Copy(-base_from_camera.linear().col(1), view.up);
  view.frustum_top = kNearM * static_cast<float>(camera.height_px / 2.0 / camera.fy_px);
  view.frustum_bottom = -view.frustum_top;
  view.frustum_near = kNearM;
  view.frustum_far = kFarM;
  return view;
}

}  // namespace

/// An OpenGL context that is current in the thread that made it.
class Renderer::Display {
 public:
  Display() : display_(OpenDisplay()) {
    const EGLint wanted[] = {EGL_SURFACE_TYPE, EGL_PBUFFER_BIT, EGL_RENDERABLE_TYPE, EGL_OPENGL_BIT, EGL_NONE};
    EGLConfig config = nullptr;
    EGLint count = 0;
    Check(eglChooseConfig(display_, wanted, &config, 1, &count) && count > 0, "choosing a configuration with OpenGL");
    Check(eglBindAPI(EGL_OPENGL_API), "binding OpenGL");
    context_ = eglCreateContext(display_, config, EGL_NO_CONTEXT, nullptr);
    Check(context_ != EGL_NO_CONTEXT, "making a context");
    Check(eglMakeCurrent(display_, EGL_NO_SURFACE, EGL_NO_SURFACE, context_),
          "making the context current without a surface");
  }
  ~Display() {  // the display itself is shared by all renderers of the process and stays open
    eglMakeCurrent(display_, EGL_NO_SURFACE, EGL_NO_SURFACE, EGL_NO_CONTEXT);
    eglDestroyContext(display_, context_);
  }
  Display(const Display&) = delete;
  Display& operator=(const Display&) = delete;

 private:
  EGLDisplay display_;
  EGLContext context_ = EGL_NO_CONTEXT;
};

/// What OpenGL keeps for one base model and a largest picture.
struct Renderer::Canvas {
  Canvas(const mjModel& model, int width, int height) : base(&model), width_px(width), height_px(height) {
    mjv_defaultScene(&scene);
    mjv_makeScene(&model, &scene, kMaxGeoms);
    scene.flags[mjRND_HAZE] = 0;
    mjr_defaultContext(&context);
    const ModelPtr sized = CopyModel(model);  // the off-screen buffer's size is a property of the model
    sized->vis.global.offwidth = kSupersampling * width;
    sized->vis.global.offheight = kSupersampling * height;
    mjr_makeContext(sized.get(), &context, mjFONTSCALE_50);
    mjr_setBuffer(mjFB_OFFSCREEN, &context);
    if (context.currentBuffer != mjFB_OFFSCREEN)
      throw InternalError("cannot render: no off-screen buffer of {}x{}", width, height);
    mjv_defaultOption(&options);
    std::fill(std::begin(options.sitegroup), std::end(options.sitegroup), mjtByte{0});
    mjv_defaultCamera(&unused_camera);
  }
  ~Canvas() {
    mjr_freeContext(&context);
    mjv_freeScene(&scene);
  }
  Canvas(const Canvas&) = delete;
  Canvas& operator=(const Canvas&) = delete;

  const mjModel* base;
  int width_px, height_px;
  mjvScene scene;
  mjrContext context;
  mjvOption options;
  mjvCamera unused_camera;  ///< MuJoCo wants one before we put ours in its place
};

Renderer::Renderer() {
  const std::lock_guard turn(OpenGlTurn());
  display_ = std::make_unique<Display>();
}

Renderer::~Renderer() {
  const std::lock_guard turn(OpenGlTurn());
  canvases_.clear();  // while their context is still there
  display_.reset();
}

Renderer::Canvas& Renderer::CanvasFor(const mjModel& base, const Camera& camera) {
  for (const auto& canvas : canvases_) {
    if (canvas->base == &base && canvas->width_px == camera.width_px && canvas->height_px == camera.height_px)
      return *canvas;
  }
  canvases_.push_back(std::make_unique<Canvas>(base, camera.width_px, camera.height_px));
  return *canvases_.back();
}

cv::Mat Renderer::Draw(const mjModel& base, const mjModel& model, mjData& data, const Camera& camera,
                       const Eigen::Isometry3d& base_from_camera) {
  std::unique_lock turn(OpenGlTurn());
  Canvas& canvas = CanvasFor(base, camera);
  mjv_updateScene(&model, &data, &canvas.options, nullptr, &canvas.unused_camera, mjCAT_ALL, &canvas.scene);
  canvas.scene.camera[0] = canvas.scene.camera[1] = ViewOf(camera, base_from_camera);
  const mjrRect viewport = {0, 0, kSupersampling * camera.width_px, kSupersampling * camera.height_px};
  mjr_setBuffer(mjFB_OFFSCREEN, &canvas.context);
  mjr_render(viewport, &canvas.scene, &canvas.context);
  cv::Mat bottom_up(viewport.height, viewport.width, CV_8UC3), image;
  mjr_readPixels(bottom_up.data, nullptr, viewport, &canvas.context);  // waits until it is drawn
  turn.unlock();
  cv::resize(bottom_up, image, {camera.width_px, camera.height_px}, 0, 0, cv::INTER_AREA);
  cv::flip(image, image, 0);
  return image;
}

void RefuseUndrawable(const Camera& camera) {
  if (std::abs(camera.fx_px - camera.fy_px) > 1e-6 * camera.fy_px) {
    throw InvalidInput("camera '{}': found fx_px {} and fy_px {}, wanted the same: MuJoCo draws square pixels",
                       camera.name, camera.fx_px, camera.fy_px);
  }
  if (std::abs(camera.cx_px - camera.width_px / 2.0) > 1e-6 || std::abs(camera.cy_px - camera.height_px / 2.0) > 1e-6) {
    throw InvalidInput("camera '{}': found the principal point at ({}, {}), wanted the middle of the picture ({}, {})",
                       camera.name, camera.cx_px, camera.cy_px, camera.width_px / 2.0, camera.height_px / 2.0);
  }
}

}  // namespace evac::sim
