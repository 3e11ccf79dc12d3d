#include <algorithm>
#include <cmath>
#include <vector>

#include "worldmodel/nn/float_math.h"
#include "worldmodel/nn/processors.h"
#include "worldmodel/nn/train_memory.h"

namespace evac::nn::kernels {
namespace {

constexpr std::int64_t kRows = 4, kColumns = 16;  ///< what is kept in registers

std::int64_t Padded(std::int64_t count, std::int64_t multiple) { return (count + multiple - 1) / multiple * multiple; }

/// A matrix whose rows and columns are filled up with zeros to what Multiply wants.
struct Matrix {
  Matrix(std::int64_t r, std::int64_t c)
      : rows(Padded(r, kRows)), stride(Padded(c, kColumns)), values(static_cast<std::size_t>(rows * stride)) {}
  float* Row(std::int64_t row) { return values.data() + row * stride; }
  const float* Row(std::int64_t row) const { return values.data() + row * stride; }
  std::int64_t rows, stride;
  std::vector<float> values;
};

/// c = a b, of which `inner` columns of a and rows of b count.
EVAC_EACH_PROCESSOR void Multiply(const Matrix& a, const Matrix& b, std::int64_t inner, Matrix& c) {
  for (std::int64_t i = 0; i < c.rows; i += kRows) {
    const float* rows = a.values.data() + i * a.stride;
    for (std::int64_t j = 0; j < c.stride; j += kColumns) {
      float sums[kRows][kColumns] = {};
      for (std::int64_t p = 0; p < inner; ++p) {
        const float* column = b.values.data() + p * b.stride + j;
        for (std::int64_t r = 0; r < kRows; ++r) {
          const float factor = rows[r * a.stride + p];
#pragma omp simd
          for (std::int64_t x = 0; x < kColumns; ++x) sums[r][x] += factor * column[x];
        }
      }
      for (std::int64_t r = 0; r < kRows; ++r)
        std::copy(sums[r], sums[r] + kColumns, c.values.data() + (i + r) * c.stride + j);
    }
  }
}

void Transpose(const Matrix& from, std::int64_t rows, std::int64_t columns, Matrix& to) {
  for (std::int64_t i = 0; i < rows; ++i) {
    for (std::int64_t j = 0; j < columns; ++j) to.Row(j)[i] = from.Row(i)[j];
  }
}

EVAC_EACH_PROCESSOR void Softmax(std::int64_t count, float scale, float* scores) {
  float largest = -INFINITY, total = 0;
#pragma omp simd reduction(max : largest)
  for (std::int64_t j = 0; j < count; ++j) largest = std::max(largest, scores[j]);
#pragma omp simd reduction(+ : total)
  for (std::int64_t j = 0; j < count; ++j) {
    scores[j] = Exponential((scores[j] - largest) * scale);
    total += scores[j];
  }
  const float factor = 1.0F / total;
#pragma omp simd
  for (std::int64_t j = 0; j < count; ++j) scores[j] *= factor;
}

/// The gradient of the scores, from that of the weights; times scale.
EVAC_EACH_PROCESSOR void SoftmaxBack(std::int64_t count, float scale, const float* weights, float* gradient) {
  float mean = 0;
#pragma omp simd reduction(+ : mean)
  for (std::int64_t j = 0; j < count; ++j) mean += weights[j] * gradient[j];
#pragma omp simd
  for (std::int64_t j = 0; j < count; ++j) gradient[j] = weights[j] * (gradient[j] - mean) * scale;
}

/// One attention of many: which tokens.
struct Place {
  const SmallAttentionShape& shape;
  std::int64_t outer, inner, head;
  std::int64_t At(std::int64_t tokens, std::int64_t token) const {
    return ((outer * tokens + token) * shape.inner + inner) * shape.Row() + head * shape.width;
  }
  std::int64_t WeightsAt() const {
    return ((outer * shape.inner + inner) * shape.heads + head) * shape.queries * shape.keys;
  }
};

void Gather(const Values& from, const Place& at, std::int64_t tokens, Matrix& to) {
  for (std::int64_t token = 0; token < tokens; ++token) {
    float* row = to.Row(token);
    const float* values = Read(from, at.At(tokens, token), at.shape.width, row);
    if (values != row) std::copy(values, values + at.shape.width, row);
  }
}

void Scatter(const Matrix& from, const Place& at, std::int64_t tokens, const Values& to) {
  for (std::int64_t token = 0; token < tokens; ++token) {
    const std::int64_t first = at.At(tokens, token);
    if (to.bf16) {
      Written(to, first, at.shape.width, from.Row(token));
    } else {
      std::copy(from.Row(token), from.Row(token) + at.shape.width, static_cast<float*>(to.at) + first);
    }
  }
}

/// Calls function(place, room) for each attention and head; `Scratch` is one thread's room.
template <typename Scratch, typename Function>
void ForEach(const SmallAttentionShape& shape, Function function) {
#pragma omp parallel
  {
    Scratch room(shape);
#pragma omp for schedule(static)
    for (std::int64_t i = 0; i < shape.outer * shape.inner; ++i) {
      for (std::int64_t head = 0; head < shape.heads; ++head)
        function(Place{shape, i / shape.inner, i % shape.inner, head}, room);
    }
  }
}

struct ForwardRoom {
  explicit ForwardRoom(const SmallAttentionShape& s)
      : q(s.queries, s.width), k(s.keys, s.width), v(s.keys, s.width), k_turned(s.width, s.keys),
        weights(s.queries, s.keys), y(s.queries, s.width) {}
  Matrix q, k, v, k_turned, weights, y;
};

struct BackwardRoom {
  explicit BackwardRoom(const SmallAttentionShape& s)
      : q(s.queries, s.width), k(s.keys, s.width), v(s.keys, s.width), v_turned(s.width, s.keys),
        weights(s.queries, s.keys), turned(s.keys, s.queries), scores(s.queries, s.keys), y(s.queries, s.width),
        q_back(s.queries, s.width), k_back(s.keys, s.width) {}
  Matrix q, k, v, v_turned, weights, turned, scores, y, q_back, k_back;
};

float Scale(const SmallAttentionShape& shape) { return 1.0F / std::sqrt(static_cast<float>(shape.width)); }

}  // namespace

void SmallAttentionForward(const SmallAttentionShape& shape, const AttentionTensors& tensors) {
  ForEach<ForwardRoom>(shape, [&](const Place& at, ForwardRoom& room) {
    Gather(tensors.q, at, shape.queries, room.q);
    Gather(tensors.k, at, shape.keys, room.k);
    Gather(tensors.v, at, shape.keys, room.v);
    Transpose(room.k, shape.keys, shape.width, room.k_turned);
    Multiply(room.q, room.k_turned, shape.width, room.weights);
    float* kept = tensors.weights + at.WeightsAt();
    for (std::int64_t i = 0; i < shape.queries; ++i) {
      Softmax(shape.keys, Scale(shape), room.weights.Row(i));
      std::copy(room.weights.Row(i), room.weights.Row(i) + shape.keys, kept + i * shape.keys);
    }
    Multiply(room.weights, room.v, shape.keys, room.y);
    Scatter(room.y, at, shape.queries, tensors.y);
  });
}

void SmallAttentionBackward(const SmallAttentionShape& shape, const AttentionTensors& tensors,
                            const AttentionGradients& gradients) {
  ForEach<BackwardRoom>(shape, [&](const Place& at, BackwardRoom& room) {
    Gather(tensors.q, at, shape.queries, room.q);
    Gather(tensors.k, at, shape.keys, room.k);
    Gather(tensors.v, at, shape.keys, room.v);
    Gather(gradients.y, at, shape.queries, room.y);
    const float* kept = tensors.weights + at.WeightsAt();
    for (std::int64_t i = 0; i < shape.queries; ++i)
      std::copy(kept + i * shape.keys, kept + (i + 1) * shape.keys, room.weights.Row(i));
    Transpose(room.weights, shape.queries, shape.keys, room.turned);
    Multiply(room.turned, room.y, shape.queries, room.k_back);  // of v
    Scatter(room.k_back, at, shape.keys, gradients.v);
    Transpose(room.v, shape.keys, shape.width, room.v_turned);
    Multiply(room.y, room.v_turned, shape.width, room.scores);
    for (std::int64_t i = 0; i < shape.queries; ++i)
      SoftmaxBack(shape.keys, Scale(shape), room.weights.Row(i), room.scores.Row(i));
    Multiply(room.scores, room.k, shape.keys, room.q_back);
    Scatter(room.q_back, at, shape.queries, gradients.q);
    Transpose(room.scores, shape.queries, shape.keys, room.turned);
    Multiply(room.turned, room.q, shape.queries, room.k_back);
    Scatter(room.k_back, at, shape.keys, gradients.k);
  });
}

namespace {

constexpr std::int64_t kGateBlock = 16;  ///< rows

EVAC_EACH_PROCESSOR void Gate(std::int64_t half, const float* x, float* y) {
#pragma omp simd
  for (std::int64_t c = 0; c < half; ++c)
    y[c] = x[c] * 0.5F * x[half + c] * (1.0F + ErrorFunction(x[half + c] * 0.70710678F));
}

EVAC_EACH_PROCESSOR void GateBack(std::int64_t half, const float* x, const float* gradient, float* dx) {
#pragma omp simd
  for (std::int64_t c = 0; c < half; ++c) {
    const float gate = x[half + c], normal = 0.5F * (1.0F + ErrorFunction(gate * 0.70710678F));
    const float density = 0.39894228F * MildExponential(-0.5F * gate * gate);
    dx[c] = gradient[c] * gate * normal;
    dx[half + c] = gradient[c] * x[c] * (normal + gate * density);
  }
}

}  // namespace

void GatedGeluForward(std::int64_t rows, std::int64_t half, const Values& x, const Values& y) {
#pragma omp parallel for schedule(static)
  for (std::int64_t from = 0; from < rows; from += kGateBlock) {
    const std::int64_t count = std::min(kGateBlock, rows - from);
    std::vector<float> room(static_cast<std::size_t>(3 * count * half));
    const float* values = Read(x, from * 2 * half, count * 2 * half, room.data());
    float* to = Room(y, from * half, room.data() + 2 * count * half);
    for (std::int64_t r = 0; r < count; ++r) Gate(half, values + r * 2 * half, to + r * half);
    Written(y, from * half, count * half, to);
  }
}

void GatedGeluBackward(std::int64_t rows, std::int64_t half, const Values& x, const Values& gradient,
                       const Values& x_gradient) {
#pragma omp parallel for schedule(static)
  for (std::int64_t from = 0; from < rows; from += kGateBlock) {
    const std::int64_t count = std::min(kGateBlock, rows - from);
    std::vector<float> room(static_cast<std::size_t>(5 * count * half));
    const float* values = Read(x, from * 2 * half, count * 2 * half, room.data());
    const float* given = Read(gradient, from * half, count * half, room.data() + 2 * count * half);
    float* to = Room(x_gradient, from * 2 * half, room.data() + 3 * count * half);
    for (std::int64_t r = 0; r < count; ++r) GateBack(half, values + r * 2 * half, given + r * half, to + r * 2 * half);
    Written(x_gradient, from * 2 * half, count * 2 * half, to);
  }
}

}  // namespace evac::nn::kernels
