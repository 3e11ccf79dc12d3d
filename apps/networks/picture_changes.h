#pragma once

#include "worldmodel/train/dice.h"

namespace evac {

/// How pictures are changed while a judge or a policy is trained, so that it does not rely on one light or on pictures
/// as sharp as a camera's.
struct PictureChanges {
  double light = 0.15;          ///< each colour's gain is within 1 ± this, each sample's own
  double offset = 0.08;         ///< what is added to each colour, of [-1, 1]: within ± this
  double blur_share = 0.25;     ///< of the samples that are seen as means over 3x3 pixels
  std::int64_t blur_times = 1;  ///< of those, the mean is taken once to so many times, each as often
};

/// @param training  whose they are, for the message
/// @throws TensorError naming the option that is out of range, what was found and what was wanted
void CheckChanges(const char* training, const PictureChanges& changes);

/// @param pictures  [B, …, H, W, 3] in [-1, 1]; all pictures of a sample change alike
at::Tensor Changed(const at::Tensor& pictures, const PictureChanges& changes, train::Dice& dice);

}  // namespace evac
