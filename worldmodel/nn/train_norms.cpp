#include <algorithm>
#include <cmath>
#include <vector>

#include "worldmodel/nn/float_math.h"
#include "worldmodel/nn/processors.h"
#include "worldmodel/nn/train_memory.h"

namespace evac::nn::kernels {
namespace {

constexpr std::int64_t kBlockValues = 4096;  ///< rows are worked on together while they fit into the nearest cache

struct Row {
  const float *mean, *factor, *bias;  ///< per channel: y = (x - mean) factor + bias
};

EVAC_EACH_PROCESSOR void AddRows(std::int64_t rows, std::int64_t channels, const float* x, float* sums) {
  for (std::int64_t r = 0; r < rows; ++r) {
#pragma omp simd
    for (std::int64_t c = 0; c < channels; ++c) sums[c] += x[r * channels + c];
  }
}

EVAC_EACH_PROCESSOR void AddSquares(std::int64_t rows, std::int64_t channels, const float* x, const float* mean, float* sums) {
  for (std::int64_t r = 0; r < rows; ++r) {
#pragma omp simd
    for (std::int64_t c = 0; c < channels; ++c) {
      const float distance = x[r * channels + c] - mean[c];
      sums[c] += distance * distance;
    }
  }
}

EVAC_EACH_PROCESSOR void Apply(std::int64_t rows, std::int64_t channels, const float* x, const Row& row, float* y) {
  for (std::int64_t r = 0; r < rows; ++r) {
#pragma omp simd
    for (std::int64_t c = 0; c < channels; ++c)
      y[r * channels + c] = (x[r * channels + c] - row.mean[c]) * row.factor[c] + row.bias[c];
  }
}

EVAC_EACH_PROCESSOR void ApplySilu(std::int64_t rows, std::int64_t channels, const float* x, const Row& row, float* y) {
  for (std::int64_t r = 0; r < rows; ++r) {
#pragma omp simd
    for (std::int64_t c = 0; c < channels; ++c) {
      const float z = (x[r * channels + c] - row.mean[c]) * row.factor[c] + row.bias[c];
      y[r * channels + c] = z / (1.0F + MildExponential(-z));
    }
  }
}

/// The gradient before SiLU: it times silu'(z).
EVAC_EACH_PROCESSOR void BeforeSilu(std::int64_t rows, std::int64_t channels, const float* x, const Row& row,
                                    const float* gradient, float* before) {
  for (std::int64_t r = 0; r < rows; ++r) {
#pragma omp simd
    for (std::int64_t c = 0; c < channels; ++c) {
      const float z = (x[r * channels + c] - row.mean[c]) * row.factor[c] + row.bias[c];
      const float sigmoid = 1.0F / (1.0F + MildExponential(-z));
      before[r * channels + c] = gradient[r * channels + c] * sigmoid * (1.0F + z * (1.0F - sigmoid));
    }
  }
}

/// Sums over rows of the gradient, and of the gradient times (x - mean).
EVAC_EACH_PROCESSOR void AddGradients(std::int64_t rows, std::int64_t channels, const float* x, const float* mean,
                                      const float* gradient, float* sums[2]) {
  float *plain = sums[0], *times_x = sums[1];
  for (std::int64_t r = 0; r < rows; ++r) {
#pragma omp simd
    for (std::int64_t c = 0; c < channels; ++c) {
      const float g = gradient[r * channels + c];
      plain[c] += g;
      times_x[c] += g * (x[r * channels + c] - mean[c]);
    }
  }
}

/// dx = factor g - offset - slope (x - mean), per channel.
struct Back {
  const float *mean, *factor, *offset, *slope;
};
EVAC_EACH_PROCESSOR void ApplyBack(std::int64_t rows, std::int64_t channels, const float* x, const float* gradient,
                                   const Back& back, float* dx) {
  for (std::int64_t r = 0; r < rows; ++r) {
#pragma omp simd
    for (std::int64_t c = 0; c < channels; ++c)
      dx[r * channels + c] = back.factor[c] * gradient[r * channels + c] - back.offset[c] -
                             back.slope[c] * (x[r * channels + c] - back.mean[c]);
  }
}

/// One sample's work: its room, and numbers per channel.
struct Sample {
  Sample(const NormShape& s, std::int64_t index)
      : shape(s),
        first(index * s.rows * s.channels),
        block(std::max<std::int64_t>(1, kBlockValues / s.channels)),
        width(s.channels / s.groups),
        sums(static_cast<std::size_t>(2 * s.channels)),
        totals(static_cast<std::size_t>(2 * s.channels)),
        numbers(static_cast<std::size_t>(6 * s.channels)),
        room(static_cast<std::size_t>(3 * block * s.channels)) {}

