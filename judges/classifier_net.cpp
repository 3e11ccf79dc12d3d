#include "judges/classifier_net.h"

#include <ATen/TensorOperators.h>
#include <ATen/ops/arange.h>
#include <ATen/ops/cat.h>
#include <ATen/ops/conv2d.h>
#include <ATen/ops/linear.h>
#include <ATen/ops/relu.h>
#include <ATen/ops/softmax.h>
#include <ATen/ops/stack.h>

namespace evac {
namespace {

constexpr std::int64_t kPatch = 4;             // pixels; the first layer sees squares of them
constexpr std::int64_t kNear = 24, kFar = 48;  // channels at a quarter and at an eighth of the picture's size
constexpr std::int64_t kWhat = 16;             // of what is kept of a place
constexpr std::int64_t kCoarse = 48;           // of the look at the whole
constexpr std::int64_t kTask = 8, kHidden = 96;

/// [N, H, W, 3] → [N, 3 p², H / p, W / p], a square of pixels per place; channels lie last in memory.
at::Tensor Patches(const at::Tensor& pictures) {
  const std::int64_t n = pictures.size(0), h = pictures.size(1) / kPatch, w = pictures.size(2) / kPatch;
  return pictures.reshape({n, h, kPatch, w, kPatch, 3})
      .permute({0, 1, 3, 2, 4, 5})
      .reshape({n, h, w, kPatch * kPatch * 3})
      .permute({0, 3, 1, 2});
}

/// Middles of the places of a map, row by row: [h w, 2], x then y, in parts of the picture.
at::Tensor Places(std::int64_t h, std::int64_t w) {
  const at::Tensor x = (at::arange(w, at::kFloat) + 0.5) / static_cast<double>(w);
  const at::Tensor y = (at::arange(h, at::kFloat) + 0.5) / static_cast<double>(h);
  return at::stack({x.unsqueeze(0).expand({h, w}), y.unsqueeze(1).expand({h, w})}, -1).reshape({h * w, 2});
}

/// The first look has the plain name: files of one look have no other.
std::string LookKey(const char* name, std::int64_t look) {
  return std::string(name) + (look == 0 ? "" : std::to_string(look)) + ".embedding";
}

}  // namespace

ClassifierColumns ColumnsOfAView() { return {kClassifierFrames * (2 + kWhat), kCoarse}; }

at::Tensor ClassifierNet::Convolution::operator()(const at::Tensor& x) const {
  const std::int64_t padding = weight.size(2) / 2;
  return at::conv2d(x, weight, bias, stride, padding);
}

ClassifierNet::ClassifierNet(const ClassifierShape& shape, const TakeParameter& take) {
  const auto tasks = static_cast<std::int64_t>(shape.tasks.size());
  for (const std::string& camera : shape.cameras) {
    const std::string at = "views." + camera + ".";
    const auto convolution = [&](const char* name, const std::vector<std::int64_t>& sizes, std::int64_t stride = 1) {
      return Convolution{take(at + name + ".weight", sizes), take(at + name + ".bias", {sizes[0]}), stride};
    };
    std::vector<at::Tensor> where;
    for (std::int64_t i = 0; i < shape.looks; ++i) where.push_back(take(at + LookKey("where", i), {tasks, kFar}));
    views_.push_back({convolution("patches", {kNear, kPatch * kPatch * 3, 1, 1}),
                      convolution("near", {kNear, kNear, 3, 3}), convolution("down", {kFar, kNear, 3, 3}, 2),
                      convolution("far", {kFar, kFar, 3, 3}), convolution("nudge", {2 * shape.looks, kFar, 1, 1}),
                      convolution("what", {kWhat, kFar, 1, 1}),
                      convolution("over_time", {kCoarse, kClassifierFrames * kWhat, 3, 3}),
                      convolution("coarse", {kCoarse, kCoarse, 3, 3}, 2), take(at + "task.embedding", {tasks, kFar}),
                      std::move(where)});
  }
  const std::int64_t seen = shape.looks * ColumnsOfAView().look + ColumnsOfAView().whole;
  const auto dense = [&](const std::string& name, std::int64_t in, std::int64_t out) {
    return Dense{take(name + ".weight", {out, in}), take(name + ".bias", {out})};
  };
  task_ = take("task.embedding", {tasks, kTask});
  hidden_ = dense("hidden", seen * static_cast<std::int64_t>(views_.size()) + kTask, kHidden);
  out_ = dense("out", kHidden, 1);
}

ClassifierNet::Seen ClassifierNet::Look(const View& view, const at::Tensor& pictures, const at::Tensor& task) const {
  const std::int64_t b = pictures.size(0), t = kClassifierFrames;
  at::Tensor x = at::relu(view.patches(Patches(pictures.flatten(0, 1))));
  x = at::relu(x + view.near(x));
  x = at::relu(view.down(x));
  const at::Tensor of_task = view.task.index_select(0, task).repeat_interleave(t, 0);  // [B T, C]
  x = at::relu(view.far(x) + of_task.unsqueeze(-1).unsqueeze(-1));                     // [B T, C, h, w]
  const std::int64_t h = x.size(2), w = x.size(3);
  const at::Tensor nudges = view.nudge(x).flatten(2).transpose(1, 2) * 0.1;  // [B T, h w, 2 looks]
  const at::Tensor what = view.what(x);                                      // [B T, kWhat, h, w]
  const at::Tensor places = Places(h, w), each = what.flatten(2).transpose(1, 2);
  std::vector<at::Tensor> seen;
  at::Tensor object;
  for (std::size_t i = 0; i < view.where.size(); ++i) {
    const at::Tensor wanted = view.where[i].index_select(0, task).repeat_interleave(t, 0).unsqueeze(-1);  // [B T, C, 1]
    const at::Tensor attention = at::softmax((x.flatten(2) * wanted).sum(1), -1).unsqueeze(-1);           // [B T, h w, 1]
    const at::Tensor nudge = nudges.narrow(2, 2 * static_cast<std::int64_t>(i), 2);
    const at::Tensor place = ((places + nudge) * attention).sum(1).reshape({b, t, 2});
    if (i == 0) object = place;
    seen.push_back(place.flatten(1) * 2 - 1);
    seen.push_back((each * attention).sum(1).reshape({b, t * kWhat}));
  }
  seen.push_back(at::relu(view.coarse(at::relu(view.over_time(what.reshape({b, t * kWhat, h, w}))))).mean({2, 3}));
  return {at::cat(seen, 1), object};
}

ClassifierAnswer ClassifierNet::operator()(const ClassifierClips& clips) const {
  std::vector<at::Tensor> features, objects;
  for (std::size_t v = 0; v < views_.size(); ++v) {
    const auto at = static_cast<std::int64_t>(v);
    const Seen seen = Look(views_[v], clips.pictures.select(1, at), clips.task);
    features.push_back(seen.features * clips.present.select(1, at).unsqueeze(1));
    objects.push_back(seen.object);
  }
  features.push_back(task_.index_select(0, clips.task));
  const at::Tensor hidden = at::relu(at::linear(at::cat(features, 1), hidden_.weight, hidden_.bias));
  return {at::linear(hidden, out_.weight, out_.bias).squeeze(1), at::stack(objects, 1)};
}

}  // namespace evac
