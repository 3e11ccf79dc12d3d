#include "policies/learned_net.h"

#include <ATen/TensorOperators.h>
#include <ATen/ops/arange.h>
#include <ATen/ops/cat.h>
#include <ATen/ops/conv2d.h>
#include <ATen/ops/linear.h>
#include <ATen/ops/matmul.h>
#include <ATen/ops/ones_like.h>
#include <ATen/ops/relu.h>
#include <ATen/ops/softmax.h>
#include <ATen/ops/stack.h>

namespace evac {
namespace {

constexpr std::int64_t kPatch = 4;              // pixels; the first layer sees squares of them
constexpr std::int64_t kNear = 24, kFar = 48;   // channels at a quarter and at an eighth of the picture's size
constexpr std::int64_t kPoints = 6, kWhat = 8;  // points per view, and what is kept of each
constexpr std::int64_t kPlace = 6;              // numbers that say where a point is
constexpr std::int64_t kTask = 16, kHidden = 256;
constexpr double kReach_m = 0.1;    // what a target's distance from the arm is measured in
constexpr double kSteepest = 0.15;  // a ray that goes down less than this per length meets the table too far away

/// [N, H, W, 3] → [N, 3 p², H / p, W / p], a square of pixels per place; channels lie last in memory.
at::Tensor Patches(const at::Tensor& pictures) {
  const std::int64_t n = pictures.size(0), h = pictures.size(1) / kPatch, w = pictures.size(2) / kPatch;
  return pictures.reshape({n, h, kPatch, w, kPatch, 3})
      .permute({0, 1, 3, 2, 4, 5})
      .reshape({n, h, w, kPatch * kPatch * 3})
      .permute({0, 3, 1, 2});
}

/// Each place four times: [N, C, h, w] → [N, C, 2h, 2w], channels last in memory.
at::Tensor Doubled(const at::Tensor& x) {
  const at::Tensor rows = x.permute({0, 2, 3, 1});
  const std::int64_t n = rows.size(0), h = rows.size(1), w = rows.size(2), c = rows.size(3);
  return rows.reshape({n, h, 1, w, 1, c})
      .expand({n, h, 2, w, 2, c})
      .reshape({n, 2 * h, 2 * w, c})
      .permute({0, 3, 1, 2});
}

/// Middles of the places of a map, row by row: [h w, 2], x then y, in parts of the picture.
at::Tensor Places(std::int64_t h, std::int64_t w) {
  const at::Tensor x = (at::arange(w, at::kFloat) + 0.5) / static_cast<double>(w);
  const at::Tensor y = (at::arange(h, at::kFloat) + 0.5) / static_cast<double>(h);
  return at::stack({x.unsqueeze(0).expand({h, w}), y.unsqueeze(1).expand({h, w})}, -1).reshape({h * w, 2});
}

/// Where the rays of points meet the table (z = 0), metres, base frame.
/// @param places  [B, P, 2] in parts of the picture. @param rays  [B, 3, 3]. @param eyes  [B, 3]. @returns [B, P, 2]
at::Tensor OnTable(const at::Tensor& places, const at::Tensor& rays, const at::Tensor& eyes) {
  const at::Tensor one = at::ones_like(places.narrow(-1, 0, 1));
  at::Tensor direction = at::matmul(at::cat({places, one}, -1), rays.transpose(1, 2));  // [B, P, 3]
  direction = direction / direction.square().sum(-1, true).sqrt();
  const at::Tensor down = (-direction.narrow(-1, 2, 1)).clamp_min(kSteepest);
  const at::Tensor height = eyes.narrow(-1, 2, 1).unsqueeze(1);  // [B, 1, 1]
  return eyes.narrow(-1, 0, 2).unsqueeze(1) + direction.narrow(-1, 0, 2) * (height / down);
}

}  // namespace

at::Tensor LearnedNet::Convolution::operator()(const at::Tensor& x) const {
  return at::conv2d(x, weight, bias, stride, weight.size(2) / 2);
}

at::Tensor LearnedNet::Dense::operator()(const at::Tensor& x) const { return at::linear(x, weight, bias); }

LearnedNet::LearnedNet(const LearnedShape& shape, const TakeParameter& take)
    : arms_(static_cast<std::int64_t>(shape.arms.size())) {
  const auto tasks = static_cast<std::int64_t>(shape.tasks.size());
  for (const std::string& camera : shape.cameras) {
    const std::string at = "views." + camera + ".";
    const auto convolution = [&](const char* name, const std::vector<std::int64_t>& sizes, std::int64_t stride = 1) {
      return Convolution{take(at + name + ".weight", sizes), take(at + name + ".bias", {sizes[0]}), stride};
    };
    views_.push_back({convolution("patches", {kNear, kPatch * kPatch * 3, 1, 1}),
                      convolution("near", {kNear, kNear, 3, 3}), convolution("down", {kFar, kNear, 3, 3}, 2),
                      convolution("far", {kFar, kFar, 3, 3}), convolution("up", {kNear, kFar, 1, 1}),
                      convolution("mixed", {kNear, kNear, 3, 3}), convolution("nudges", {2 * kPoints, kNear, 1, 1}),
                      convolution("what", {kWhat, kNear, 1, 1}), take(at + "task.embedding", {tasks, kNear}),
                      take(at + "points.embedding", {tasks, kPoints * kNear})});
  }
  const auto dense = [&](const std::string& name, std::int64_t in, std::int64_t out) {
    return Dense{take(name + ".weight", {out, in}), take(name + ".bias", {out})};
  };
  const std::int64_t seen = kPoints * (kPlace + kWhat) + kFar;
  const std::int64_t known = static_cast<std::int64_t>(views_.size()) * seen + arms_ * (kArmNumbers + 1) + kTask;
  task_ = take("task.embedding", {tasks, kTask});
  first_ = dense("first", known, kHidden);
  second_ = dense("second", kHidden, kHidden);
  third_ = dense("third", kHidden, kHidden);
  out_ = dense("out", kHidden, kLearnedChunk * arms_ * kArmNumbers);
}

LearnedNet::Seen LearnedNet::Look(const View& view, const at::Tensor& pictures, const at::Tensor& task) const {
  const std::int64_t b = pictures.size(0);
  at::Tensor near = at::relu(view.patches(Patches(pictures)));
  near = at::relu(near + view.near(near));
  const at::Tensor far = at::relu(view.far(at::relu(view.down(near))));  // [B, kFar, h / 8, w / 8]
  const at::Tensor of_task = view.task.index_select(0, task).unsqueeze(-1).unsqueeze(-1);
  near = at::relu(near + view.up(Doubled(far)) + of_task);
  near = at::relu(near + view.mixed(near));  // [B, kNear, h / 4, w / 4]
  const std::int64_t h = near.size(2), w = near.size(3);
  const at::Tensor wanted = view.points.index_select(0, task).reshape({b, kPoints, kNear});
  const at::Tensor attention = at::softmax(at::matmul(wanted, near.flatten(2)), -1);          // [B, P, h w]
  const at::Tensor nudges = view.nudges(near).reshape({b, kPoints, 2, h * w}) * 0.1;          // [B, P, 2, h w]
  const at::Tensor what = at::matmul(attention, view.what(near).flatten(2).transpose(1, 2));  // [B, P, kWhat]
  const at::Tensor places = at::matmul(attention, Places(h, w)) + (nudges * attention.unsqueeze(2)).sum(-1);
  return {places, at::cat({what.flatten(1), far.mean({2, 3})}, 1)};
}

LearnedOutput LearnedNet::operator()(const LearnedInput& input) const {
  std::vector<at::Tensor> known, objects;
  const at::Tensor gripper_m = input.arms.select(1, arms_ - 1).narrow(1, 0, 2).unsqueeze(1);  // [B, 1, 2]
  for (std::size_t v = 0; v < views_.size(); ++v) {
    const auto at = static_cast<std::int64_t>(v);
    const Seen seen = Look(views_[v], input.pictures.select(1, at), input.task);
    const at::Tensor table_m = OnTable(seen.places, input.rays.select(1, at), input.eyes.select(1, at)).clamp(-2, 2);
    known.push_back(at::cat({seen.places * 2 - 1, table_m * 4, (table_m - gripper_m) * 8}, -1).flatten(1));
    known.push_back(seen.features);
    objects.push_back(seen.places.select(1, 0));
  }
  const at::Tensor xyz_m = input.arms.narrow(-1, 0, 3), rest = input.arms.narrow(-1, 3, kArmNumbers - 3);
  known.insert(known.end(),
               {(xyz_m * 4).flatten(1), rest.flatten(1), input.grasped, task_.index_select(0, input.task)});
  at::Tensor x = at::relu(first_(at::cat(known, 1)));
  x = x + at::relu(second_(x));
  x = x + at::relu(third_(x));
  const at::Tensor steps = out_(x).reshape({x.size(0), kLearnedChunk, arms_, kArmNumbers});
  const at::Tensor now = input.arms.unsqueeze(1);
  const at::Tensor to_m = now.narrow(-1, 0, 3) + steps.narrow(-1, 0, 3) * kReach_m;
  const at::Tensor turn = now.narrow(-1, 3, 6) + steps.narrow(-1, 3, 6);
  return {at::cat({to_m, turn, steps.narrow(-1, 9, 1)}, -1), at::stack(objects, 1)};
}

}  // namespace evac