  float* Numbers(int which) { return numbers.data() + which * shape.channels; }
  float* RoomOf(int which) { return room.data() + which * block * shape.channels; }

  /// Calls function(first value, rows) for blocks of rows; then adds `sums` to `totals`.
  template <typename Function>
  void Sum(Function function) {
    std::fill(totals.begin(), totals.end(), 0.0);
    for (std::int64_t row = 0; row < shape.rows; row += block) {
      std::fill(sums.begin(), sums.end(), 0.0F);
      function(first + row * shape.channels, std::min(block, shape.rows - row));
      for (std::size_t i = 0; i < sums.size(); ++i) totals[i] += static_cast<double>(sums[i]);
    }
  }
  template <typename Function>
  void Each(Function function) {
    for (std::int64_t row = 0; row < shape.rows; row += block)
      function(first + row * shape.channels, std::min(block, shape.rows - row));
  }

  const NormShape& shape;
  std::int64_t first, block, width;
  std::vector<float> sums;
  std::vector<double> totals;
  std::vector<float> numbers, room;
};

/// Mean of `totals` per group, at each of its channels.
void SpreadMeans(Sample& sample, std::vector<double>& per_channel) {
  const double count = static_cast<double>(sample.shape.rows * sample.width);
  for (std::int64_t g = 0; g < sample.shape.groups; ++g) {
    double sum = 0;
    for (std::int64_t c = g * sample.width; c < (g + 1) * sample.width; ++c) sum += sample.totals[static_cast<std::size_t>(c)];
    for (std::int64_t c = g * sample.width; c < (g + 1) * sample.width; ++c) per_channel[static_cast<std::size_t>(c)] = sum / count;
  }
}

void SetRow(Sample& sample, std::int64_t index, const float* weight_bias[2], const NormStatistics& statistics) {
  const std::int64_t groups = sample.shape.groups;
  for (std::int64_t c = 0; c < sample.shape.channels; ++c) {
    sample.Numbers(0)[c] = statistics.mean[index * groups + c / sample.width];
    sample.Numbers(1)[c] = statistics.inverse_deviation[index * groups + c / sample.width] * weight_bias[0][c];
    sample.Numbers(2)[c] = weight_bias[1][c];
  }
}

void MeasureSample(Sample& sample, std::int64_t index, const Values& x, const NormStatistics& statistics) {
  const std::int64_t channels = sample.shape.channels;
  std::vector<double> per_channel(static_cast<std::size_t>(channels));
  const auto read = [&](std::int64_t at, std::int64_t rows) { return Read(x, at, rows * channels, sample.RoomOf(0)); };
  sample.Sum([&](std::int64_t at, std::int64_t rows) { AddRows(rows, channels, read(at, rows), sample.sums.data()); });
  SpreadMeans(sample, per_channel);
  for (std::int64_t c = 0; c < channels; ++c) sample.Numbers(0)[c] = static_cast<float>(per_channel[static_cast<std::size_t>(c)]);
  sample.Sum([&](std::int64_t at, std::int64_t rows) {
    AddSquares(rows, channels, read(at, rows), sample.Numbers(0), sample.sums.data());
  });
  SpreadMeans(sample, per_channel);
  for (std::int64_t g = 0; g < sample.shape.groups; ++g) {
    statistics.mean[index * sample.shape.groups + g] = sample.Numbers(0)[g * sample.width];
    statistics.inverse_deviation[index * sample.shape.groups + g] = static_cast<float>(
        1 / std::sqrt(per_channel[static_cast<std::size_t>(g * sample.width)] + sample.shape.epsilon));
  }
}

/// What ApplyBack needs of a sample whose `totals` are the sums of AddGradients.
void SetBack(Sample& sample, std::int64_t index, const float* weight, const NormStatistics& statistics) {
  const double count = static_cast<double>(sample.shape.rows * sample.width);
  const auto channels = static_cast<std::size_t>(sample.shape.channels);
  for (std::int64_t g = 0; g < sample.shape.groups; ++g) {
    const double inverse = static_cast<double>(statistics.inverse_deviation[index * sample.shape.groups + g]);
    double plain = 0, times_x = 0;
    for (auto c = static_cast<std::size_t>(g * sample.width); c < static_cast<std::size_t>((g + 1) * sample.width); ++c) {
      plain += static_cast<double>(weight[c]) * sample.totals[c];
      times_x += static_cast<double>(weight[c]) * sample.totals[channels + c];
    }
    for (std::int64_t c = g * sample.width; c < (g + 1) * sample.width; ++c) {
      sample.Numbers(3)[c] = static_cast<float>(inverse * plain / count);
      sample.Numbers(4)[c] = static_cast<float>(inverse * inverse * inverse * times_x / count);
    }
  }
}

/// [parts][2 channels] added up in order: to the weight's gradient the second half, to the bias's the first.
void AddParts(std::int64_t channels, const std::vector<double>& parts, const NormGradients& gradients) {
  std::vector<double> sums(static_cast<std::size_t>(2 * channels));
  for (std::size_t i = 0; i < parts.size(); ++i) sums[i % sums.size()] += parts[i];
  for (std::int64_t c = 0; c < channels; ++c) {
    gradients.bias[c] = static_cast<float>(sums[static_cast<std::size_t>(c)]);
    gradients.weight[c] = static_cast<float>(sums[static_cast<std::size_t>(channels + c)]);
  }
}

}  // namespace

void GroupNormForward(const NormShape& shape, const Values& x, const float* weight_bias[2], bool silu,
                      const NormStatistics& statistics, const Values& y) {
#pragma omp parallel for schedule(static)
  for (std::int64_t index = 0; index < shape.samples; ++index) {
    Sample sample(shape, index);
    MeasureSample(sample, index, x, statistics);
    SetRow(sample, index, weight_bias, statistics);
    const Row row{sample.Numbers(0), sample.Numbers(1), sample.Numbers(2)};
    sample.Each([&](std::int64_t at, std::int64_t rows) {
      const std::int64_t count = rows * shape.channels;
      float* to = Room(y, at, sample.RoomOf(1));
      (silu ? ApplySilu : Apply)(rows, shape.channels, Read(x, at, count, sample.RoomOf(0)), row, to);
      Written(y, at, count, to);
    });
  }
}

void GroupNormBackward(const NormShape& shape, const Values& x, const float* weight_bias[2], bool silu,
                       const NormStatistics& statistics, const Values& gradient, const NormGradients& gradients) {
  const std::int64_t channels = shape.channels;
  std::vector<double> parts(static_cast<std::size_t>(shape.samples * 2 * channels));
#pragma omp parallel for schedule(static)
  for (std::int64_t index = 0; index < shape.samples; ++index) {
    Sample sample(shape, index);
    SetRow(sample, index, weight_bias, statistics);
    const Row row{sample.Numbers(0), sample.Numbers(1), sample.Numbers(2)};
    const auto before = [&](std::int64_t at, std::int64_t rows, const float* values) {
      const float* given = Read(gradient, at, rows * channels, sample.RoomOf(1));
      if (!silu) return given;
      BeforeSilu(rows, channels, values, row, given, sample.RoomOf(2));
      return static_cast<const float*>(sample.RoomOf(2));
    };
    sample.Sum([&](std::int64_t at, std::int64_t rows) {
      const float* values = Read(x, at, rows * channels, sample.RoomOf(0));
      float* sums[2] = {sample.sums.data(), sample.sums.data() + channels};
      AddGradients(rows, channels, values, row.mean, before(at, rows, values), sums);
    });
    SetBack(sample, index, weight_bias[0], statistics);
    for (std::int64_t c = 0; c < 2 * channels; ++c) {
      const double inverse = static_cast<double>(statistics.inverse_deviation[index * shape.groups + c % channels / sample.width]);
      parts[static_cast<std::size_t>(index * 2 * channels + c)] = sample.totals[static_cast<std::size_t>(c)] * (c < channels ? 1 : inverse);
    }
    const Back back{row.mean, row.factor, sample.Numbers(3), sample.Numbers(4)};
    sample.Each([&](std::int64_t at, std::int64_t rows) {
      const float* values = Read(x, at, rows * channels, sample.RoomOf(0));
      const float* inner = before(at, rows, values);
      float* to = Room(gradients.x, at, sample.RoomOf(1));
      ApplyBack(rows, channels, values, inner, back, to);
      Written(gradients.x, at, rows * channels, to);
    });
  }
  AddParts(channels, parts, gradients);
}

namespace {

constexpr std::int64_t kLayerRows = 64;  ///< whose gradients are summed as floats

EVAC_EACH_PROCESSOR void LayerRow(std::int64_t channels, const float* x, const float* weight_bias[2], double epsilon,
                                  float* statistics, float* y) {
  float sum = 0, squares = 0;
#pragma omp simd reduction(+ : sum)
  for (std::int64_t c = 0; c < channels; ++c) sum += x[c];
  const float mean = sum / static_cast<float>(channels);
#pragma omp simd reduction(+ : squares)
  for (std::int64_t c = 0; c < channels; ++c) squares += (x[c] - mean) * (x[c] - mean);
  const float inverse = 1.0F / std::sqrt(squares / static_cast<float>(channels) + static_cast<float>(epsilon));
  const float *weight = weight_bias[0], *bias = weight_bias[1];
#pragma omp simd
  for (std::int64_t c = 0; c < channels; ++c) y[c] = (x[c] - mean) * inverse * weight[c] + bias[c];
  statistics[0] = mean;
  statistics[1] = inverse;
}

EVAC_EACH_PROCESSOR void LayerRowBack(std::int64_t channels, const float* x, const float* weight, const float* statistics,
                                      const float* gradient, float* sums, float* dx) {
  const float mean = statistics[0], inverse = statistics[1];
  float plain = 0, times_x = 0;
#pragma omp simd reduction(+ : plain, times_x)
  for (std::int64_t c = 0; c < channels; ++c) {
    const float hat = (x[c] - mean) * inverse, g = gradient[c] * weight[c];
    sums[c] += gradient[c];
    sums[channels + c] += gradient[c] * hat;
    plain += g;
    times_x += g * hat;
  }
  const float offset = plain / static_cast<float>(channels), slope = times_x / static_cast<float>(channels);
#pragma omp simd
  for (std::int64_t c = 0; c < channels; ++c)
    dx[c] = inverse * (gradient[c] * weight[c] - offset - (x[c] - mean) * inverse * slope);
}

}  // namespace

void LayerNormForward(const NormShape& shape, const Values& x, const float* weight_bias[2],
                      const NormStatistics& statistics, const Values& y) {
  const std::int64_t channels = shape.channels;
#pragma omp parallel for schedule(static)
  for (std::int64_t from = 0; from < shape.rows; from += kLayerRows) {
    const std::int64_t rows = std::min(kLayerRows, shape.rows - from), at = from * channels;
    std::vector<float> room(static_cast<std::size_t>(2 * rows * channels));
    const float* values = Read(x, at, rows * channels, room.data());
    float* to = Room(y, at, room.data() + rows * channels);
    for (std::int64_t r = 0; r < rows; ++r) {
      float kept[2];
      LayerRow(channels, values + r * channels, weight_bias, shape.epsilon, kept, to + r * channels);
      statistics.mean[from + r] = kept[0];
      statistics.inverse_deviation[from + r] = kept[1];
    }
    Written(y, at, rows * channels, to);
  }
}

void LayerNormBackward(const NormShape& shape, const Values& x, const float* weight, const NormStatistics& statistics,
                       const Values& gradient, const NormGradients& gradients) {
  const std::int64_t channels = shape.channels, blocks = (shape.rows + kLayerRows - 1) / kLayerRows;
  std::vector<double> parts(static_cast<std::size_t>(blocks * 2 * channels));
#pragma omp parallel for schedule(static)
  for (std::int64_t block = 0; block < blocks; ++block) {
    const std::int64_t from = block * kLayerRows, rows = std::min(kLayerRows, shape.rows - from), at = from * channels;
    const std::int64_t count = rows * channels;
    std::vector<float> room(static_cast<std::size_t>(3 * count)), sums(static_cast<std::size_t>(2 * channels));
    const float *values = Read(x, at, count, room.data()), *given = Read(gradient, at, count, room.data() + count);
    float* to = Room(gradients.x, at, room.data() + 2 * count);
    for (std::int64_t r = 0; r < rows; ++r) {
      const float kept[2] = {statistics.mean[from + r], statistics.inverse_deviation[from + r]};
      LayerRowBack(channels, values + r * channels, weight, kept, given + r * channels, sums.data(), to + r * channels);
    }
    Written(gradients.x, at, count, to);
    std::copy(sums.begin(), sums.end(), parts.begin() + block * 2 * channels);
  }
  AddParts(channels, parts, gradients);
}

}  // namespace evac::nn::kernels
