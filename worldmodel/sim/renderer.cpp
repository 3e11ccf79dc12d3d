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

/// Whether any of a shape may be in the picture, by a ball about it. Shapes without one (planes) always may.
bool MayBeSeen(const mjvGeom& geom, const mjvGLCamera& camera, float width_by_height) {
  if (geom.modelrbound <= 0) return true;
  using Vector = Eigen::Vector3f;
  const auto vector = [](const float* of) { return Vector(of[0], of[1], of[2]); };
  const Vector forward = vector(camera.forward), up = vector(camera.up), right = forward.cross(up);
  const Vector from_camera = vector(geom.pos) - vector(camera.pos);
  const float depth = from_camera.dot(forward), radius = 1.001F * geom.modelrbound + 1e-4F;
  const auto is_beside = [&](float sideways, float slope) {  // beyond the picture's edge, whose rays have that slope
    return std::abs(sideways) - slope * depth > radius * std::sqrt(1 + slope * slope);
  };
  const float slope = camera.frustum_top / camera.frustum_near;
  return depth > camera.frustum_near - radius && depth < camera.frustum_far + radius &&
         !is_beside(from_camera.dot(up), slope) && !is_beside(from_camera.dot(right), slope * width_by_height);
}

/// All shapes; where shadows are cast already, those that may be seen. A mirror may show any.
void PutShapes(const mjvScene& scene, DrawingBoard& board) {
  const auto is_mirror = [](const mjvGeom& geom) { return geom.reflectance > 0; };
  const bool all = !board.keeps_shadows || std::any_of(scene.geoms, scene.geoms + scene.ngeom, is_mirror);
  const float width_by_height = static_cast<float>(board.width_px) / static_cast<float>(board.height_px);
  const mjvGeom* end = std::copy_if(scene.geoms, scene.geoms + scene.ngeom, board.geoms, [&](const mjvGeom& geom) {
    return all || MayBeSeen(geom, board.camera, width_by_height);
  });
  board.geom_count = static_cast<int>(end - board.geoms);
  board.light_count = scene.nlight;
  std::copy_n(scene.lights, scene.nlight, board.lights);
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

std::optional<std::string> Renderer::TryToDraw(int base, const mjvScene& scene, const std::vector<SceneView>& views,
                                               std::vector<cv::Mat>& pictures) {
  pictures.clear();
  if (auto how_it_died = TeachTheRest()) return how_it_died;
  for (const auto& [camera, base_from_camera] : views) {
    DrawingBoard& board = process_->board();
    board.base = base;
    board.width_px = kSupersampling * camera.width_px;
    board.height_px = kSupersampling * camera.height_px;
    board.camera = ViewOf(camera, base_from_camera);
    board.keeps_shadows = !pictures.empty();
    PutShapes(scene, board);
    if (auto how_it_died = process_->Draw()) return how_it_died;
    const cv::Mat bottom_up(board.height_px, board.width_px, CV_8UC3, board.rgb);
    cv::Mat& picture = pictures.emplace_back();
    cv::resize(bottom_up, picture, {camera.width_px, camera.height_px}, 0, 0, cv::INTER_AREA);
    cv::flip(picture, picture, 0);
  }
  return std::nullopt;
}

std::vector<cv::Mat> Renderer::Draw(const mjModel& base, const mjModel& model, mjData& data,
                                    const std::vector<SceneView>& views) {
  Shapes& shapes = ShapesOf(base);
  shapes.Update(model, data);
  const auto number = std::find_if(shapes_.begin(), shapes_.end(), [&](const auto& one) { return one->base == &base; }) -
                      shapes_.begin();
  std::vector<cv::Mat> pictures;
  for (bool is_last_try = false;; is_last_try = true) {
    const auto how_it_died = TryToDraw(static_cast<int>(number), shapes.scene, views, pictures);
    if (!how_it_died) return pictures;
    if (is_last_try)
      throw InternalError("cannot render: the drawing process {}, twice at the same picture", *how_it_died);
    std::fprintf(stderr, "evac: warning: a drawing process %s; another one goes on\n", how_it_died->c_str());
    process_ = std::make_unique<DrawProcess>();
    taught_ = 0;
  }
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
