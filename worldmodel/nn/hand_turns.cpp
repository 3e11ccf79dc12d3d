#include "worldmodel/nn/hand_turns.h"

#include <algorithm>
#include <array>
#include <optional>

namespace evac::nn {
namespace {

constexpr std::size_t kRow = kHands * kHandNumbers;

/// [hand][kind]: the frame of the last turn.
using LastTurns = std::array<std::array<std::optional<std::size_t>, kTurnKinds>, kHands>;

std::vector<LastTurns> LastTurnsOf(std::span<const float> rows) {
  std::vector<LastTurns> turns(rows.size() / kRow);
  for (std::size_t frame = 1; frame < turns.size(); ++frame) {
    turns[frame] = turns[frame - 1];
    for (std::size_t hand = 0; hand < kHands; ++hand) {
      const std::size_t gripper = hand * kHandNumbers + kHandNumbers - 1;
      const bool is_closed = IsClosed(rows[frame * kRow + gripper]),
                 was_closed = IsClosed(rows[(frame - 1) * kRow + gripper]);
      if (is_closed != was_closed) turns[frame][hand][is_closed ? 0 : 1] = frame;
    }
  }
  return turns;
}

}  // namespace

std::vector<float> HandTurns(std::span<const float> rows, std::span<const std::size_t> frames) {
  const std::vector<LastTurns> last = LastTurnsOf(rows);
  std::vector<float> numbers(frames.size() * kTurnRow);
  for (std::size_t t = 0; t < frames.size(); ++t) {
    for (std::size_t hand = 0; hand < kHands; ++hand) {
      for (std::size_t kind = 0; kind < kTurnKinds; ++kind) {
        const std::optional<std::size_t> turn = last.at(frames[t])[hand][kind];
        if (!turn) continue;
        float* at = &numbers[((t * kHands + hand) * kTurnKinds + kind) * kTurnNumbers];
        at[0] = 1;
        at[1] = static_cast<float>(frames[t] - *turn);
        for (std::size_t moment = 0; moment < kTurnMoments.size(); ++moment) {
          const auto frame = std::clamp<std::ptrdiff_t>(static_cast<std::ptrdiff_t>(*turn) + kTurnMoments[moment], 0,
                                                        static_cast<std::ptrdiff_t>(frames[t]));
          const auto hand_then =
              rows.subspan(static_cast<std::size_t>(frame) * kRow + hand * kHandNumbers, kHandNumbers);
          std::ranges::copy(hand_then, at + 2 + moment * kHandNumbers);
        }
      }
    }
  }
  return numbers;
}

}  // namespace evac::nn
