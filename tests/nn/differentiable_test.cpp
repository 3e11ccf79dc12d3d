#include "worldmodel/nn/differentiable.h"

#include <ATen/Parallel.h>
#include <ATen/ops/conv2d.h>
#include <ATen/ops/group_norm.h>
#include <ATen/ops/layer_norm.h>
#include <gtest/gtest.h>

#include <cfenv>
#include <cmath>
#include <functional>

#include "tests/nn/support.h"
#include "worldmodel/nn/attention.h"
#include "worldmodel/nn/float_math.h"
#include "worldmodel/nn/kernels.h"

namespace evac::nn {
namespace {

using Function = std::function<Tensor(const std::vector<Tensor>&)>;

/// What a function answers, and the gradients of a weighted sum of it.
std::vector<Tensor> AnswerAndGradients(const Function& function, const std::vector<Tensor>& inputs) {
  std::vector<Tensor> leaves;
  for (const Tensor& input : inputs) leaves.push_back(input.clone().set_requires_grad(true));
  const Tensor y = function(leaves);
  std::vector<Tensor> results = {y.detach()};
  (y.to(at::kFloat) * Noise(y.sizes(), 77)).sum().backward();
  for (const Tensor& leaf : leaves) results.push_back(leaf.grad());
  return results;
}

double RelativeDifference(const Tensor& a, const Tensor& b) {
  return LargestDifference(a, b) / std::max(1e-12, b.to(at::kDouble).abs().max().item<double>());
}

/// As floats to rounding; in bf16, of which the first input is, to what bf16 can say.
void ExpectSame(const Function& fast, const Function& plain, std::vector<Tensor> inputs, std::size_t halves) {
  const std::vector<Tensor> wanted = AnswerAndGradients(plain, inputs), found = AnswerAndGradients(fast, inputs);
  for (std::size_t i = 0; i < wanted.size(); ++i) EXPECT_LT(RelativeDifference(found[i], wanted[i]), 3e-6) << i;
  for (std::size_t i = 0; i < halves; ++i) inputs[i] = inputs[i].to(at::kBFloat16);
  const std::vector<Tensor> coarse = AnswerAndGradients(fast, inputs);
  EXPECT_EQ(coarse.front().scalar_type(), at::kBFloat16);
  for (std::size_t i = 0; i < wanted.size(); ++i) EXPECT_LT(RelativeDifference(coarse[i], wanted[i]), 3e-2) << i;
}

TEST(FastGradients, OfGroupNormAreThoseOfLibtorch) {
  for (const bool silu : {false, true}) {
    const auto fast = [&](const std::vector<Tensor>& in) { return FastGroupNorm(in[0], in[1], in[2], {32, 1e-5, silu}); };
    const auto plain = [&](const std::vector<Tensor>& in) {
      const Tensor turned = in[0].flatten(1, 2).transpose(1, 2).contiguous();
      const Tensor y = at::group_norm(turned, 32, in[1], in[2], 1e-5).transpose(1, 2).reshape(in[0].sizes());
      return silu ? at::silu(y) : y;
    };
    ExpectSame(fast, plain, {Noise({3, 11, 13, 64}, 1) * 2 + 1, Noise({64}, 2) * 0.3 + 1, Noise({64}, 3)}, 1);
  }
}

TEST(FloatMath, ExponentialStaysFiniteAboveAndNoNumberStaysNone) {
  for (const float x : {-87.0F, -1.0F, 0.0F, 1.0F, 87.9F, 88.0F})
    EXPECT_NEAR(kernels::Exponential(x) / std::exp(static_cast<double>(x)), 1, 1e-6) << x;
  for (const float x : {88.5F, 177.4F, 1e30F, HUGE_VALF})
    EXPECT_EQ(kernels::Exponential(x), kernels::Exponential(88.0F)) << x;
  EXPECT_TRUE(std::isnan(kernels::Exponential(std::nanf(""))));
}

/// Each costs an Intel processor a hundred cycles; a compiler may make them of numbers that it throws away.
TEST(FloatMath, SiluAndGeluOfPlainNumbersMakeNoDenormalOnes) {
  const at::NoGradGuard no_gradients;
  const Tensor x = Noise({2, 96, 64}, 1), weight = at::ones({64}), bias = at::zeros({64});
  Tensor y = at::empty_like(x), gated = at::empty({192, 32});
  std::feclearexcept(FE_ALL_EXCEPT);
  kernels::GroupNorm({2, 96, 64, 32, 1e-5}, x.data_ptr<float>(), weight.data_ptr<float>(), bias.data_ptr<float>(), true,
                     y.data_ptr<float>());
  EXPECT_FALSE(std::fetestexcept(FE_UNDERFLOW)) << "SiLU";
  kernels::GatedGelu(192, 32, x.data_ptr<float>(), gated.data_ptr<float>());
  EXPECT_FALSE(std::fetestexcept(FE_UNDERFLOW)) << "GELU";
}

TEST(FastGradients, OfGroupNormWithSiluAreThoseOfLibtorchWhereOneRowIsFarOut) {
  Tensor x = at::zeros({1, 200, 200, 32});
  x.select(1, 3).select(1, 7).fill_(-1);  // 170 deviations from all others: SiLU of it is 0
  const std::vector<Tensor> inputs = {x, Noise({32}, 2) * 0.01 + 1, Noise({32}, 3)};
  const auto fast = [](const std::vector<Tensor>& in) { return FastGroupNorm(in[0], in[1], in[2], {32, 1e-5, true}); };
  const auto plain = [](const std::vector<Tensor>& in) {
    const Tensor turned = in[0].flatten(1, 2).transpose(1, 2).contiguous();
    return at::silu(at::group_norm(turned, 32, in[1], in[2], 1e-5).transpose(1, 2).reshape(in[0].sizes()));
  };
  std::vector<Tensor> precise;
  for (const Tensor& input : inputs) precise.push_back(input.to(at::kDouble));
  const std::vector<Tensor> wanted = AnswerAndGradients(plain, precise), found = AnswerAndGradients(fast, inputs);
  for (std::size_t i = 0; i < wanted.size(); ++i) EXPECT_LT(RelativeDifference(found[i], wanted[i]), 1e-4) << i;
}

TEST(FastGradients, OfLayerNormAreThoseOfLibtorch) {
  ExpectSame([](const std::vector<Tensor>& in) { return FastLayerNorm(in[0], in[1], in[2], 1e-5); },
             [](const std::vector<Tensor>& in) { return at::layer_norm(in[0], {40}, in[1], in[2], 1e-5); },
             {Noise({5, 29, 40}, 1) * 3 - 1, Noise({40}, 2), Noise({40}, 3)}, 1);
}

TEST(FastGradients, OfGatedGeluAreThoseOfLibtorch) {
  ExpectSame([](const std::vector<Tensor>& in) { return FastGatedGelu(in[0]); },
             [](const std::vector<Tensor>& in) { return in[0].narrow(-1, 0, 24) * at::gelu(in[0].narrow(-1, 24, 24)); },
             {Noise({7, 19, 48}, 1) * 2}, 1);
}

TEST(FastGradients, OfAttentionAreThoseOfLibtorch) {
  const auto plain = [](const std::vector<Tensor>& in) {
    const auto apart = [](const Tensor& x) { return x.transpose(1, 2).flatten(0, 1); };
    const Tensor y = PlainAttention(apart(in[0]), apart(in[1]), apart(in[2]), 2);
    return y.unflatten(0, {in[0].size(0), in[0].size(2)}).transpose(1, 2).contiguous();
  };
  const auto fast = [](const std::vector<Tensor>& in) { return FastAttention(in[0], in[1], in[2], 2); };
  ExpectSame(fast, plain, {Noise({2, 20, 6, 48}, 1), Noise({2, 20, 6, 48}, 2), Noise({2, 20, 6, 48}, 3)}, 3);
  ExpectSame(fast, plain, {Noise({3, 37, 1, 40}, 1), Noise({3, 5, 1, 40}, 2), Noise({3, 5, 1, 40}, 3)}, 3);
}

TEST(FastGradients, OfTheCausalPadCountTheFirstFrameThreeTimes) {
  const auto plain = [](const std::vector<Tensor>& in) {
    const Tensor first = in[0].narrow(1, 0, 1);
    return at::cat({first, first, in[0]}, 1);
  };
  ExpectSame([](const std::vector<Tensor>& in) { return FastCausalPad(in[0]); }, plain, {Noise({2, 4, 3, 8}, 1)}, 1);
}

/// Pictures that tiles do and do not cover, channels that fill lanes and do not, more tiles than a block has.
TEST(FastGradients, OfConvolutionsAreThoseOfLibtorch) {
  struct Sizes {
    std::int64_t samples, height, width, in, out;
  };
  for (const Sizes& size :
       {Sizes{3, 8, 12, 64, 48}, Sizes{2, 5, 7, 49, 10}, Sizes{1, 1, 1, 3, 1}, Sizes{110, 9, 13, 24, 17}}) {
    const auto fast = [](const std::vector<Tensor>& in) { return FastConv3x3(in[0], in[1], in[2]); };
    const auto plain = [](const std::vector<Tensor>& in) {
      return at::conv2d(in[0].permute({0, 3, 1, 2}).to(at::kDouble), in[1].to(at::kDouble), in[2].to(at::kDouble), 1, 1)
          .permute({0, 2, 3, 1})
          .to(at::kFloat);
    };
    const std::vector<Tensor> inputs = {Noise({size.samples, size.height, size.width, size.in}, 1),
                                        Noise({size.out, size.in, 3, 3}, 2), Noise({size.out}, 3)};
    const std::vector<Tensor> wanted = AnswerAndGradients(plain, inputs), found = AnswerAndGradients(fast, inputs);
    for (std::size_t i = 0; i < wanted.size(); ++i)
      EXPECT_LT(RelativeDifference(found[i], wanted[i]), 2e-5) << size.samples << ", " << i;
  }
}

TEST(FastGradients, OfConvolutionsDoNotDependOnThreads) {
  const Tensor x = Noise({20, 8, 12, 64}, 1), weight = Noise({64, 64, 3, 3}, 2), bias = Noise({64}, 3);
  const auto fast = [](const std::vector<Tensor>& in) { return FastConv3x3(in[0], in[1], in[2]); };
  std::vector<std::vector<Tensor>> results;
  const int before = at::get_num_threads();
  for (const int threads : {1, 3}) {
    at::set_num_threads(threads);
    results.push_back(AnswerAndGradients(fast, {x, weight, bias}));
  }
  at::set_num_threads(before);
  for (std::size_t i = 0; i < 3; ++i) EXPECT_TRUE(results[0][i].equal(results[1][i])) << i;  // the bias: libtorch's sum
}

}  // namespace
}  // namespace evac::nn
