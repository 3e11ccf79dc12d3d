#pragma once

#include <ATen/core/Tensor.h>

#include <cstdint>
#include <functional>
#include <string>
#include <vector>

namespace evac {

/// Where a network gets its parameters from: it asks once for each, by key and shape, when it is made.
using TakeParameter = std::function<at::Tensor(const std::string& key, const std::vector<std::int64_t>& shape)>;

/// What a learned policy can do.
struct LearnedShape {
  std::vector<std::string> tasks, cameras;
  std::vector<std::string> arms = {"right"};
  int height_px = 64, width_px = 96;  ///< of a picture as the network sees it, multiples of 8
};

/// How many targets it answers at once.
inline constexpr std::int64_t kLearnedChunk = 16;
/// An arm as numbers: xyz (metres, base frame), the first two columns of its rotation, closure.
inline constexpr std::int64_t kArmNumbers = 10;

/// B moments of V views and A arms.
struct LearnedInput {
  at::Tensor pictures;  ///< [B, V, H, W, 3] RGB in [-1, 1]
  at::Tensor rays;  ///< [B, V, 3, 3]: (x, y in parts of the picture, 1) → the direction of that pixel's ray, base frame
  at::Tensor eyes;     ///< [B, V, 3] where the cameras are, metres, base frame
  at::Tensor arms;     ///< [B, A, kArmNumbers] where the arms were told to be by now
  at::Tensor grasped;  ///< [B, A] 1 once that hand was told to close, 0 before
  at::Tensor task;     ///< [B] long, index into LearnedShape::tasks
};

struct LearnedOutput {
  at::Tensor targets;  ///< [B, kLearnedChunk, A, kArmNumbers]: absolute; rotation columns as the network says them
  at::Tensor object;   ///< [B, V, 2] where its first point lies: x, y in parts of the picture. Trained to be the object
};

/// Answers pictures and arms with a chunk of targets, in one pass (after ACT, Zhao et al. 2023, with points in the
/// place of patches). Each view is searched for a handful of points that matter to the task (softmax over places, Finn
/// et al. 2016); each point is told as pixels and as the place on the table that its ray meets, so that where a thing
/// is need not be learned for every pose of a moving camera.
class LearnedNet {
 public:
  LearnedNet(const LearnedShape& shape, const TakeParameter& take);
  LearnedOutput operator()(const LearnedInput& input) const;

 private:
  struct Convolution {
    at::Tensor weight, bias;
    std::int64_t stride = 1;
    at::Tensor operator()(const at::Tensor& x) const;
  };
  struct Dense {
    at::Tensor weight, bias;
    at::Tensor operator()(const at::Tensor& x) const;
  };
  struct View {
    Convolution patches, near, down, far, up, mixed, nudges, what;
    at::Tensor task;    ///< [tasks, C] what each task adds to the last features
    at::Tensor points;  ///< [tasks, points * C] which features each point of each task looks for
  };
  struct Seen {
    at::Tensor places;    ///< [B, points, 2] x, y in parts of the picture
    at::Tensor features;  ///< [B, …] what is there, and a look at the whole
  };
  Seen Look(const View& view, const at::Tensor& pictures, const at::Tensor& task) const;

  std::int64_t arms_;
  std::vector<View> views_;
  at::Tensor task_;  ///< [tasks, …]
  Dense first_, second_, third_, out_;
};

}  // namespace evac
