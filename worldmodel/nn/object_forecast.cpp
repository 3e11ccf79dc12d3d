#include "worldmodel/nn/object_forecast.h"

#include <ATen/ops/conv2d.h>
#include <ATen/ops/eye.h>
#include <ATen/ops/linalg_solve.h>
#include <ATen/ops/linalg_vector_norm.h>
#include <ATen/ops/linear.h>

#include "worldmodel/nn/carried_frame.h"
#include "worldmodel/nn/frame_actions.h"
#include "worldmodel/nn/hand_views.h"
#include "worldmodel/nn/layers.h"

namespace evac::nn {
namespace {

constexpr std::int64_t kHandsSeen = kHands, kKinds = kTurnKinds, kNumbers = kTurnNumbers, kPose = kHandNumbers;
constexpr std::int64_t kMoments = 1 + kKinds;  // of a hand: now, when it closed, when it opened
constexpr std::int64_t kEye = 64, kWide = 256;
constexpr std::int64_t kToThing = 9, kFoundNumbers = 3, kOfAStep = 4;
constexpr std::int64_t kWay = static_cast<std::int64_t>(kTurnMoments.size()) - 1;  // moments about a turn
constexpr std::int64_t kPictureChannels = 6;  // colours; x, y; which view

std::int64_t SeenOfAHand(const ModelConfig& config) { return config.views * kHandPoints * kHandPointNumbers; }

std::int64_t KnownOfAHand(const ModelConfig& config) {
  return kMoments * kEye + kKinds * (kTurnFeatures + kWay * kOfAStep) + kHandPoseNumbers + kMoments * kToThing +
         config.views * kFoundNumbers;
}

/// As of each hand that let go longer ago than that it was then: nothing has changed since.
ObjectForecast::Scenes Settled(const ObjectForecast::Scenes& scenes) {
  constexpr std::int64_t kOpening = 1, kLast = static_cast<std::int64_t>(kTurnMoments.size()) - 1;
  constexpr double kSettled = kTurnMoments.back();
  const Tensor turns = scenes.turns.to(at::kFloat).unflatten(2, {kHandsSeen, kKinds, kNumbers});
  const Tensor was = turns.select(4, 0) > 0, since = turns.select(4, 1);  // [B, T, hands, kinds]
  const Tensor opened = was.select(3, kOpening), closed = was.select(3, 0);
  const Tensor is_open = opened.logical_and(
      closed.logical_not().logical_or(since.select(3, kOpening) < since.select(3, 0)));
  const Tensor late = (since.select(3, kOpening) - kSettled).clamp_min(0) * is_open.to(at::kFloat);  // [B, T, hands]
  const Tensor then = turns.select(3, kOpening).narrow(3, 2 + kLast * kPose, kPose);
  const Tensor hands = scenes.arms.to(at::kFloat).unflatten(2, {kHandsSeen, kPose});
  ObjectForecast::Scenes settled = scenes;
  settled.arms = at::where(late.unsqueeze(3) > 0, then, hands).flatten(2);
  settled.turns = at::cat({turns.narrow(4, 0, 1), (since - late.unsqueeze(3)).unsqueeze(4) * turns.narrow(4, 0, 1),
                           turns.narrow(4, 2, kNumbers - 2)}, 4).flatten(2);
  return settled;
}

/// [B, T, hands, kKinds kWay kOfAStep]: how each hand came to its turns and went on, in the axes it had there, and how
/// closed it was against then.
Tensor WaysAboutTurns(const Tensor& turns) {
  const Tensor hands = turns.narrow(4, 2, (kWay + 1) * kPose).unflatten(4, {kWay + 1, kPose});
  const Tensor then = hands.narrow(4, 0, 1), others = hands.narrow(4, 1, kWay);
  const Tensor moved_m = others.narrow(5, 0, 3) - then.narrow(5, 0, 3);  // [B, T, hands, kinds, kWay, 3]
  const Tensor in_hand_m = at::matmul(moved_m, HandRotation(then.squeeze(4)).transpose(4, 5));
  constexpr double kPer_m = 20, kClosed = 120;
  const Tensor closed = (others.narrow(5, kPose - 1, 1) - then.narrow(5, kPose - 1, 1)) / kClosed;
  return (at::cat({in_hand_m * kPer_m, closed}, 5) * turns.narrow(4, 0, 1).unsqueeze(5)).flatten(3);
}

}  // namespace

ObjectForecast::Layer::Layer(const Scope& at, std::vector<std::int64_t> shape)
    : weight(Precise(at.Take("weight", shape))), bias(Precise(at.Take("bias", {shape[0]}))) {}

ObjectForecast::ObjectForecast(const Scope& at, const ModelConfig& config)
    : views_(config.views),
      height_(config.LatentHeight()),
      width_(config.LatentWidth()),
      stride_(config.vae.Stride()),
      plane_m_(config.schedule.carry_plane_m.value_or(0)),
      tool_length_m_(config.pose_map.tool_length_m),
      finder_{{at / "finder" / 0, {24, kPictureChannels, 5, 5}}, {at / "finder" / 1, {32, 24, 3, 3}},
              {at / "finder" / 2, {48, 32, 3, 3}},               {at / "finder" / 3, {48, 48, 3, 3}},
              {at / "finder" / 4, {48, 48, 3, 3}},               {at / "finder" / 5, {48, 48, 3, 3}},
              {at / "finder" / 6, {2, 48, 1, 1}}},
      eye_(at / "eye", {kEye, SeenOfAHand(config)}),
      hand_(at / "hand", {kWide, KnownOfAHand(config)}),
      both_(at / "both", {kWide, kWide}),
      ends_(at / "ends", {kEnds, kWide}),
      places_(at / "places", {config.views * kEnds * (height_ * width_ + 1), kWide}),
      success_(at / "success", {kEnds, kWide}) {}

ObjectForecast::Found ObjectForecast::Find(const Tensor& image) const {
  const std::int64_t rows = image.size(0), height = image.size(2), width = image.size(3);
  const auto options = image.options().dtype(at::kFloat);
  const auto along = [&](std::int64_t side, at::IntArrayRef shape) {
    return at::linspace(-1, 1, side, options).reshape(shape).expand({rows, 1, height, width});
  };
  const Tensor view = (at::arange(rows, options).remainder(static_cast<double>(views_)) /
                       static_cast<double>(std::max<std::int64_t>(1, views_ - 1)))
                          .reshape({rows, 1, 1, 1})
                          .expand({rows, 1, height, width});
  Tensor x = at::cat({image.to(at::kFloat), along(width, {1, 1, 1, width}), along(height, {1, 1, height, 1}), view}, 1);
  for (std::size_t i = 0; i < finder_.size(); ++i) {
    const std::int64_t stride = i < 2 ? 2 : 1, padding = finder_[i].weight.size(2) / 2;
    x = at::conv2d(x, finder_[i].weight, finder_[i].bias, stride, padding);
    if (i + 1 < finder_.size()) x = at::silu(x);
  }
  const Tensor scores = x.select(1, 0).flatten(1), shares = scores.softmax(1).unflatten(1, {x.size(2), x.size(3)});
  const double places_per_cell = static_cast<double>(kCell_px) / static_cast<double>(stride_);
  const auto middle = [&](std::int64_t over, std::int64_t side) {
    const Tensor cells = at::arange(side, options);
    return ((shares.sum(over) * cells).sum(1) + 0.5) * places_per_cell - 0.5;
  };
  return {scores, at::stack({middle(1, x.size(3)), middle(2, x.size(2))}, 1), x.select(1, 1).flatten(1).logsumexp(1)};
}

/// [B, T, hands, kMoments kToThing + V kFoundNumbers]: where the thing lay, from each hand now and at its turns.
Tensor ObjectForecast::AboutThing(const Found& found, const Scenes& scenes) const {
  const std::int64_t scene_count = scenes.arms.size(0), frames = scenes.arms.size(1);
  const Tensor sure = found.seen.detach().sigmoid(), place = found.place.detach();
  const Tensor thing = PointSeenAt(place, sure, scenes.direction, scenes.origin, views_, plane_m_)
                           .to(at::kFloat)
                           .reshape({scene_count, 1, 1, 1, 3});
  const Tensor turns = scenes.turns.to(at::kFloat).unflatten(2, {kHandsSeen, kKinds, kNumbers});
  const Tensor now = scenes.arms.to(at::kFloat).unflatten(2, {kHandsSeen, 1, kPose});
  const Tensor hands = at::cat({now, turns.narrow(4, 2, kPose)}, 3);  // [B, T, hands, kMoments, 8]
  const Tensor was = at::cat({at::ones_like(now.narrow(4, 0, 1)), turns.narrow(4, 0, 1)}, 3);
  const Tensor away_m = thing - Fingertips(hands, tool_length_m_);
  const Tensor in_hand_m = at::matmul(HandRotation(hands), away_m.unsqueeze(5)).squeeze(5);
  constexpr double kPer_m = 10, kNearPer_m = 25;
  const Tensor to_thing = at::cat({away_m * kPer_m, in_hand_m * kPer_m, (in_hand_m * kNearPer_m).tanh()}, 4) * was;
  const Tensor size = at::tensor({static_cast<float>(width_), static_cast<float>(height_)}).to(place.device());
  const Tensor said = at::cat({(place + 0.5) * 2 / size - 1, found.seen.detach().tanh().unsqueeze(1)}, 1)
                          .reshape({scene_count, 1, 1, views_ * kFoundNumbers})
                          .expand({scene_count, frames, kHandsSeen, views_ * kFoundNumbers});
  return at::cat({to_thing.flatten(3), said}, 3);
}

ObjectForecast::Answer ObjectForecast::operator()(const Scenes& given, const Drop& drop) const {
  CheckShape("arms of the frames", given.arms, {-1, -1, kHandsSeen * kPose});
  CheckShape("turns of the hands", given.turns, {given.arms.size(0), given.arms.size(1), static_cast<std::int64_t>(kTurnRow)});
  const Scenes scenes = Settled(given);
  const std::int64_t scene_count = scenes.arms.size(0), frames = scenes.arms.size(1);
  CheckShape("the picture in which the thing is found", scenes.image,
             {scene_count * views_, 3, height_ * stride_, width_ * stride_});
  const auto left_out = [&](const Tensor& x) { return drop ? drop(x) : x; };
  const auto through = [](const Layer& layer, const Tensor& x) { return at::linear(x, layer.weight, layer.bias); };
  const Found found = Find(scenes.image);
  const std::int64_t seen_numbers = eye_.weight.size(1);
  const Tensor now = HandViews(scenes.image, scenes.direction, scenes.origin, scenes.arms, tool_length_m_).unsqueeze(3);
  const Tensor turns = TurnViews(scenes.image, scenes.direction, scenes.origin, scenes.arms, scenes.turns, tool_length_m_);
  const Tensor seen = at::cat({now, turns.narrow(4, 0, seen_numbers)}, 3);
  const Tensor known = at::cat({left_out(at::silu(through(eye_, seen))).flatten(3),
                                turns.narrow(4, seen_numbers, kTurnFeatures).flatten(3),
                                WaysAboutTurns(scenes.turns.to(at::kFloat).unflatten(2, {kHandsSeen, kKinds, kNumbers})),
                                HandPoses(FrameActions(scenes.arms, 1)), AboutThing(found, scenes)},
                               3);
  const Tensor hands = left_out(at::silu(through(hand_, known))).sum(2);
  const Tensor both = left_out(at::silu(through(both_, hands)));
  const Tensor places = through(places_, both)
                            .reshape({scene_count, frames, views_, kEnds, height_ * width_ + 1})
                            .transpose(1, 2)
                            .flatten(0, 1);
  return {found, through(ends_, both), places, through(success_, both)};
}

Tensor ObjectForecast::Answer::Done() const { return (ends.softmax(2) * success.sigmoid()).sum(2); }

Tensor ObjectForecast::MapsOf(const Answer& answer, const Tensor& end) const {
  const Tensor places = answer.places.softmax(3).narrow(3, 0, height_ * width_);
  const Tensor of_view = end.repeat_interleave(views_, 0);  // [BV, T]
  const Tensor one = of_view.reshape({of_view.size(0), of_view.size(1), 1, 1}).expand({-1, -1, 1, places.size(3)});
  return places.gather(2, one).squeeze(2).unflatten(2, {height_, width_}).unsqueeze(1);
}

Tensor ObjectForecast::Maps(const Scenes& scenes) const {
  const at::NoGradGuard no_gradients;
  const Answer answer = (*this)(scenes);
  return MapsOf(answer, LikeliestEnd(answer, views_));
}

Tensor LikeliestEnd(const ObjectForecast::Answer& answer, std::int64_t views) {
  const Tensor root = (answer.places.log_softmax(3) / 2).exp();                      // [BV, T, ends, cells]
  const Tensor alike = at::matmul(root, root.transpose(2, 3)).clamp_min(1e-12);      // 1: the same places
  const Tensor in_all = alike.log().unflatten(0, {-1, views}).sum(1).exp();          // [B, T, ends, ends]
  return at::matmul(in_all, answer.ends.softmax(2).unsqueeze(3)).squeeze(3).argmax(2);
}

Tensor PointSeenAt(const Tensor& places, const Tensor& sure, const Tensor& direction, const Tensor& origin,
                   std::int64_t views, double plane_m) {
  constexpr double kLeastSure = 1e-4, kPlane = 0.005;  // a pixel is millimetres, the plane is known to centimetres
  const Tensor rays = RaysThrough(places, direction, 0);  // [BV, 3]
  const Tensor unit = (rays / at::linalg_vector_norm(rays, 2, at::IntArrayRef{1}, true)).unsqueeze(2);
  const Tensor camera = origin.select(2, 0).select(3, 0).select(2, 0).to(at::kDouble).unsqueeze(2);
  const Tensor one = at::eye(3, rays.options());
  const Tensor across = (one - at::matmul(unit, unit.transpose(1, 2))) *
                        sure.to(at::kDouble).clamp_min(kLeastSure).reshape({-1, 1, 1});
  const Tensor up = one.narrow(0, 2, 1).transpose(0, 1);  // [3, 1]
  const auto of_scene = [&](const Tensor& each) { return each.unflatten(0, {-1, views}).sum(1); };
  const Tensor left = of_scene(across) + kPlane * at::matmul(up, up.transpose(0, 1));
  const Tensor right = of_scene(at::matmul(across, camera)) + kPlane * plane_m * up;
  return at::linalg_solve(left, right).squeeze(2);
}

}  // namespace evac::nn
