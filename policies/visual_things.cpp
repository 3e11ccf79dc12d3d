#include "policies/visual_things.h"

#include <algorithm>
#include <map>
#include <numbers>

#include "core/error.h"

namespace evac {
namespace {

constexpr double kRadians = std::numbers::pi / 180;
constexpr double kSmallestPatchPx = 4;  // in a picture 96 wide; grows with the area
constexpr double kSecondPatch = 0.15;  // of the largest patch: a thing cut in two by what stands before it is still one
constexpr double kReach_m = 0.06;      // half a thing's width
constexpr double kReachOfHeight = 1.3;   // its upper end is seen against the table this far behind its foot, per metre
constexpr double kPoorestOverlap = 0.2;  // below it the patch is something else

double SmallestPatchPx(const View& view) {
  return kSmallestPatchPx * (view.rgb->cols / 96.0) * (view.rgb->cols / 96.0);
}

/// The large patches of the colour, as one.
cv::Mat MainCover(const std::vector<Blob>& blobs) {
  cv::Mat cover = blobs.front().cover.clone();
  for (std::size_t i = 1; i < blobs.size(); ++i) {
    if (blobs[i].weight_px >= kSecondPatch * blobs.front().weight_px) cover += blobs[i].cover;
  }
  return cover;
}

/// How far from its place something of the thing can be seen against the table.
double Reach(const Thing& thing) {
  double top_m = 0;
  for (const ConvexPart& part : thing.shape) {
    for (const Eigen::Vector3d& point_m : part.points_m) top_m = std::max(top_m, point_m.z());
  }
  return kReach_m + kReachOfHeight * top_m;
}

/// The picture, black where it cannot show the thing.
cv::Mat WhereItMayBe(const View& view, const Thing& thing, const Prior& prior) {
  const double within_m = prior.within_m + Reach(thing);
  cv::Mat3b rgb = view.rgb->clone();
  for (int v = 0; v < rgb.rows; ++v) {
    for (int u = 0; u < rgb.cols; ++u) {
      const auto point_m = OnPlane(view.camera, view.base_from_camera, {u + 0.5, v + 0.5}, thing.height_m);
      const bool may = point_m && (point_m->head<2>() - prior.placement.xy_m).norm() < within_m;
      if (!may) rgb(v, u) = cv::Vec3b(0, 0, 0);
    }
  }
  return rgb;
}

Thing Bottle() {
  Thing bottle;
  bottle.colour = {.hue_deg = 143, .hue_tolerance_deg = 32, .min_saturation = 0.3, .min_value = 0.08};
  bottle.shape = {Frustum(0.091, 0.028, 0.104, 0.028), Frustum(0.104, 0.028, 0.126, 0.019),
                  Frustum(0.12, 0.014, 0.168, 0.014), Frustum(0.168, 0.0148, 0.186, 0.0148)};
  bottle.shape.back().coloured = false;  // the white cap
  bottle.height_m = 0.004;
  return bottle;
}

PickKnowledge TakeBottle() {
  PickKnowledge knowledge;
  knowledge.thing = Bottle();
  knowledge.usual = {{{0.44, -0.12}, 0}, 0.12};
  knowledge.grasp_m = 0.155;
  knowledge.hover_m = 0.26;
  knowledge.lift_m = 0.13;
  knowledge.usual_target = {{{0.44, 0.12}, 0}, 0};
  knowledge.drop_m = 0.003;
  return knowledge;
}

/// The box is further to the left, where the left hand holds it, and the bottle goes to the right of it.
PickKnowledge TakeBottleTwoArms() {
  PickKnowledge knowledge = TakeBottle();
  knowledge.usual = {{{0.44, 0.03}, 0}, 0.10};
  knowledge.usual_target = {{{0.44, -0.16}, 0}, 0};
  return knowledge;
}

Thing Toast() {
  Thing toast;
  toast.colour = {.hue_deg = 31, .hue_tolerance_deg = 22, .min_saturation = 0.4, .min_value = 0.15};
  toast.shape = {Cuboid({-0.007, -0.035, 0.038}, {0.007, 0.035, 0.080})};
  toast.height_m = 0.006;
  toast.yaw_reach_rad = 10 * kRadians;
  return toast;
}

Thing Plate() {
  Thing plate;
  plate.colour = {.hue_deg = 216, .hue_tolerance_deg = 28, .min_saturation = 0.3, .min_value = 0.15};
  plate.shape = {Cuboid({-0.095, -0.095, 0}, {0.095, 0.095, 0.014}),
                 Cuboid({-0.083, -0.083, 0.011}, {0.083, 0.083, 0.013})};
  plate.shape.back().coloured = false;  // the white floor within the blue rim
  plate.yaw_reach_rad = 6 * kRadians;
  return plate;
}

PickKnowledge TakeToast() {
  PickKnowledge knowledge;
  knowledge.thing = Toast();
  knowledge.usual = {{{0.44, -0.14}, 0}, 0.12};
  knowledge.grasp_m = 0.070;
  knowledge.hover_m = 0.165;
  knowledge.lift_m = 0.12;
  knowledge.turn_rad = std::numbers::pi / 2;
  knowledge.target = Plate();
  knowledge.usual_target = {{{0.45, 0.14}, 0}, 0.12};
  knowledge.target_floor_m = 0.008;
  knowledge.target_rim_m = 0.089;
  knowledge.drop_m = 0.006;
  knowledge.tilt_rad = 33 * kRadians;
  knowledge.fall_m = 0.035;
  return knowledge;
}

Thing Ham() {
  Thing ham;
  ham.colour = {.hue_deg = 1, .hue_tolerance_deg = 20, .min_saturation = 0.25, .min_value = 0.1};
  ham.shape = {Cuboid({-0.029, -0.046, 0}, {0.029, 0.046, 0.004}), Cuboid({-0.019, -0.003, 0}, {0.019, 0.003, 0.031})};
  ham.height_m = 0.008;
  ham.yaw_reach_rad = 11 * kRadians;
  return ham;
}

Thing Bread() {
  Thing bread;
  bread.colour = {.hue_deg = 35, .hue_tolerance_deg = 16, .min_saturation = 0.4, .min_value = 0.15};
  bread.shape = {Cuboid({-0.056, -0.056, 0}, {0.056, 0.056, 0.018}),
                 Cuboid({-0.050, -0.050, 0.017}, {0.050, 0.050, 0.018})};
  bread.shape.back().coloured = false;  // the pale crumb within the crust
  bread.yaw_reach_rad = 6 * kRadians;
  return bread;
}

PickKnowledge TakeHam() {
  PickKnowledge knowledge;
  knowledge.thing = Ham();
  knowledge.held = {Cuboid({0.012, -0.008, -0.025}, {0.028, 0.008, 0.010})};
  knowledge.usual = {{{0.44, -0.14}, 0}, 0.12};
  knowledge.grasp_m = 0.035;
  knowledge.hover_m = 0.165;
  knowledge.lift_m = 0.12;
  knowledge.target = Bread();
  knowledge.usual_target = {{{0.45, 0.14}, 0}, 0.12};
  knowledge.target_floor_m = 0.018;
  knowledge.target_rim_m = 0.056;
  knowledge.drop_m = 0.006;
  return knowledge;
}

Thing Leaf() {
  Thing leaf;
  leaf.colour = {.hue_deg = 97, .hue_tolerance_deg = 26, .min_saturation = 0.3, .min_value = 0.1};
  leaf.shape = {Cuboid({-0.024, -0.038, 0.004}, {0.024, 0.038, 0.010}),
                Cuboid({0.022, -0.029, 0.008}, {0.064, 0.029, 0.014}),
                Cuboid({-0.021, -0.004, 0.0}, {0.021, 0.004, 0.026})};
  leaf.yaw_reach_rad = 14 * kRadians;
  return leaf;
}

Thing Bowl() {
  Thing bowl;
  bowl.colour = {.hue_deg = 218, .hue_tolerance_deg = 28, .min_saturation = 0.3, .min_value = 0.1};
  bowl.shape = {Frustum(0.0, 0.056, 0.050, 0.092)};
  return bowl;
}

PickKnowledge TakeLettuce() {
  PickKnowledge knowledge;
  knowledge.thing = Leaf();
  knowledge.held = {Cuboid({0.012, -0.012, -0.010}, {0.055, 0.012, 0.020})};
  knowledge.usual = {{{0.44, -0.14}, 0}, 0.12};
  knowledge.grasp_m = 0.027;
  knowledge.hover_m = 0.165;
  knowledge.lift_m = 0.14;
  knowledge.target = Bowl();
  knowledge.usual_target = {{{0.45, 0.14}, 0}, 0.12};
  knowledge.target_floor_m = 0.006;
  knowledge.target_rim_m = 0.080;
  knowledge.drop_m = 0.045;
  return knowledge;
}

}  // namespace

std::optional<ShapeFit> Locate(const View& view, const Thing& thing, const Prior& prior) {
  const std::vector<Blob> blobs = FindBlobs(WhereItMayBe(view, thing, prior), thing.colour, SmallestPatchPx(view));
  if (blobs.empty()) return std::nullopt;
  FitOptions options;
  options.reach_yaw_rad = thing.yaw_reach_rad;
  options.height_m = thing.height_m;
  const ShapeFit fit =
      FitShape(MainCover(blobs), thing.shape, view.camera, view.base_from_camera, {prior.placement, 0}, options);
  const double off_m = (fit.placement.xy_m - prior.placement.xy_m).norm();
  return fit.overlap >= kPoorestOverlap && off_m <= prior.within_m ? std::optional(fit) : std::nullopt;
}

double VisibleShare(const View& view, const Thing& thing, const Eigen::Isometry3d& base_from_thing) {
  const cv::Mat silhouette = Silhouette(thing.shape, view.camera, view.base_from_camera.inverse() * base_from_thing);
  const double area = cv::sum(silhouette)[0];
  return area > 0 ? cv::sum(cv::min(silhouette, Cover(*view.rgb, thing.colour)))[0] / area : 0;
}

namespace {

using Knows = PickKnowledge (*)();

const std::map<std::string, Knows>& Known() {
  static const std::map<std::string, Knows> known = {{"take_bottle", TakeBottle},
                                                     {"take_bottle_two_arms", TakeBottleTwoArms},
                                                     {"take_toast", TakeToast},
                                                     {"take_ham", TakeHam},
                                                     {"take_lettuce", TakeLettuce}};
  return known;
}

}  // namespace

bool HasKnowledgeOf(const std::string& task_id) { return Known().contains(task_id); }

PickKnowledge KnowledgeOf(const std::string& task_id) {
  if (HasKnowledgeOf(task_id)) return Known().at(task_id)();
  throw InvalidInput(
      "visual_pick: found task {}, wanted take_bottle, take_bottle_two_arms, take_toast, take_ham or take_lettuce",
      task_id);
}

}  // namespace evac
