#include "worldmodel/nn/noise.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "worldmodel/nn/tensor.h"

namespace evac::nn {
namespace {

using testing::ElementsAre;

// Known answers of the authors' own library (Random123, kat_vectors: philox4x32 10).
TEST(Philox, GivesTheKnownAnswersOfItsAuthors) {
  EXPECT_THAT(Philox4x32({0, 0, 0, 0}, {0, 0}), ElementsAre(0x6627e8d5, 0xe169c58d, 0xbc57ac4c, 0x9b00dbd8));
  constexpr std::uint32_t kOnes = 0xffffffff;
  EXPECT_THAT(Philox4x32({kOnes, kOnes, kOnes, kOnes}, {kOnes, kOnes}),
              ElementsAre(0x408f276d, 0x41c83b0e, 0xa20bc7c6, 0x6d5451fd));
  EXPECT_THAT(Philox4x32({0x243f6a88, 0x85a308d3, 0x13198a2e, 0x03707344}, {0xa4093822, 0x299f31d0}),
              ElementsAre(0xd16cfe09, 0x94fdcceb, 0x5001e420, 0x24126ea1));
}

TEST(StandardNormal, HasTheMomentsOfANormalDistribution) {
  const Tensor x = StandardNormal({.seed = 5, .frame = 2, .step = 3}, {1000, 1000}).to(at::kDouble);
  // A million: the standard errors are .001, .0014, .0024 and .01.
  EXPECT_NEAR(x.mean().item<double>(), 0, 0.005);
  EXPECT_NEAR(x.pow(2).mean().item<double>(), 1, 0.007);
  EXPECT_NEAR(x.pow(3).mean().item<double>(), 0, 0.02);
  EXPECT_NEAR(x.pow(4).mean().item<double>(), 3, 0.05);
  EXPECT_NEAR((x.narrow(1, 0, 999) * x.narrow(1, 1, 999)).mean().item<double>(), 0, 0.005) << "neighbours";
  EXPECT_NEAR((x.abs() > 1.959964).to(at::kDouble).mean().item<double>(), 0.05, 0.001);
}

TEST(StandardNormal, IsAFunctionOfThePlaceAlone) {
  const NoisePlace place{.seed = 5, .frame = 2, .step = 3};
  const Tensor x = StandardNormal(place, {7});
  EXPECT_TRUE(x.equal(StandardNormal(place, {7})));
  EXPECT_TRUE(x.equal(StandardNormal(place, {2, 4}).flatten().narrow(0, 0, 7))) << "whatever the shape";
  for (const NoisePlace& other :
       {NoisePlace{6, 2, 3}, NoisePlace{5, 3, 3}, NoisePlace{5, 2, 4}, NoisePlace{5 + (std::uint64_t{1} << 32), 2, 3}})
    EXPECT_FALSE(x.equal(StandardNormal(other, {7})));
}

TEST(StandardNormal, GivesTheseNumbersOnEveryMachine) {
  const Tensor x = StandardNormal({.seed = 1, .frame = 0, .step = 0}, {4});
  std::vector<float> values(x.data_ptr<float>(), x.data_ptr<float>() + 4);
  EXPECT_THAT(values, ElementsAre(-0.413897812F, -0.247333586F, -0.881163538F, 0.136197776F));
}

}  // namespace
}  // namespace evac::nn
