#include "worldmodel/nn/kernels.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include "worldmodel/nn/float_math.h"
#include "worldmodel/nn/processors.h"

namespace evac::nn::kernels {
namespace {

constexpr std::int64_t kBlockRows = 256;  // sums of so many rows are kept in float, those of blocks in double

/// Sums over some rows, per channel, of x - shift or of its square.
EVAC_EACH_PROCESSOR void SumRows(std::int64_t rows, std::int64_t channels, const float* x, float* sums) {
  std::fill(sums, sums + channels, 0.0F);
  for (std::int64_t row = 0; row < rows; ++row) {
    const float* values = x + row * channels;
#pragma omp simd
    for (std::int64_t c = 0; c < channels; ++c) sums[c] += values[c];
  }
}

EVAC_EACH_PROCESSOR void SumSquares(std::int64_t rows, std::int64_t channels, const float* x, const float* mean,
                                    float* sums) {
  std::fill(sums, sums + channels, 0.0F);
  for (std::int64_t row = 0; row < rows; ++row) {
    const float* values = x + row * channels;
#pragma omp simd
    for (std::int64_t c = 0; c < channels; ++c) sums[c] += (values[c] - mean[c]) * (values[c] - mean[c]);
  }
}

struct Affine {
  const float* mean;
  const float* factor;
  const float* bias;
};

EVAC_EACH_PROCESSOR void Normalise(std::int64_t rows, std::int64_t channels, const float* x, const Affine& affine,
                                   float* y) {
  for (std::int64_t row = 0; row < rows; ++row) {
    const float* in = x + row * channels;
    float* out = y + row * channels;
#pragma omp simd
    for (std::int64_t c = 0; c < channels; ++c) out[c] = (in[c] - affine.mean[c]) * affine.factor[c] + affine.bias[c];
  }
}

EVAC_EACH_PROCESSOR void NormaliseSilu(std::int64_t rows, std::int64_t channels, const float* x, const Affine& affine,
                                       float* y) {
  for (std::int64_t row = 0; row < rows; ++row) {
    const float* in = x + row * channels;
    float* out = y + row * channels;
#pragma omp simd
    for (std::int64_t c = 0; c < channels; ++c) {
      const float value = (in[c] - affine.mean[c]) * affine.factor[c] + affine.bias[c];
      out[c] = value / (1.0F + MildExponential(-value));
    }
  }
}

std::int64_t Blocks(const NormShape& shape) { return (shape.rows + kBlockRows - 1) / kBlockRows; }

/// Per channel and sample: the sum over all rows of what `block` gives for some of them, in an order of its own.
template <typename Function>
std::vector<double> OverBlocks(const NormShape& shape, Function block) {
  const std::int64_t blocks = Blocks(shape), channels = shape.channels;
  std::vector<float> partial(static_cast<std::size_t>(shape.samples * blocks * channels));
#pragma omp parallel for schedule(static)
  for (std::int64_t i = 0; i < shape.samples * blocks; ++i) {
    const std::int64_t from = i % blocks * kBlockRows, rows = std::min(kBlockRows, shape.rows - from);
    block(i / blocks, from, rows, partial.data() + i * channels);
  }
  std::vector<double> sums(static_cast<std::size_t>(shape.samples * channels));
  for (std::int64_t i = 0; i < shape.samples * blocks; ++i) {
    for (std::int64_t c = 0; c < channels; ++c)
      sums[static_cast<std::size_t>(i / blocks * channels + c)] +=
          static_cast<double>(partial[static_cast<std::size_t>(i * channels + c)]);
  }
  return sums;
}

/// The mean over each group of channels, at each of its channels.
std::vector<double> GroupMeans(const NormShape& shape, const std::vector<double>& sums) {
  std::vector<double> means(sums.size());
  const auto width = static_cast<std::size_t>(shape.channels / shape.groups);
  const double count = static_cast<double>(shape.rows) * static_cast<double>(width);
  for (std::size_t group = 0; group < sums.size() / width; ++group) {
    double sum = 0;
    for (std::size_t c = 0; c < width; ++c) sum += sums[group * width + c];
    std::fill_n(means.begin() + static_cast<std::ptrdiff_t>(group * width), width, sum / count);
  }
  return means;
}

EVAC_EACH_PROCESSOR void GateRow(std::int64_t half, const float* value, const float* gate, float* out) {
#pragma omp simd
  for (std::int64_t c = 0; c < half; ++c)
    out[c] = value[c] * 0.5F * gate[c] * (1.0F + ErrorFunction(gate[c] * 0.70710678F));
}

EVAC_EACH_PROCESSOR void SoftmaxRow(std::int64_t columns, float* scores, float* sum) {
  float largest = scores[0];
#pragma omp simd reduction(max : largest)
  for (std::int64_t j = 0; j < columns; ++j) largest = std::max(largest, scores[j]);
  float total = 0;
#pragma omp simd reduction(+ : total)
  for (std::int64_t j = 0; j < columns; ++j) {
    scores[j] = Exponential(scores[j] - largest);
    total += scores[j];
  }
  *sum = total;
}

struct Strided {
  const float* at;
  std::int64_t stride;  ///< from frame to frame
};

/// One pixel, one head. `weights` is room for `frames` numbers.
EVAC_EACH_PROCESSOR void AttendOverTime(std::int64_t frames, std::int64_t width, const Strided& q, const Strided& k,
                                        const Strided& v, float* weights, float* y) {
  const float scale = 1.0F / std::sqrt(static_cast<float>(width));
  for (std::int64_t i = 0; i < frames; ++i) {
    const float* query = q.at + i * q.stride;
    float largest = -INFINITY;
    for (std::int64_t j = 0; j < frames; ++j) {
      const float* key = k.at + j * k.stride;
      float score = 0;
#pragma omp simd reduction(+ : score)
      for (std::int64_t c = 0; c < width; ++c) score += query[c] * key[c];
      weights[j] = score * scale;
      largest = std::max(largest, weights[j]);
    }
    float total = 0;
    for (std::int64_t j = 0; j < frames; ++j) total += weights[j] = Exponential(weights[j] - largest);
    float* out = y + i * q.stride;
    for (std::int64_t c = 0; c < width; ++c) out[c] = 0;
    for (std::int64_t j = 0; j < frames; ++j) {
      const float* value = v.at + j * v.stride;
      const float weight = weights[j] / total;
#pragma omp simd
      for (std::int64_t c = 0; c < width; ++c) out[c] += weight * value[c];
    }
  }
}

}  // namespace

void GroupNorm(const NormShape& shape, const float* x, const float* weight, const float* bias, bool silu, float* y) {
  const std::int64_t channels = shape.channels, size = shape.rows * channels, blocks = Blocks(shape);
  const std::vector<double> exact =
      GroupMeans(shape, OverBlocks(shape, [&](std::int64_t n, std::int64_t from, std::int64_t rows, float* sums) {
                   SumRows(rows, channels, x + n * size + from * channels, sums);
                 }));
  const std::vector<float> mean(exact.begin(), exact.end());
  const std::vector<double> variance =
      GroupMeans(shape, OverBlocks(shape, [&](std::int64_t n, std::int64_t from, std::int64_t rows, float* sums) {
                   SumSquares(rows, channels, x + n * size + from * channels, mean.data() + n * channels, sums);
                 }));
  std::vector<float> factor(variance.size());
  for (std::size_t i = 0; i < factor.size(); ++i)
    factor[i] = static_cast<float>(static_cast<double>(weight[i % static_cast<std::size_t>(channels)]) /
                                   std::sqrt(variance[i] + shape.epsilon));
#pragma omp parallel for schedule(static)
  for (std::int64_t i = 0; i < shape.samples * blocks; ++i) {
    const std::int64_t n = i / blocks, from = i % blocks * kBlockRows, rows = std::min(kBlockRows, shape.rows - from);
    const Affine affine{mean.data() + n * channels, factor.data() + n * channels, bias};
    const std::int64_t at = n * size + from * channels;
    (silu ? NormaliseSilu : Normalise)(rows, channels, x + at, affine, y + at);
  }
}

void GatedGelu(std::int64_t rows, std::int64_t half, const float* x, float* y) {
#pragma omp parallel for schedule(static)
  for (std::int64_t row = 0; row < rows; ++row)
    GateRow(half, x + row * 2 * half, x + row * 2 * half + half, y + row * half);
}

void TemporalAttention(const TemporalShape& shape, const float* q, const float* k, const float* v, float* y) {
  const std::int64_t width = shape.channels / shape.heads, stride = shape.pixels * shape.channels;
#pragma omp parallel
  {
    std::vector<float> weights(static_cast<std::size_t>(shape.frames));
#pragma omp for schedule(static)
    for (std::int64_t i = 0; i < shape.samples * shape.pixels; ++i) {
      const std::int64_t at = i / shape.pixels * shape.frames * stride + i % shape.pixels * shape.channels;
      for (std::int64_t head = 0; head < shape.heads; ++head) {
        const std::int64_t from = at + head * width;
        AttendOverTime(shape.frames, width, {q + from, stride}, {k + from, stride}, {v + from, stride}, weights.data(),
                       y + from);
      }
    }
  }
}

void SoftmaxRows(std::int64_t rows, std::int64_t columns, float* scores, float* sums) {
  for (std::int64_t row = 0; row < rows; ++row) SoftmaxRow(columns, scores + row * columns, sums + row);
}

}  // namespace evac::nn::kernels
