#include "worldmodel/sim/draw_server.h"

#include <EGL/egl.h>
#include <EGL/eglext.h>
#include <sys/mman.h>
#include <unistd.h>

#include <algorithm>
#include <csignal>
#include <cstdio>
#include <memory>
#include <string_view>
#include <utility>
#include <vector>

#include "core/error.h"
#include "worldmodel/sim/drawing_board.h"
#include "worldmodel/sim/mujoco_handles.h"

namespace evac::sim {
namespace {

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

/// Makes an OpenGL context current. The process keeps it to its end.
void OpenOpenGl() {
  EGLDisplay display = OpenDisplay();
  const EGLint wanted[] = {EGL_SURFACE_TYPE, EGL_PBUFFER_BIT, EGL_RENDERABLE_TYPE, EGL_OPENGL_BIT, EGL_NONE};
  EGLConfig config = nullptr;
  EGLint count = 0;
  Check(eglChooseConfig(display, wanted, &config, 1, &count) && count > 0, "choosing a configuration with OpenGL");
  Check(eglBindAPI(EGL_OPENGL_API), "binding OpenGL");
  EGLContext context = eglCreateContext(display, config, EGL_NO_CONTEXT, nullptr);
  Check(context != EGL_NO_CONTEXT, "making a context");
  Check(eglMakeCurrent(display, EGL_NO_SURFACE, EGL_NO_SURFACE, context),
        "making the context current without a surface");
}

/// What OpenGL keeps for one base model and size of picture.
struct Canvas {
  Canvas(const mjModel& model, const DrawingBoard& order)
      : base(order.base), width_px(order.width_px), height_px(order.height_px) {
    mjv_defaultScene(&scene);
    mjv_makeScene(&model, &scene, kMaxGeoms);
    scene.flags[mjRND_HAZE] = 0;
    mjr_defaultContext(&context);
    const ModelPtr sized = CopyModel(model);  // the off-screen buffer's size is a property of the model
    sized->vis.global.offwidth = width_px;
    sized->vis.global.offheight = height_px;
    mjr_makeContext(sized.get(), &context, mjFONTSCALE_50);
    mjr_setBuffer(mjFB_OFFSCREEN, &context);
    if (context.currentBuffer != mjFB_OFFSCREEN)
      throw InternalError("cannot render: no off-screen buffer of {}x{}", width_px, height_px);
  }
  ~Canvas() {
    mjr_freeContext(&context);
    mjv_freeScene(&scene);
  }
  Canvas(const Canvas&) = delete;
  Canvas& operator=(const Canvas&) = delete;

  int base, width_px, height_px;
  mjvScene scene;
  mjrContext context;
};

/// Where MuJoCo may draw a shadow map that nobody looks at: a context of an empty scene, whose map is as small as can be.
class UnseenShadows {
 public:
  UnseenShadows() {
    static constexpr std::string_view kEmpty =
        "<mujoco><visual><global offwidth='1' offheight='1'/><quality shadowsize='1' offsamples='0'/></visual></mujoco>";
    const auto files = std::make_unique<mjVFS>();
    mj_defaultVFS(files.get());
    if (mj_makeEmptyFileVFS(files.get(), "empty.xml", static_cast<int>(kEmpty.size())) != 0)
      throw InternalError("cannot render: no memory for an empty scene");
    std::copy(kEmpty.begin(), kEmpty.end(), static_cast<char*>(files->filedata[0]));
    char message[500] = "";
    const ModelPtr empty(mj_loadXML("empty.xml", files.get(), message, sizeof message));
    mj_deleteVFS(files.get());
    if (!empty) throw InternalError("cannot render: no empty scene: {}", message);
    mjr_defaultContext(&context_);
    mjr_makeContext(empty.get(), &context_, mjFONTSCALE_50);
  }
  ~UnseenShadows() { mjr_freeContext(&context_); }
  UnseenShadows(const UnseenShadows&) = delete;
  UnseenShadows& operator=(const UnseenShadows&) = delete;

  const mjrContext& context() const { return context_; }

 private:
  mjrContext context_;
};

class DrawServer {
 public:
  explicit DrawServer(DrawingBoard& board) : board_(board) { OpenOpenGl(); }

