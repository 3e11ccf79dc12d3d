#include "worldmodel/nn/conv_kernel.h"

#ifdef _OPENMP
#include <omp.h>
#endif

#include <algorithm>
#include <cstring>
#include <memory>
#include <vector>

#include "worldmodel/nn/processors.h"

namespace evac::nn::kernels {
namespace {

constexpr std::int64_t kLane = 8;           // floats worked on together: what gcc keeps in a register, or in two
constexpr std::int64_t kPanel = 2 * kLane;  // outputs worked on together
constexpr std::int64_t kRows = 6;           // tiles worked on together: with a panel of outputs they fill the registers
constexpr std::int64_t kTile = 4, kSide = 6;     // places of an output tile's side, and of what it is made of
constexpr std::int64_t kPoints = kSide * kSide;  // of the transformed tile
constexpr std::int64_t kPadding = 16;            // floats between points, lest all share a line of the cache
constexpr std::int64_t kBlockFloats = 1 << 20;   // what is seen of so many tiles should stay in the cache

using Lane = float __attribute__((vector_size(kLane * sizeof(float))));

std::int64_t RoundedUp(std::int64_t count, std::int64_t to) { return (count + to - 1) / to * to; }

/// Tiles worked on by one thread at a time, and where their numbers lie.
struct Block {
  std::int64_t first = 0, tiles = 0;
  std::int64_t channels = 0;      ///< of x
  std::int64_t point_stride = 0;  ///< between the points of `seen`, [36][tiles rounded up][channels]
  std::int64_t out_stride = 0;    ///< between the points of `made`, [36][tiles rounded up][panel]
};

/// Room for so many floats, of any value: clearing it took one part in fifteen of the time.
using Floats = std::unique_ptr<float[]>;
Floats MakeFloats(std::int64_t count) {
  return std::make_unique_for_overwrite<float[]>(static_cast<std::size_t>(count));
}

/// One thread's.
struct Room {
  explicit Room(const Block& sizes)
      : zeros(static_cast<std::size_t>(sizes.channels)),
        seen(MakeFloats(kPoints * sizes.point_stride)),
        weights(MakeFloats(kPoints * sizes.channels * kPanel)),
        made(MakeFloats(kPoints * sizes.out_stride)) {}

