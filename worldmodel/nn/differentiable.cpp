#include "worldmodel/nn/differentiable.h"

#include <ATen/ops/empty_like.h>
#include <ATen/record_function.h>
#include <torch/csrc/autograd/custom_function.h>

#include "worldmodel/nn/conv_kernel.h"
#include "worldmodel/nn/train_kernels.h"

namespace evac::nn {
namespace {

using torch::autograd::AutogradContext;
using torch::autograd::Function;
using Tensors = torch::autograd::variable_list;

kernels::Values ValuesOf(const Tensor& x) { return {x.data_ptr(), x.scalar_type() == at::kBFloat16}; }

at::TensorOptions Floats() { return at::TensorOptions().dtype(at::kFloat); }

kernels::NormShape GroupShape(const Tensor& x, std::int64_t groups, double epsilon) {
  const std::int64_t channels = x.size(-1);
  return {x.size(0), x.numel() / x.size(0) / channels, channels, groups, epsilon};
}

/// A gradient in the layout and the type of what it is the gradient of.
Tensor Matching(const Tensor& gradient, const Tensor& value) { return gradient.to(value.scalar_type()).contiguous(); }

struct GroupNormFunction : Function<GroupNormFunction> {
  static Tensor forward(AutogradContext* context, const Tensor& x, const Tensor& weight, const Tensor& bias,
                        std::int64_t groups, double epsilon, bool silu) {
    const kernels::NormShape shape = GroupShape(x, groups, epsilon);
    Tensor y = at::empty_like(x), mean = at::empty({shape.samples, groups}, Floats()), inverse = at::empty_like(mean);
    const float* weight_bias[2] = {weight.data_ptr<float>(), bias.data_ptr<float>()};
    kernels::GroupNormForward(shape, ValuesOf(x), weight_bias, silu, {mean.data_ptr<float>(), inverse.data_ptr<float>()},
                              ValuesOf(y));
    context->save_for_backward({x, weight, bias, mean, inverse});
    context->saved_data["groups"] = groups;
    context->saved_data["epsilon"] = epsilon;
    context->saved_data["silu"] = silu;
    return y;
  }
  static Tensors backward(AutogradContext* context, const Tensors& gradients) {
    const Tensors saved = context->get_saved_variables();
    const Tensor &x = saved[0], &weight = saved[1], gradient = Matching(gradients[0], x);
    const kernels::NormShape shape =
        GroupShape(x, context->saved_data["groups"].toInt(), context->saved_data["epsilon"].toDouble());
    Tensor dx = at::empty_like(x), dweight = at::empty_like(weight), dbias = at::empty_like(weight);
    const float* weight_bias[2] = {weight.data_ptr<float>(), saved[2].data_ptr<float>()};
    kernels::GroupNormBackward(shape, ValuesOf(x), weight_bias, context->saved_data["silu"].toBool(),
                               {saved[3].data_ptr<float>(), saved[4].data_ptr<float>()}, ValuesOf(gradient),
                               {ValuesOf(dx), dweight.data_ptr<float>(), dbias.data_ptr<float>()});
    return {dx, dweight, dbias, {}, {}, {}};
  }
};

kernels::NormShape LayerShape(const Tensor& x, double epsilon) {
  return {1, x.numel() / x.size(-1), x.size(-1), 1, epsilon};
}

struct LayerNormFunction : Function<LayerNormFunction> {
  static Tensor forward(AutogradContext* context, const Tensor& x, const Tensor& weight, const Tensor& bias,
                        double epsilon) {
    const kernels::NormShape shape = LayerShape(x, epsilon);
    Tensor y = at::empty_like(x), mean = at::empty({shape.rows}, Floats()), inverse = at::empty_like(mean);
    const float* weight_bias[2] = {weight.data_ptr<float>(), bias.data_ptr<float>()};
    kernels::LayerNormForward(shape, ValuesOf(x), weight_bias, {mean.data_ptr<float>(), inverse.data_ptr<float>()},
                              ValuesOf(y));
    context->save_for_backward({x, weight, mean, inverse});
    return y;
  }
  static Tensors backward(AutogradContext* context, const Tensors& gradients) {
    const Tensors saved = context->get_saved_variables();
    const Tensor &x = saved[0], &weight = saved[1], gradient = Matching(gradients[0], x);
    Tensor dx = at::empty_like(x), dweight = at::empty_like(weight), dbias = at::empty_like(weight);
    kernels::LayerNormBackward(LayerShape(x, 0), ValuesOf(x), weight.data_ptr<float>(),
                               {saved[2].data_ptr<float>(), saved[3].data_ptr<float>()}, ValuesOf(gradient),
                               {ValuesOf(dx), dweight.data_ptr<float>(), dbias.data_ptr<float>()});
    return {dx, dweight, dbias, {}};
  }
};

struct GatedGeluFunction : Function<GatedGeluFunction> {
  static Tensor forward(AutogradContext* context, const Tensor& x) {
    std::vector<std::int64_t> shape = x.sizes().vec();
    const std::int64_t half = shape.back() /= 2;
    Tensor y = at::empty(shape, x.options());
    kernels::GatedGeluForward(y.numel() / half, half, ValuesOf(x), ValuesOf(y));
    context->save_for_backward({x});
    return y;
  }
  static Tensors backward(AutogradContext* context, const Tensors& gradients) {
    const Tensor x = context->get_saved_variables()[0], gradient = Matching(gradients[0], x);
    Tensor dx = at::empty_like(x);
    const std::int64_t half = x.size(-1) / 2;
    kernels::GatedGeluBackward(gradient.numel() / half, half, ValuesOf(x), ValuesOf(gradient), ValuesOf(dx));
    return {dx};
  }
};

struct AttentionFunction : Function<AttentionFunction> {
  static kernels::SmallAttentionShape Shape(const Tensor& q, const Tensor& k, std::int64_t heads) {
    return {q.size(0), q.size(2), q.size(1), k.size(1), heads, q.size(3) / heads};
  }
  static Tensor forward(AutogradContext* context, const Tensor& q, const Tensor& k, const Tensor& v, std::int64_t heads) {
    const kernels::SmallAttentionShape shape = Shape(q, k, heads);
    Tensor y = at::empty_like(q);
    Tensor weights = at::empty({shape.outer, shape.inner, heads, shape.queries, shape.keys}, Floats());
    kernels::SmallAttentionForward(shape, {ValuesOf(q), ValuesOf(k), ValuesOf(v), ValuesOf(y), weights.data_ptr<float>()});
    context->save_for_backward({q, k, v, weights});
    context->saved_data["heads"] = heads;
    return y;
  }
  static Tensors backward(AutogradContext* context, const Tensors& gradients) {
    const Tensors saved = context->get_saved_variables();
    const Tensor &q = saved[0], &k = saved[1], &v = saved[2], gradient = Matching(gradients[0], q);
    Tensor dq = at::empty_like(q), dk = at::empty_like(k), dv = at::empty_like(v);
    kernels::SmallAttentionBackward(Shape(q, k, context->saved_data["heads"].toInt()),
                                    {ValuesOf(q), ValuesOf(k), ValuesOf(v), {}, saved[3].data_ptr<float>()},
                                    {ValuesOf(gradient), ValuesOf(dq), ValuesOf(dk), ValuesOf(dv)});
    return {dq, dk, dv, {}};
  }
};

Tensor Convolved(const Tensor& x, const Tensor& weight, const float* bias) {
  const kernels::ConvShape shape{x.size(0), x.size(1), x.size(2), x.size(3), weight.size(0)};
  Tensor y = at::empty({shape.samples, shape.height, shape.width, shape.out}, x.options());
  kernels::Conv3x3(shape, x.data_ptr<float>(), weight.data_ptr<float>(), bias, y.data_ptr<float>());
  return y;
}

struct ConvFunction : Function<ConvFunction> {
  static Tensor forward(AutogradContext* context, const Tensor& x, const Tensor& weight, const Tensor& bias) {
    context->save_for_backward({x, weight});
    return Convolved(x, weight, bias.data_ptr<float>());
  }
  static Tensors backward(AutogradContext* context, const Tensors& gradients) {
    const Tensors saved = context->get_saved_variables();
    const Tensor &x = saved[0], &weight = saved[1], gradient = Matching(gradients[0], x);
    Tensor dx, dweight, dbias;
    if (context->needs_input_grad(0))
      dx = Convolved(gradient, weight.flip({2, 3}).transpose(0, 1).contiguous(), nullptr);
    if (context->needs_input_grad(1)) {
      dweight = at::empty_like(weight);
      kernels::Conv3x3WeightGradient({x.size(0), x.size(1), x.size(2), x.size(3), weight.size(0)}, x.data_ptr<float>(),
                                     gradient.data_ptr<float>(), dweight.data_ptr<float>());
    }
    if (context->needs_input_grad(2)) dbias = gradient.sum({0, 1, 2});
    return {dx, dweight, dbias};
  }
};

struct CausalPadFunction : Function<CausalPadFunction> {
  static Tensor forward(AutogradContext*, const Tensor& x) {
    const Tensor first = x.narrow(1, 0, 1);
    return at::cat({first, first, x}, 1);
  }
  static Tensors backward(AutogradContext*, const Tensors& gradients) {
    const Tensor& gradient = gradients[0];
    Tensor dx = gradient.narrow(1, 2, gradient.size(1) - 2).clone(at::MemoryFormat::Contiguous);
    dx.narrow(1, 0, 1).add_(gradient.narrow(1, 0, 1)).add_(gradient.narrow(1, 1, 1));
    return {dx};
  }
};

}  // namespace

bool HasFastGradient(const Tensor& x) {
  return x.is_cpu() && (x.scalar_type() == at::kFloat || x.scalar_type() == at::kBFloat16);
}

Tensor FastGroupNorm(const Tensor& x, const Tensor& weight, const Tensor& bias, const NormOptions& options) {
  return GroupNormFunction::apply(x.contiguous(), weight, bias, options.groups, options.epsilon, options.silu);
}

Tensor FastLayerNorm(const Tensor& x, const Tensor& weight, const Tensor& bias, double epsilon) {
  return LayerNormFunction::apply(x.contiguous(), weight, bias, epsilon);
}

Tensor FastGatedGelu(const Tensor& x) { return GatedGeluFunction::apply(x.contiguous()); }

Tensor FastAttention(const Tensor& q, const Tensor& k, const Tensor& v, std::int64_t heads) {
  return AttentionFunction::apply(q.contiguous(), k.contiguous(), v.contiguous(), heads);
}

Tensor FastConv3x3(const Tensor& x, const Tensor& weight, const Tensor& bias) {
  RECORD_FUNCTION("evac::conv3x3", (std::vector<c10::IValue>{x, weight}));
  if (!at::GradMode::is_enabled()) return Convolved(x, weight, bias.data_ptr<float>());
  return ConvFunction::apply(x, weight, bias);
}

Tensor FastCausalPad(const Tensor& x) { return CausalPadFunction::apply(x); }

}  // namespace evac::nn
