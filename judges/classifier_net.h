#pragma once

#include <ATen/core/Tensor.h>

#include <cstdint>
#include <functional>
#include <string>
#include <vector>

namespace evac {

/// Where a network gets its parameters from: it asks once for each, by key and shape, when it is made.
using TakeParameter = std::function<at::Tensor(const std::string& key, const std::vector<std::int64_t>& shape)>;

/// How many pictures of a clip the classifier looks at, evenly spaced in time, first and last among them.
inline constexpr std::int64_t kClassifierFrames = 8;

/// How many numbers of a view the decision is told, view after view, and behind them the task's.
struct ClassifierColumns {
  std::int64_t look = 0;   ///< of each place that is looked at
  std::int64_t whole = 0;  ///< of the look at the whole, behind those
};
ClassifierColumns ColumnsOfAView();

/// What a classifier can judge.
struct ClassifierShape {
  std::vector<std::string> tasks, cameras;
  int height_px = 64, width_px = 96;  ///< of a picture as the network sees it, multiples of 8
  std::int64_t looks = 1;             ///< places that are looked at in each picture, at least 1
};

/// B clips of V views and T = kClassifierFrames pictures.
struct ClassifierClips {
  at::Tensor pictures;  ///< [B, V, T, H, W, 3] RGB in [-1, 1]
  at::Tensor present;   ///< [B, V] 1, or 0 where the clip has no such view (its pictures may be anything)
  at::Tensor task;      ///< [B] long, index into ClassifierShape::tasks
};

struct ClassifierAnswer {
  at::Tensor logit;   ///< [B] of success, before calibration
  at::Tensor object;  ///< [B, V, T, 2] where it looked first: x, y in parts of the picture. Trained to be the task's object
};

/// Says from eight pictures whether a task was done. Each view has an encoder of its own (four convolutions, to a map
/// an eighth of the picture's size) and places where it looks, found anew in every picture: what is there and where
/// that is, over time, decides, together with a coarse look at the whole. The first place is trained to be the task's
/// object; what the others are (where the object belongs, the hand) is for the training to find.
class ClassifierNet {
 public:
  /// @param shape  with at least one task and one camera
  ClassifierNet(const ClassifierShape& shape, const TakeParameter& take);
  ClassifierAnswer operator()(const ClassifierClips& clips) const;

 private:
  struct Convolution {
    at::Tensor weight, bias;
    std::int64_t stride = 1;
    at::Tensor operator()(const at::Tensor& x) const;
  };
  struct Dense {
    at::Tensor weight, bias;
  };
  struct View {
    Convolution patches, near, down, far, nudge, what, over_time, coarse;
    at::Tensor task;   ///< [tasks, C] what each task adds to the encoder's last features
    std::vector<at::Tensor> where;  ///< of each look [tasks, C]: which features each task looks for
  };
  struct Seen {
    at::Tensor features;  ///< [B, …]
    at::Tensor object;    ///< [B, T, 2] of the first look
  };
  Seen Look(const View& view, const at::Tensor& pictures, const at::Tensor& task) const;

  std::vector<View> views_;
  at::Tensor task_;  ///< [tasks, …] what the decision is told of the task
  Dense hidden_, out_;
};

}  // namespace evac