  void Learn() {
    ModelPtr model(mj_loadModel(fmt::format("/proc/self/fd/{}", kModelFd).c_str(), nullptr));
    if (!model) throw InternalError("cannot render: a scene of MuJoCo did not arrive whole");
    models_.push_back(std::move(model));
  }

  void Draw() {
    Canvas& canvas = CanvasForOrder();
    mjvScene& scene = canvas.scene;
    scene.ngeom = board_.geom_count;
    scene.nlight = board_.light_count;
    std::copy_n(board_.geoms, scene.ngeom, scene.geoms);
    std::copy_n(board_.lights, scene.nlight, scene.lights);
    scene.camera[0] = scene.camera[1] = board_.camera;
    const mjrRect viewport = {0, 0, board_.width_px, board_.height_px};
    mjrContext context = ShadowsOf(canvas);
    mjr_setBuffer(mjFB_OFFSCREEN, &context);
    mjr_render(viewport, &scene, &context);
    mjr_readPixels(board_.rgb, nullptr, viewport, &context);  // waits until it is drawn
  }

 private:
  /// A canvas's context, which casts the shadows of what is drawn, or has those of the picture before: MuJoCo always casts
  /// them, which takes longer than the rest, but where to and where they are looked up may be two places.
  mjrContext ShadowsOf(const Canvas& canvas) {
    mjrContext context = canvas.context;
    if (!board_.keeps_shadows) {
      cast_ = &canvas;
    } else if (context.shadowSize > 0) {
      if (cast_ == nullptr || cast_->base != canvas.base)
        throw InternalError("cannot render: shadows are to be kept, and none of this scene were cast");
      if (!unseen_) unseen_ = std::make_unique<UnseenShadows>();
      context.shadowTex = cast_->context.shadowTex;
      context.shadowFBO = unseen_->context().shadowFBO;
      context.shadowSize = unseen_->context().shadowSize;
    }
    return context;
  }

  Canvas& CanvasForOrder() {
    const auto fits = [&](const auto& canvas) {
      return canvas->base == board_.base && canvas->width_px == board_.width_px &&
             canvas->height_px == board_.height_px;
    };
    const auto found = std::find_if(canvases_.begin(), canvases_.end(), fits);
    if (found != canvases_.end()) return **found;
    canvases_.push_back(std::make_unique<Canvas>(*models_.at(static_cast<std::size_t>(board_.base)), board_));
    return *canvases_.back();
  }

  DrawingBoard& board_;
  std::vector<ModelPtr> models_;
  std::vector<std::unique_ptr<Canvas>> canvases_;
  const Canvas* cast_ = nullptr;  ///< where the newest shadows were cast
  std::unique_ptr<UnseenShadows> unseen_;
};

/// Does `work` and says how it went. @returns whether anyone heard it.
template <typename Work>
bool Answer(DrawingBoard& board, const Work& work) {
  DrawingWord answer = DrawingWord::kDone;
  try {
    work();
  } catch (const std::exception& error) {
    std::snprintf(board.error, sizeof board.error, "%s", error.what());
    answer = DrawingWord::kRefused;
  }
  return ::write(kSocketFd, &answer, 1) == 1;
}

}  // namespace

int ServeDrawings() {
  std::signal(SIGPIPE, SIG_IGN);
  void* shared = ::mmap(nullptr, sizeof(DrawingBoard), PROT_READ | PROT_WRITE, MAP_SHARED, kBoardFd, 0);
  if (shared == MAP_FAILED) {
    std::fprintf(stderr, "evac-draw draws for evac, which starts it itself; it does nothing when started by hand\n");
    return static_cast<int>(ExitCode::kInvalidInput);
  }
  auto& board = *static_cast<DrawingBoard*>(shared);
  PrepareMujoco();
  std::unique_ptr<DrawServer> server;
  bool is_heard = Answer(board, [&] { server = std::make_unique<DrawServer>(board); });
  DrawingWord word{};
  while (is_heard && server && ::read(kSocketFd, &word, 1) == 1) {
    is_heard = Answer(board, [&] { word == DrawingWord::kLearn ? server->Learn() : server->Draw(); });
  }
  std::_Exit(0);  // nothing here is worth the time that OpenGL takes to put itself away
}

}  // namespace evac::sim
