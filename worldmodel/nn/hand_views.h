#pragma once

#include "worldmodel/nn/hand_turns.h"
#include "worldmodel/nn/tensor.h"

/// What the first picture shows about each hand, frame by frame, for networks that are told (`unet.hand_views`). Not in
/// the paper, whose network sees poses as pictures and has to compare places in two of them: whether the fingers close
/// about a thing or beside it is a matter of millimetres, a tenth of a latent. Here the picture is read where the hand
/// will be, in the hand's own axes, so that a grasp looks the same wherever it is done.
namespace evac::nn {

/// Points about a fingertip: in each of the three planes of the hand's axes 7x7 every 12 mm and 5x5 every 40 mm.
constexpr std::int64_t kHandPoints = 3 * (7 * 7 + 5 * 5);
constexpr std::int64_t kHandPointNumbers = 4;  ///< red, green, blue; 1 where the picture shows the point

/// @param image      [BV, 3, H, W] in [-1, 1]: what the cameras of frame 0 saw
/// @param direction  [BV, 3, T, h, w] unit rays of pinhole cameras, base frame
/// @param origin     [BV, 3, T, h, w] metres, base frame
/// @param arms       [B, T, 16]: rows as in frame_actions.h
/// @param tool_length_m  from an arm's pose along its z axis to where the fingers meet (`pose_map.tool_length_m`)
/// @returns          [B, T, 2, V kHandPoints kHandPointNumbers]: left hand, right hand; 0 where the picture does not reach
Tensor HandViews(const Tensor& image, const Tensor& direction, const Tensor& origin, const Tensor& arms,
                 double tool_length_m);

/// Where the fingers meet. @param hands  [..., 8]: rows of one arm each @returns [..., 3] metres, base frame
Tensor Fingertips(const Tensor& hands, double tool_length_m);

/// Beside the pictures of a turn: whether there was one; how long ago, slowly and quickly forgotten; where the hand is
/// now, seen from there, in that hand's axes and in the base frame; how it is turned against then; how it moved then.
constexpr std::int64_t kTurnFeatures = 1 + 2 + 3 + 3 + 6 + 3;

/// The same where each hand last closed, and where it last opened (`object_forecast`).
/// @param turns  [B, T, kTurnRow]: HandTurns
/// @returns      [B, T, 2, kTurnKinds, V kHandPoints kHandPointNumbers + kTurnFeatures]: zeros where there was no turn
Tensor TurnViews(const Tensor& image, const Tensor& direction, const Tensor& origin, const Tensor& arms,
                 const Tensor& turns, double tool_length_m);

}  // namespace evac::nn
