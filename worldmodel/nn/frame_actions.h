#pragma once

#include "worldmodel/nn/tensor.h"

/// Where the arms are at each frame, for networks that are told frame by frame (`unet.frame_actions`). Not in the paper,
/// whose network sees poses as pictures and their changes as a set of tokens: it has to find out which frame a change
/// belongs to. Small networks that train for hours learn to grasp sooner with it.
namespace evac::nn {

constexpr std::int64_t kFrameActionNumbers = 52;

/// @param quaternion  [..., 4] xyzw, of any length but 0
/// @returns           [..., 6]: where the x and the y axis point
Tensor HandAxes(const Tensor& quaternion);

/// @param hand  [..., 8]: xyz (m), quaternion xyzw, gripper
/// @returns     [..., 3, 3]: rows are the hand's x, y and z in the base frame
Tensor HandRotation(const Tensor& hand);

/// Per arm: position, the first two columns of its rotation, closure; position and closure counted from the newest
/// memory frame; waves of the position of .25 m and .0625 m.
/// @param rows    [B, T, 16]: left xyz (m), quaternion xyzw, gripper (0 open … 120 closed), then right; base frame
/// @param memory  N: the newest is row N - 1
/// @returns       [B, T, kFrameActionNumbers], of the order of 1
Tensor FrameActions(const Tensor& rows, std::int64_t memory);

/// What FrameActions say of each hand by itself, without what is counted from the memory.
/// @param frames  [B, T, kFrameActionNumbers]
/// @returns       [B, T, 2, kHandPoseNumbers]: left, right
constexpr std::int64_t kHandPoseNumbers = 22;
Tensor HandPoses(const Tensor& frames);

}  // namespace evac::nn
