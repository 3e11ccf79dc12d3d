#include "worldmodel/nn/layers.h"

#include <ATen/record_function.h>

#include "worldmodel/nn/differentiable.h"
#include "worldmodel/nn/kernels.h"

namespace evac::nn {
namespace {

constexpr std::int64_t kGroups = 32;
constexpr double kLayerNormEpsilon = 1e-5;

/// Weights may be kept in half the bytes, with everything else in floats: x in the type of the weight.
Tensor InTypeOf(const Tensor& weight, const Tensor& x) { return x.to(weight.scalar_type()); }

/// A weight or bias in the type of the product.
Tensor ForProduct(const ProductType& product, const Tensor& weight) {
  return product && weight.defined() ? weight.to(*product) : weight;
}

/// x weightᵀ + bias of rows [N, in] as a convolution of one pixel in this many pictures: libtorch hands most of them to
/// oneDNN, whose products are faster here than those of the BLAS that at::linear calls (docs/performance.md).
Tensor AsConvolution(const Tensor& rows, std::int64_t pictures, const Tensor& weight, const Tensor& bias) {
  const std::int64_t in = weight.size(1), out = weight.size(0), n = rows.size(0);
  const Tensor pixels = rows.view({pictures, n / pictures, 1, in}).permute({0, 3, 1, 2});  // channels last, as x lies
  return at::conv2d(pixels, weight.view({out, in, 1, 1}), bias).permute({0, 2, 3, 1}).contiguous().view({n, out});
}

/// The same for rows of any number, each rounded the same whatever is beside it: a scene among others is to be the
/// scene alone. On one thread libtorch hands convolutions of one pixel to oneDNN from 16 pictures on, so rows are added
/// to make it so; its BLAS sums few rows and many in different orders.
Tensor EachRowAlike(const Tensor& rows, const Tensor& weight, const Tensor& bias) {
  constexpr std::int64_t kPictures = 16;
  const std::int64_t n = rows.size(0), missing = (kPictures - n % kPictures) % kPictures;
  const Tensor whole = missing == 0 ? rows : at::cat({rows, rows.new_zeros({missing, rows.size(1)})});
  return AsConvolution(whole, kPictures, weight, bias).narrow(0, 0, n);
}

bool IsFloatsInARow(const Tensor& x) { return x.is_cpu() && x.scalar_type() == at::kFloat && x.is_contiguous(); }

/// What training needs: differentiable, exact for pictures of one colour too.
Tensor DifferentiableGroupNorm(const Tensor& x, const GroupNorm& norm, double epsilon) {
  const Tensor channels_second = x.reshape({x.size(0), -1, x.size(-1)}).transpose(1, 2).contiguous();
  return at::group_norm(channels_second, kGroups, norm.weight, norm.bias, epsilon).transpose(1, 2).reshape(x.sizes());
}

}  // namespace

Tensor Precise(const Tensor& weight) {
  const bool is_halved = weight.scalar_type() == at::kBFloat16 || weight.scalar_type() == at::kHalf;
  return is_halved ? weight.to(at::kFloat) : weight;
}

bool CanUseKernels(const Tensor& x) {
  return !at::GradMode::is_enabled() && IsFloatsInARow(x);
}

Linear::Linear(const Scope& at, std::int64_t in, std::int64_t out, Bias with_bias) : product_(at.ProductType()) {
  weight = at.Take("weight", {out, in});
  if (with_bias == Bias::kYes) bias = at.Take("bias", {out});
}

Linear Linear::Pointwise(const Scope& at, std::int64_t in, std::int64_t out, std::int64_t extra_sides) {
  Linear linear;
  linear.product_ = at.ProductType();
  std::vector<std::int64_t> shape = {out, in};
  shape.resize(2 + static_cast<std::size_t>(extra_sides), 1);
  linear.weight = at.Take("weight", shape);
  linear.bias = at.Take("bias", {out});
  return linear;
}

Tensor Linear::operator()(const Tensor& x) const {
  constexpr std::int64_t kManyRows = 512;
  const Tensor matrix = ForProduct(product_, weight.dim() > 2 ? weight.flatten(1) : weight);
  const Tensor addend = ForProduct(product_, bias);
  const bool is_in_floats = x.is_cpu() && x.scalar_type() == at::kFloat && matrix.scalar_type() == at::kFloat;
  const bool is_trained = at::GradMode::is_enabled();
  const bool is_large = x.is_contiguous() && x.numel() >= kManyRows * x.size(-1);
  if (!is_in_floats || x.numel() == 0 || (is_trained && !is_large))
    return at::linear(InTypeOf(matrix, x), matrix, addend).to(x.scalar_type());
  std::vector<std::int64_t> shape = x.sizes().vec();
  shape.back() = matrix.size(0);
  const Tensor rows = x.contiguous().view({-1, x.size(-1)});
  return (is_trained ? AsConvolution(rows, 1, matrix, addend) : EachRowAlike(rows, matrix, addend)).view(shape);
}

Conv2d::Conv2d(const Scope& at, std::int64_t in, std::int64_t out, const Options& options)
    : weight(at.Take("weight", {out, in, options.kernel, options.kernel})),
      bias(at.Take("bias", {out})),
      options_(options),
      product_(at.ProductType()) {}

/// Whatever the number of pictures: scenes together are to be the same as each alone.
bool Conv2d::CanUseKernel(const Tensor& x, const Tensor& kernel) const {
  constexpr std::int64_t kSmallest = 4;  // a tile
  const bool is_of_kind = options_.kernel == 3 && options_.stride == 1 && options_.padding == 1;
  const bool is_in_floats = IsFloatsInARow(x) && IsFloatsInARow(kernel) && IsFloatsInARow(bias);
  return is_of_kind && is_in_floats && x.dim() == 4 && x.size(1) >= kSmallest && x.size(2) >= kSmallest &&
         x.size(3) == kernel.size(1);
}

Tensor Conv2d::operator()(const Tensor& x) const {
  const Tensor kernel = ForProduct(product_, weight);
  if (CanUseKernel(x, kernel)) return FastConv3x3(x, kernel, bias);
  const Tensor channels_second = InTypeOf(kernel, x).permute({0, 3, 1, 2});
  const Tensor y = at::conv2d(channels_second, kernel, ForProduct(product_, bias), options_.stride, options_.padding);
  return y.permute({0, 2, 3, 1}).contiguous().to(x.scalar_type());
}

CausalConv::CausalConv(const Scope& at, std::int64_t channels)
    : weight(at.Take("weight", {channels, channels, 3, 1, 1})),
      bias(at.Take("bias", {channels})),
      product_(at.ProductType()) {}

Tensor CausalConv::operator()(const Tensor& x) const {
  const Tensor kernel = ForProduct(product_, weight.flatten(3));  // (3, 1)
  Tensor padded = FastCausalPad(InTypeOf(kernel, x));             // [N, T + 2, L, C]
  // libtorch hands one picture of so few numbers to another library than two: a scene among others is to be the scene
  // alone.
  constexpr std::int64_t kFewNumbers = 20480;
  const bool is_small = padded.size(0) == 1 && padded.numel() <= kFewNumbers;
  if (is_small && CanUseKernels(padded)) padded = at::cat({padded, padded});
  const Tensor y = at::conv2d(padded.permute({0, 3, 1, 2}), kernel, ForProduct(product_, bias)).narrow(0, 0, x.size(0));
  return y.permute({0, 2, 3, 1}).contiguous().to(x.scalar_type());
}

GroupNorm::GroupNorm(const Scope& at, std::int64_t channels, double epsilon)
    : weight(Precise(at.Take("weight", {channels}))), bias(Precise(at.Take("bias", {channels}))), epsilon_(epsilon) {}

Tensor GroupNorm::operator()(const Tensor& x, Activation activation) const {
  RECORD_FUNCTION("evac::group_norm", {});
  const bool silu = activation == Activation::kSilu;
  if (!CanUseKernels(x)) {
    if (HasFastGradient(x)) return FastGroupNorm(x, weight, bias, {kGroups, epsilon_, silu});
    const Tensor y = DifferentiableGroupNorm(x.to(weight.scalar_type()), *this, epsilon_).to(x.scalar_type());
    return silu ? at::silu(y) : y;
  }
  Tensor y = at::empty(x.sizes(), x.options());
  const std::int64_t channels = x.size(-1);
  const kernels::NormShape shape{x.size(0), x.numel() / x.size(0) / channels, channels, kGroups, epsilon_};
  kernels::GroupNorm(shape, x.data_ptr<float>(), weight.data_ptr<float>(), bias.data_ptr<float>(), silu,
                     y.data_ptr<float>());
  return y;
}

LayerNorm::LayerNorm(const Scope& at, std::int64_t channels)
    : weight(Precise(at.Take("weight", {channels}))), bias(Precise(at.Take("bias", {channels}))) {}

Tensor LayerNorm::operator()(const Tensor& x) const {
  if (x.scalar_type() == at::kBFloat16 && HasFastGradient(x)) return FastLayerNorm(x, weight, bias, kLayerNormEpsilon);
  const Tensor y = at::layer_norm(x.to(weight.scalar_type()), weight.sizes(), weight, bias, kLayerNormEpsilon);
  return y.to(x.scalar_type());
}

Tensor UpsampleNearest(const Tensor& x) {
  const std::int64_t n = x.size(0), h = x.size(1), w = x.size(2), c = x.size(3);
  return x.reshape({n, h, 1, w, 1, c}).expand({n, h, 2, w, 2, c}).reshape({n, 2 * h, 2 * w, c});
}

}  // namespace evac::nn
