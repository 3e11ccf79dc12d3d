#pragma once

#include <cstdint>
#include <optional>

#include "worldmodel/nn/parameters.h"
#include "worldmodel/nn/tensor.h"

/// The small layers. Channels are always the last and fastest axis: [N, H, W, C] for pictures, [N, L, C] for tokens.
/// So a linear layer is one matrix product, convolutions run channels-last, and a picture is tokens without a copy.
namespace evac::nn {

/// Whether x may go through `kernels`: floats on the CPU, laid out as they are read, nothing to be differentiated.
bool CanUseKernels(const Tensor& x);

/// A model in bf16 or f16 keeps the weights of its matrix products so and computes the products in it; everything
/// between them stays in floats, and so do small weights on every device: these.
Tensor Precise(const Tensor& weight);

/// The type in which a layer's product is computed, where it is not that of its weight.
using ProductType = std::optional<at::ScalarType>;

class Linear {
 public:
  enum class Bias { kNo, kYes };
  Linear(const Scope& at, std::int64_t in, std::int64_t out, Bias bias = Bias::kYes);
  /// A 1x1 convolution: its weight has `extra_sides` more sides of 1, as it lies in the checkpoint.
  static Linear Pointwise(const Scope& at, std::int64_t in, std::int64_t out, std::int64_t extra_sides);
  /// [..., in] → [..., out]
  Tensor operator()(const Tensor& x) const;

  Tensor weight;  ///< [out, in]
  Tensor bias;    ///< [out] or undefined

 private:
  Linear() = default;
  ProductType product_;
};

/// A convolution over the picture.
class Conv2d {
 public:
  struct Options {
    std::int64_t kernel = 3;
    std::int64_t stride = 1;
    std::int64_t padding = 1;
  };
  Conv2d(const Scope& at, std::int64_t in, std::int64_t out, const Options& options);
  Conv2d(const Scope& at, std::int64_t in, std::int64_t out) : Conv2d(at, in, out, Options{}) {}
  /// [N, H, W, in] → [N, H', W', out]
  Tensor operator()(const Tensor& x) const;

  Tensor weight;  ///< [out, in, kernel, kernel]
  Tensor bias;    ///< [out]

 private:
  bool CanUseKernel(const Tensor& x, const Tensor& kernel) const;

  Options options_;
  ProductType product_;
};

/// A convolution over time that sees the frame itself and the two before it; the first frame stands in for those
/// before the first (the reference's causal 3x1x1 convolution).
class CausalConv {
 public:
  CausalConv(const Scope& at, std::int64_t channels);
  /// [N, T, L, C] → [N, T, L, C]
  Tensor operator()(const Tensor& x) const;

  Tensor weight;  ///< [C, C, 3, 1, 1]
  Tensor bias;    ///< [C]

 private:
  ProductType product_;
};

enum class Activation { kNone, kSilu };

/// 32 groups of channels, statistics over everything but the first axis.
class GroupNorm {
 public:
  GroupNorm(const Scope& at, std::int64_t channels, double epsilon);
  /// [N, ..., C] → the same, activated.
  Tensor operator()(const Tensor& x, Activation activation) const;

  Tensor weight, bias;  ///< [C]

 private:
  double epsilon_;
};

/// Over the last axis, epsilon 1e-5.
class LayerNorm {
 public:
  LayerNorm(const Scope& at, std::int64_t channels);
  Tensor operator()(const Tensor& x) const;

  Tensor weight, bias;  ///< [C]
};

/// [N, H, W, C] → [N, 2H, 2W, C], each pixel four times.
Tensor UpsampleNearest(const Tensor& x);

}  // namespace evac::nn
