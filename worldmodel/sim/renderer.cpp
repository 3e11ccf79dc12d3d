#include "worldmodel/sim/renderer.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <opencv2/imgproc.hpp>

#include "core/error.h"

namespace evac::sim {
namespace {

constexpr float kNearM = 0.01F, kFarM = 6.0F;
/// Drawn twice as large and averaged: cheaper in software than multisampling, and shadows gain too.
constexpr int kSupersampling = 2;

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

/// What is to be seen of one base model's scenes, one scene at a time.
struct Renderer::Shapes {
  explicit Shapes(const mjModel& model) : base(&model) {
    if (model.nskin > 0)
      throw InvalidInput("scene {}: found {} skins, wanted none: they are not drawn", model.names, model.nskin);
    mjv_defaultScene(&scene);
    mjv_makeScene(&model, &scene, kMaxGeoms);
    mjv_defaultOption(&options);
    std::fill(std::begin(options.sitegroup), std::end(options.sitegroup), mjtByte{0});
    mjv_defaultCamera(&unused_camera);
  }
  ~Shapes() { mjv_freeScene(&scene); }
  Shapes(const Shapes&) = delete;
  Shapes& operator=(const Shapes&) = delete;

  void Update(const mjModel& model, mjData& data) {
    mjv_updateScene(&model, &data, &options, nullptr, &unused_camera, mjCAT_ALL, &scene);
    if (scene.ngeom >= kMaxGeoms)
      throw InvalidInput("scene {}: found {} shapes or more to draw, wanted fewer", model.names, kMaxGeoms);
  }

  const mjModel* base;
  mjvScene scene;
  mjvOption options;
  mjvCamera unused_camera;  ///< MuJoCo wants one before we put ours in its place
};

Renderer::Renderer() : process_(std::make_unique<DrawProcess>()) {}
Renderer::~Renderer() = default;

Renderer::Shapes& Renderer::ShapesOf(const mjModel& base) {
  const auto found =
      std::find_if(shapes_.begin(), shapes_.end(), [&](const auto& shapes) { return shapes->base == &base; });
  if (found != shapes_.end()) return **found;
  shapes_.push_back(std::make_unique<Shapes>(base));
  return *shapes_.back();
}

std::optional<std::string> Renderer::TeachTheRest() {
  for (; taught_ < shapes_.size(); ++taught_) {
    if (const auto how_it_died = process_->Learn(*shapes_[taught_]->base)) return how_it_died;
  }
  return std::nullopt;
}

template <typename Order>
void Renderer::DrawSurely(const Order& order) {
  for (bool is_last_try = false;; is_last_try = true) {
    auto how_it_died = TeachTheRest();
    if (!how_it_died) {
      order(process_->board());
      how_it_died = process_->Draw();
    }
    if (!how_it_died) return;
    if (is_last_try)
      throw InternalError("cannot render: the drawing process {}, twice at the same picture", *how_it_died);
    std::fprintf(stderr, "evac: warning: a drawing process %s; another one goes on\n", how_it_died->c_str());
    process_ = std::make_unique<DrawProcess>();
    taught_ = 0;
  }
}

cv::Mat Renderer::Draw(const mjModel& base, const mjModel& model, mjData& data, const Camera& camera,
                       const Eigen::Isometry3d& base_from_camera) {
  Shapes& shapes = ShapesOf(base);
  shapes.Update(model, data);
  DrawSurely([&](DrawingBoard& board) {
    board.base = static_cast<int>(
        std::find_if(shapes_.begin(), shapes_.end(), [&](const auto& one) { return one->base == &base; }) -
        shapes_.begin());
    board.width_px = kSupersampling * camera.width_px;
    board.height_px = kSupersampling * camera.height_px;
    board.camera = ViewOf(camera, base_from_camera);
    board.geom_count = shapes.scene.ngeom;
    board.light_count = shapes.scene.nlight;
    std::copy_n(shapes.scene.geoms, board.geom_count, board.geoms);
    std::copy_n(shapes.scene.lights, board.light_count, board.lights);
  });
  const cv::Mat bottom_up(kSupersampling * camera.height_px, kSupersampling * camera.width_px, CV_8UC3,
                          process_->board().rgb);
  cv::Mat image;
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
  const std::int64_t drawn_px = std::int64_t{kSupersampling} * kSupersampling * camera.width_px * camera.height_px;
  if (drawn_px > kMaxPicture_px) {
    throw InvalidInput("camera '{}': found {}x{} pixels, wanted at most {} in all", camera.name, camera.width_px,
                       camera.height_px, kMaxPicture_px / kSupersampling / kSupersampling);
  }
}

}  // namespace evac::sim
