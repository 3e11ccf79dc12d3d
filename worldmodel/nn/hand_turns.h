#pragma once

#include <array>
#include <cstddef>
#include <span>
#include <vector>

/// When each hand was last told to close, and to open again, and where it was then: what its fingers closed about, and
/// where they let it go. A chunk's memory shows that in the pictures, and of a rollout those are imagined, softer with
/// every chunk; what was told is known to the end. No tensors here: worlds keep it beside their scenes.
namespace evac::nn {

constexpr std::size_t kHands = 2, kHandNumbers = 8;  ///< of an arms row (frame_actions.h): left, right
constexpr std::size_t kTurnKinds = 2;                ///< closing, opening
/// Frames, counted from a turn, whose hand is told: then, the one before, how it came there and how it went on. Before
/// frame 0 it is where it was in that; what lies behind the frame that is asked about is not told, it is as there.
constexpr std::array<int, 11> kTurnMoments = {0, -1, -4, -2, 1, 2, 3, 4, 6, 8, 24};
/// 1 if there was one, frames since; the hand at each of the moments.
constexpr std::size_t kTurnNumbers = 2 + kTurnMoments.size() * kHandNumbers;
constexpr std::size_t kTurnRow = kHands * kTurnKinds * kTurnNumbers;

/// Whether a hand's last number (0 open … 120 closed) is told to be more closed than open.
constexpr bool IsClosed(float gripper) { return gripper > 60; }

/// @param rows    [F, 16]: arms of consecutive frames
/// @param frames  T of them, in any order. @throws std::out_of_range
/// @returns       [T, hand, kind, kTurnNumbers]: the last turn at or before that frame; zeros if there was none since
///                frame 0. Hands that begin closed have not closed.
std::vector<float> HandTurns(std::span<const float> rows, std::span<const std::size_t> frames);

}  // namespace evac::nn
