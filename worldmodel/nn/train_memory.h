#pragma once

#include <cstdint>

#include "worldmodel/nn/train_kernels.h"

/// How training's loops read and write values of either type.
namespace evac::nn::kernels {

void FromBf16(std::int64_t count, const std::uint16_t* from, float* to);
/// To the nearest, ties to even.
void ToBf16(std::int64_t count, const float* from, std::uint16_t* to);

/// `count` values from the `first` on, as floats: where they lie, or copied to `room`.
inline const float* Read(const Values& values, std::int64_t first, std::int64_t count, float* room) {
  if (!values.bf16) return static_cast<const float*>(values.at) + first;
  FromBf16(count, static_cast<const std::uint16_t*>(values.at) + first, room);
  return room;
}

/// Where floats are to be written that are meant for `values`: there, or `room` until Written.
inline float* Room(const Values& values, std::int64_t first, float* room) {
  return values.bf16 ? room : static_cast<float*>(values.at) + first;
}
inline void Written(const Values& values, std::int64_t first, std::int64_t count, const float* room) {
  if (values.bf16) ToBf16(count, room, static_cast<std::uint16_t*>(values.at) + first);
}

}  // namespace evac::nn::kernels
