#include "worldmodel/nn/attention_kernel.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <vector>

#include "worldmodel/nn/kernels.h"
#include "worldmodel/nn/processors.h"

namespace evac::nn::kernels {
namespace {

constexpr std::int64_t kLane = 8;  // floats worked on together: gcc takes longer ones apart where registers are shorter
constexpr std::int64_t kRows = 8;   // queries worked on together

using Lane = float __attribute__((vector_size(kLane * sizeof(float))));

std::int64_t RoundedUp(std::int64_t count) { return (count + kLane - 1) / kLane * kLane; }

/// Keys as the scores want them: [keys / 8][width][8], padded with zeros. Values: [keys][width rounded up].
struct Packed {
  std::vector<float> keys, values;
  std::int64_t padded_keys = 0, padded_width = 0;
};

void Pack(const AttentionShape& shape, const TokenRows& k, const TokenRows& v, Packed& packed) {
  packed.padded_keys = RoundedUp(shape.keys);
  packed.padded_width = RoundedUp(shape.width);
  packed.keys.assign(static_cast<std::size_t>(packed.padded_keys * shape.width), 0.0F);
  packed.values.assign(static_cast<std::size_t>(shape.keys * packed.padded_width), 0.0F);
  for (std::int64_t j = 0; j < shape.keys; ++j) {
    float* to = packed.keys.data() + j / kLane * shape.width * kLane + j % kLane;
    for (std::int64_t c = 0; c < shape.width; ++c) to[c * kLane] = k.at[j * k.stride + c];
    std::copy_n(v.at + j * v.stride, shape.width, packed.values.data() + j * packed.padded_width);
  }
}

/// scores[r][8 keys] = q[r] · keys, for 8 queries. @param q  [width][8]
EVAC_EACH_PROCESSOR void Scores(std::int64_t width, std::int64_t padded_keys, const float* q, const float* keys,
                                float* scores) {
  for (std::int64_t j = 0; j < padded_keys; j += kLane) {
    const float* block = keys + j * width;
    Lane sums[kRows] = {};
    for (std::int64_t c = 0; c < width; ++c) {
      Lane key;
      std::memcpy(&key, block + c * kLane, sizeof key);
#pragma GCC unroll 8
      for (std::int64_t r = 0; r < kRows; ++r) sums[r] += q[c * kRows + r] * key;
    }
#pragma GCC unroll 8
    for (std::int64_t r = 0; r < kRows; ++r) std::memcpy(scores + r * padded_keys + j, &sums[r], sizeof(Lane));
  }
}

/// y[r][8 channels] = weights[r] · values[:, channels], for 8 queries.
EVAC_EACH_PROCESSOR void Mix(std::int64_t keys, std::int64_t padded_keys, const float* weights, const float* values,
                             std::int64_t stride, float* y) {
  Lane sums[kRows] = {};
  for (std::int64_t j = 0; j < keys; ++j) {
    Lane value;
    std::memcpy(&value, values + j * stride, sizeof value);
#pragma GCC unroll 8
    for (std::int64_t r = 0; r < kRows; ++r) sums[r] += weights[r * padded_keys + j] * value;
  }
  std::memcpy(y, sums, sizeof sums);
}

/// One thread's room.
struct Workspace {
  Packed packed;
  std::vector<float> q, scores;
  float sums[kRows] = {}, mixed[kRows * kLane] = {};
  std::int64_t head = -1;  ///< which sample's head is packed
};

struct Out {
  float* at;
  std::int64_t stride;
};

void AttendBlock(const AttentionShape& shape, const TokenRows& q, std::int64_t rows, Workspace& room, const Out& y) {
  const Packed& packed = room.packed;
  const float scale = 1.0F / std::sqrt(static_cast<float>(shape.width));
  room.q.assign(static_cast<std::size_t>(shape.width * kRows), 0.0F);
  for (std::int64_t r = 0; r < rows; ++r) {
    for (std::int64_t c = 0; c < shape.width; ++c)
      room.q[static_cast<std::size_t>(c * kRows + r)] = q.at[r * q.stride + c] * scale;
  }
  room.scores.resize(static_cast<std::size_t>(kRows * packed.padded_keys));
  Scores(shape.width, packed.padded_keys, room.q.data(), packed.keys.data(), room.scores.data());
  for (std::int64_t r = 0; r < kRows; ++r)
    SoftmaxRows(1, shape.keys, room.scores.data() + r * packed.padded_keys, &room.sums[r]);
  for (std::int64_t c = 0; c < shape.width; c += kLane) {
    Mix(shape.keys, packed.padded_keys, room.scores.data(), packed.values.data() + c, packed.padded_width, room.mixed);
    for (std::int64_t r = 0; r < rows; ++r) {
      for (std::int64_t i = 0; i < std::min(kLane, shape.width - c); ++i)
        y.at[r * y.stride + c + i] = room.mixed[r * kLane + i] / room.sums[r];
    }
  }
}

}  // namespace

void TiledAttention(const AttentionShape& shape, const TokenRows& q, const TokenRows& k, const TokenRows& v, float* y) {
  constexpr std::int64_t kBlock = 32 * kRows;  // queries of one task
  const std::int64_t blocks = (shape.queries + kBlock - 1) / kBlock, stride = shape.heads * shape.width;
#pragma omp parallel
  {
    Workspace room;
#pragma omp for schedule(static)
    for (std::int64_t task = 0; task < shape.samples * shape.heads * blocks; ++task) {
      const std::int64_t head = task / blocks, sample = head / shape.heads, offset = head % shape.heads * shape.width;
      const std::int64_t keys_at = sample * shape.keys;
      if (room.head != head)
        Pack(shape, {k.at + keys_at * k.stride + offset, k.stride}, {v.at + keys_at * v.stride + offset, v.stride},
             room.packed);
      room.head = head;
      const std::int64_t from = task % blocks * kBlock, to = std::min(from + kBlock, shape.queries);
      for (std::int64_t i = from; i < to; i += kRows) {
        const std::int64_t row = sample * shape.queries + i;
        AttendBlock(shape, {q.at + row * q.stride + offset, q.stride}, std::min(kRows, to - i), room,
                    {y + row * stride + offset, stride});
      }
    }
  }
}

}  // namespace evac::nn::kernels