  std::vector<float> zeros;
  Floats seen, weights, made;
};

[[gnu::always_inline]] inline void Load(const float* from, std::int64_t count, Lane& lane) {
  if (count >= kLane) {
    std::memcpy(&lane, from, sizeof lane);
  } else {
    lane = Lane{};
    std::memcpy(&lane, from, static_cast<std::size_t>(count) * sizeof(float));
  }
}

[[gnu::always_inline]] inline void Store(const Lane& lane, float* to, std::int64_t count) {
  if (count >= kLane)
    std::memcpy(to, &lane, sizeof lane);
  else
    std::memcpy(to, &lane, static_cast<std::size_t>(count) * sizeof(float));
}

/// Bᵀ d of six numbers that lie `stride` lanes apart.
[[gnu::always_inline]] inline void Seen(const Lane* d, std::int64_t stride, Lane* to) {
  const Lane d1 = d[stride], d2 = d[2 * stride], d3 = d[3 * stride], d4 = d[4 * stride];
  const Lane even = d4 - 4.0F * d2, odd = d3 - 4.0F * d1, far = d4 - d2, twice = 2.0F * (d3 - d1);
  to[0] = 4.0F * d[0] - 5.0F * d2 + d4;
  to[1] = even + odd;
  to[2] = even - odd;
  to[3] = far + twice;
  to[4] = far - twice;
  to[5] = 4.0F * d1 - 5.0F * d3 + d[5 * stride];
}

/// G g of three numbers.
[[gnu::always_inline]] inline void Weighted(const Lane* g, std::int64_t stride, Lane* to) {
  const Lane ends = g[0] + g[2 * stride], far = g[0] * (1.0F / 24) + g[2 * stride] * (1.0F / 6);
  to[0] = g[0] * 0.25F;
  to[1] = (ends + g[stride]) * (-1.0F / 6);
  to[2] = (ends - g[stride]) * (-1.0F / 6);
  to[3] = far + g[stride] * (1.0F / 12);
  to[4] = far - g[stride] * (1.0F / 12);
  to[5] = g[2 * stride];
}

/// Aᵀ m of six numbers.
[[gnu::always_inline]] inline void Made(const Lane* m, std::int64_t stride, Lane* to) {
  const Lane near = m[stride] + m[2 * stride], near_odd = m[stride] - m[2 * stride];
  const Lane far = m[3 * stride] + m[4 * stride], far_odd = m[3 * stride] - m[4 * stride];
  to[0] = m[0] + near + far;
  to[1] = near_odd + 2.0F * far_odd;
  to[2] = near + 4.0F * far;
  to[3] = near_odd + 8.0F * far_odd + m[5 * stride];
}

/// A d of four numbers: the other way round.
[[gnu::always_inline]] inline void Spread(const Lane* d, std::int64_t stride, Lane* to) {
  const Lane even = d[0] + d[2 * stride], odd = d[stride] + d[3 * stride];
  const Lane far = d[0] + 4.0F * d[2 * stride], far_odd = 2.0F * d[stride] + 8.0F * d[3 * stride];
  to[0] = d[0];
  to[1] = even + odd;
  to[2] = even - odd;
  to[3] = far + far_odd;
  to[4] = far - far_odd;
  to[5] = d[3 * stride];
}

/// Gᵀ m of six numbers.
[[gnu::always_inline]] inline void Unweighted(const Lane* m, std::int64_t stride, Lane* to) {
  const Lane near = (m[stride] + m[2 * stride]) * (-1.0F / 6), far = m[3 * stride] + m[4 * stride];
  to[0] = m[0] * 0.25F + near + far * (1.0F / 24);
  to[1] = (m[2 * stride] - m[stride]) * (1.0F / 6) + (m[3 * stride] - m[4 * stride]) * (1.0F / 12);
  to[2] = near + far * (1.0F / 6) + m[5 * stride];
}

/// Where a tile begins in its picture.
struct Corner {
  std::int64_t sample, y, x;
};

Corner CornerOf(const ConvShape& shape, std::int64_t tile) {
  const std::int64_t across = RoundedUp(shape.width, kTile) / kTile, down = RoundedUp(shape.height, kTile) / kTile;
  return {tile / (across * down), tile / across % down * kTile, tile % across * kTile};
}

/// Where a tile's numbers go to: `stride` between points, `lane_stride` between whole lanes of channels; 0: side by side,
/// and no more than there are.
struct Places {
  float* at;
  std::int64_t stride, lane_stride = 0;
};

/// One tile of x, with what is around it. @param zeros  as many as x has channels: what is around the picture
EVAC_EACH_PROCESSOR void SeeTile(const ConvShape& shape, const Corner& corner, const float* x, const float* zeros,
                                 const Places& to) {
  const float* from[kPoints];  // [column][row]
  for (std::int64_t j = 0; j < kSide; ++j) {
    for (std::int64_t i = 0; i < kSide; ++i) {
      const std::int64_t at_x = corner.x - 1 + j, at_y = corner.y - 1 + i;
      const bool inside = at_x >= 0 && at_x < shape.width && at_y >= 0 && at_y < shape.height;
      const std::int64_t row = (corner.sample * shape.height + at_y) * shape.width + at_x;
      from[j * kSide + i] = inside ? x + row * shape.in : zeros;
    }
  }
  for (std::int64_t c = 0; c < shape.in; c += kLane) {
    const std::int64_t count = std::min(kLane, shape.in - c);
    Lane columns[kPoints], points[kPoints];  // [column][row], [row][column]
    for (std::int64_t j = 0; j < kSide; ++j) {
      Lane column[kSide];
#pragma GCC unroll 6
      for (std::int64_t i = 0; i < kSide; ++i) Load(from[j * kSide + i] + c, count, column[i]);
      Seen(column, 1, columns + j * kSide);
    }
    for (std::int64_t i = 0; i < kSide; ++i) Seen(columns + i, kSide, points + i * kSide);
    const bool side_by_side = to.lane_stride == 0;
    float* lane = to.at + (side_by_side ? c : c / kLane * to.lane_stride);
    for (std::int64_t p = 0; p < kPoints; ++p) Store(points[p], lane + p * to.stride, side_by_side ? count : kLane);
  }
}

/// Weights of a panel of outputs, zeros behind the last. @param to  [36][in][panel]
EVAC_EACH_PROCESSOR void WeighChannels(const ConvShape& shape, const float* weight, std::int64_t first, float* to) {
  constexpr std::int64_t kKernel = 9;
  for (std::int64_t lane = 0; lane < kPanel; lane += kLane) {
    const std::int64_t count = std::clamp<std::int64_t>(shape.out - first - lane, 0, kLane);
    for (std::int64_t c = 0; c < shape.in; ++c) {
      float gathered[kKernel][kLane] = {};
      for (std::int64_t k = 0; k < count; ++k) {
        const float* from = weight + ((first + lane + k) * shape.in + c) * kKernel;
        for (std::int64_t i = 0; i < kKernel; ++i) gathered[i][k] = from[i];
      }
      Lane g[kKernel], columns[3 * kSide], points[kPoints];
      std::memcpy(g, gathered, sizeof g);
      for (std::int64_t j = 0; j < 3; ++j) Weighted(g + j, 3, columns + j * kSide);
      for (std::int64_t i = 0; i < kSide; ++i) Weighted(columns + i, kSide, points + i * kSide);
      for (std::int64_t p = 0; p < kPoints; ++p) Store(points[p], to + (p * shape.in + c) * kPanel + lane, kLane);
    }
  }
}

/// made[tile][panel] = seen[tile] · weights, over the channels of one point.
/// @param tiles    a multiple of kRows
/// @param weights  [channels][panel]
EVAC_EACH_PROCESSOR void Multiply(std::int64_t tiles, std::int64_t channels, const float* seen, const float* weights,
                                  float* made) {
  for (std::int64_t tile = 0; tile < tiles; tile += kRows) {
    const float* rows = seen + tile * channels;
    Lane left[kRows] = {}, right[kRows] = {};
    for (std::int64_t c = 0; c < channels; ++c) {
      Lane a, b;
      std::memcpy(&a, weights + c * kPanel, sizeof a);
      std::memcpy(&b, weights + c * kPanel + kLane, sizeof b);
#pragma GCC unroll 8
      for (std::int64_t r = 0; r < kRows; ++r) {
        const float value = rows[r * channels + c];
        left[r] += value * a;
        right[r] += value * b;
      }
    }
#pragma GCC unroll 8
    for (std::int64_t r = 0; r < kRows; ++r) {
      std::memcpy(made + (tile + r) * kPanel, &left[r], sizeof(Lane));
      std::memcpy(made + (tile + r) * kPanel + kLane, &right[r], sizeof(Lane));
    }
  }
}

/// A panel of outputs of one tile. @param made  the tile's panel of the first point
EVAC_EACH_PROCESSOR void MakeTile(const ConvShape& shape, const Corner& corner, const float* made, std::int64_t stride,
                                  const float* bias, std::int64_t first, float* y) {
  const std::int64_t height = std::min(kTile, shape.height - corner.y), width = std::min(kTile, shape.width - corner.x);
  float* to = y + ((corner.sample * shape.height + corner.y) * shape.width + corner.x) * shape.out + first;
  for (std::int64_t lane = 0; lane < std::min(kPanel, shape.out - first); lane += kLane) {
    const std::int64_t count = std::min(kLane, shape.out - first - lane);
    Lane added = {}, columns[kSide * kTile], places[kTile * kTile];  // [column][row], [row][column]
    if (bias != nullptr) Load(bias + first + lane, count, added);
    for (std::int64_t j = 0; j < kSide; ++j) {
      Lane column[kSide];
#pragma GCC unroll 6
      for (std::int64_t i = 0; i < kSide; ++i) Load(made + (i * kSide + j) * stride + lane, kLane, column[i]);
      Made(column, 1, columns + j * kTile);
    }
    for (std::int64_t i = 0; i < kTile; ++i) Made(columns + i, kTile, places + i * kTile);
    for (std::int64_t i = 0; i < height; ++i) {
      for (std::int64_t j = 0; j < width; ++j)
        Store(places[i * kTile + j] + added, to + (i * shape.width + j) * shape.out + lane, count);
    }
  }
}

void ConvBlock(const ConvShape& shape, const Block& block, const float* x, const float* weight, const float* bias,
               Room& room, float* y) {
  const std::int64_t rows = RoundedUp(block.tiles, kRows);
  const auto corner = [&](std::int64_t tile) { return CornerOf(shape, block.first + tile); };
  for (std::int64_t t = 0; t < block.tiles; ++t)
    SeeTile(shape, corner(t), x, room.zeros.data(), {room.seen.get() + t * shape.in, block.point_stride});
  for (std::int64_t p = 0; p < kPoints; ++p)
    std::fill(room.seen.get() + p * block.point_stride + block.tiles * shape.in,
              room.seen.get() + p * block.point_stride + rows * shape.in, 0.0F);
  for (std::int64_t first = 0; first < shape.out; first += kPanel) {
    WeighChannels(shape, weight, first, room.weights.get());
    for (std::int64_t p = 0; p < kPoints; ++p)
      Multiply(rows, shape.in, room.seen.get() + p * block.point_stride, room.weights.get() + p * shape.in * kPanel,
               room.made.get() + p * block.out_stride);
    for (std::int64_t t = 0; t < block.tiles; ++t)
      MakeTile(shape, corner(t), room.made.get() + t * kPanel, block.out_stride, bias, first, y);
  }
}

/// A tile of a gradient of the outputs.
EVAC_EACH_PROCESSOR void SpreadTile(const ConvShape& shape, const Corner& corner, const float* gradient,
                                    const Places& to) {
  for (std::int64_t k = 0; k < shape.out; k += kLane) {
    const std::int64_t count = std::min(kLane, shape.out - k);
    Lane columns[kTile * kSide], points[kPoints];  // [column][row], [row][column]
    for (std::int64_t j = 0; j < kTile; ++j) {
      Lane column[kTile] = {};
      for (std::int64_t i = 0; i < kTile && corner.x + j < shape.width && corner.y + i < shape.height; ++i) {
        const std::int64_t row = (corner.sample * shape.height + corner.y + i) * shape.width + corner.x + j;
        Load(gradient + row * shape.out + k, count, column[i]);
      }
      Spread(column, 1, columns + j * kSide);
    }
    for (std::int64_t i = 0; i < kSide; ++i) Spread(columns + i, kSide, points + i * kSide);
    float* lane = to.at + k / kLane * to.lane_stride;
    for (std::int64_t p = 0; p < kPoints; ++p) Store(points[p], lane + p * to.stride, kLane);
  }
}

/// sums[in][out] += seenᵀ · spread over the tiles of one point, lane by lane of channels.
/// @param seen    [in / 8][tiles][8]
/// @param spread  [out / 8][tiles][8], of an even number of lanes
/// @param sums    [in rounded up][out rounded up]
EVAC_EACH_PROCESSOR void AddProducts(std::int64_t tiles, std::int64_t in, std::int64_t out, const float* seen,
                                     const float* spread, float* sums) {
  constexpr std::int64_t kChannels = kLane / 2;  // with a panel: eight sums, as many as are made at once
  for (std::int64_t k = 0; k < out; k += kPanel) {
    const float* panel = spread + k * tiles;
    for (std::int64_t c = 0; c < in; c += kChannels) {
      const float* rows = seen + c / kLane * kLane * tiles + c % kLane;
      Lane left[kChannels] = {}, right[kChannels] = {};
      for (std::int64_t t = 0; t < tiles; ++t) {
        Lane a, b;
        std::memcpy(&a, panel + t * kLane, sizeof a);
        std::memcpy(&b, panel + (tiles + t) * kLane, sizeof b);
#pragma GCC unroll 4
        for (std::int64_t r = 0; r < kChannels; ++r) {
          const float value = rows[t * kLane + r];
          left[r] += value * a;
          right[r] += value * b;
        }
      }
      for (std::int64_t r = 0; r < kChannels; ++r) {
        float* to = sums + (c + r) * out + k;
        Lane a, b;
        std::memcpy(&a, to, sizeof a);
        std::memcpy(&b, to + kLane, sizeof b);
        a += left[r];
        b += right[r];
        std::memcpy(to, &a, sizeof a);
        std::memcpy(to + kLane, &b, sizeof b);
      }
    }
  }
}

/// Weights from their points. @param sums  [36][in rounded up][out rounded up]: this channel's of the first
EVAC_EACH_PROCESSOR void UnweighChannel(const ConvShape& shape, std::int64_t channel, const float* sums,
                                        std::int64_t stride, float* weight) {
  constexpr std::int64_t kKernel = 9;
  for (std::int64_t k = 0; k < shape.out; k += kLane) {
    Lane points[kPoints], columns[3 * kSide], g[kKernel];  // [column][row], [row][column]
    for (std::int64_t p = 0; p < kPoints; ++p) Load(sums + p * stride + k, kLane, points[p]);
    for (std::int64_t j = 0; j < kSide; ++j) Unweighted(points + j, kSide, columns + j * 3);
    for (std::int64_t i = 0; i < 3; ++i) Unweighted(columns + i, 3, g + i * 3);
    float gathered[kKernel][kLane];
    std::memcpy(gathered, g, sizeof g);
    for (std::int64_t lane = 0; lane < std::min(kLane, shape.out - k); ++lane) {
      float* to = weight + ((k + lane) * shape.in + channel) * kKernel;
      for (std::int64_t i = 0; i < kKernel; ++i) to[i] = gathered[i][lane];
    }
  }
}

/// Squares of 4x4 that cover the output.
std::int64_t ConvTiles(const ConvShape& shape) {
  return shape.samples * (RoundedUp(shape.height, kTile) / kTile) * (RoundedUp(shape.width, kTile) / kTile);
}

std::int64_t Threads() {
#ifdef _OPENMP
  return omp_get_max_threads();
#else
  return 1;
#endif
}

}  // namespace

void Conv3x3(const ConvShape& shape, const float* x, const float* weight, const float* bias, float* y) {
  constexpr std::int64_t kFewest = 96;
  const std::int64_t tiles = ConvTiles(shape), most = std::max(kFewest, kBlockFloats / (kPoints * (shape.in + kPanel)));
  if (tiles == 0) return;
  const std::int64_t wanted = std::max((tiles + most - 1) / most, std::min(Threads(), (tiles + kRows - 1) / kRows));
  const std::int64_t each = (tiles + wanted - 1) / wanted, blocks = (tiles + each - 1) / each;
  const std::int64_t rows = RoundedUp(each, kRows);
  const Block sizes{0, each, shape.in, rows * shape.in + kPadding, rows * kPanel + kPadding};
#pragma omp parallel
  {
    Room room(sizes);
#pragma omp for schedule(static)
    for (std::int64_t i = 0; i < blocks; ++i) {
      Block block = sizes;
      block.first = i * each;
      block.tiles = std::min(each, tiles - block.first);
      ConvBlock(shape, block, x, weight, bias, room, y);
    }
  }
}

void Conv3x3WeightGradient(const ConvShape& shape, const float* x, const float* gradient, float* weight_gradient) {
  const std::int64_t in = RoundedUp(shape.in, kLane), out = RoundedUp(shape.out, kPanel), tiles = ConvTiles(shape);
  constexpr std::int64_t kFewest = 48;
  const std::int64_t each = std::min(tiles, std::max(kFewest, kBlockFloats / (kPoints * (in + out))));
  const std::int64_t seen_stride = in * each + kPadding, spread_stride = out * each + kPadding, sum_stride = in * out;
  std::vector<float> zeros(static_cast<std::size_t>(in)), sums(static_cast<std::size_t>(kPoints * sum_stride));
  std::vector<float> spread(static_cast<std::size_t>(kPoints * spread_stride));  // zeros in the lanes behind the last
  const Floats seen = MakeFloats(kPoints * seen_stride);
  for (std::int64_t first = 0; first < tiles; first += each) {
    const std::int64_t count = std::min(each, tiles - first);
#pragma omp parallel
    {
#pragma omp for schedule(static)
      for (std::int64_t t = 0; t < count; ++t) {
        const Corner corner = CornerOf(shape, first + t);
        SeeTile(shape, corner, x, zeros.data(), {seen.get() + t * kLane, seen_stride, count * kLane});
        SpreadTile(shape, corner, gradient, {spread.data() + t * kLane, spread_stride, count * kLane});
      }
#pragma omp for schedule(static)
      for (std::int64_t p = 0; p < kPoints; ++p)
        AddProducts(count, in, out, seen.get() + p * seen_stride, spread.data() + p * spread_stride,
                    sums.data() + p * sum_stride);
    }
  }
#pragma omp parallel for schedule(static)
  for (std::int64_t c = 0; c < shape.in; ++c)
    UnweighChannel(shape, c, sums.data() + c * out, sum_stride, weight_gradient);
}

}  // namespace evac::nn::kernels
