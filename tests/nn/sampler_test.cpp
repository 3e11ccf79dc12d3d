#include <ATen/ops/zeros_like.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "tests/nn/support.h"
#include "worldmodel/nn/ddim.h"
#include "worldmodel/nn/dpm_solver.h"

namespace evac::nn {
namespace {

using testing::HasSubstr;
using testing::ThrowsMessage;

constexpr double kMean = 0.4, kDeviation = 0.5;

/// What a perfect network says when clean latents are normal, scaled as in training: the posterior mean is linear in
/// x_t.
Denoise GaussianDenoise(const NoiseSchedule& schedule) {
  return [&schedule](const Tensor& x_t, std::int64_t t) {
    const double bar = schedule.AlphaBar(t), scale = schedule.Scale(t), signal = std::sqrt(bar) * scale;
    const double gain = signal * kDeviation * kDeviation / (signal * signal * kDeviation * kDeviation + 1 - bar);
    const Tensor x0 = ((x_t - signal * kMean) * gain + kMean) * scale;
    const Tensor eps = bar < 1 ? (x_t - x0 * std::sqrt(bar)) / std::sqrt(1 - bar) : at::zeros_like(x_t);
    return VelocityFrom(x0, eps, bar);
  };
}

/// Where the probability flow carries x at step 999 by step t: a Gaussian keeps its quantiles.
Tensor FlowTo(const NoiseSchedule& schedule, const Tensor& noise, std::int64_t t) {
  const double bar = schedule.AlphaBar(t), signal = std::sqrt(bar) * schedule.Scale(t);
  return signal * kMean + noise * std::sqrt(signal * signal * kDeviation * kDeviation + 1 - bar);
}

SampleStart FromNoise(std::uint64_t seed) { return {Noise({1, 4, 2, 8, 8}, seed).to(at::kDouble), 0, true}; }

TEST(NoiseSchedule, EndsInPureNoiseAndItsBuffersSayTheSame) {
  const NoiseSchedule schedule{ScheduleConfig{}};
  EXPECT_EQ(schedule.AlphaBar(999), 0);
  EXPECT_NEAR(schedule.AlphaBar(0), 0.99915, 1e-9 + 5e-8);
  EXPECT_EQ(schedule.Scale(0), 1);
  EXPECT_FLOAT_EQ(static_cast<float>(schedule.Scale(999)), 0.7F);
  EXPECT_EQ(schedule.Buffers().size(), 13u);
  EXPECT_THAT([&] { schedule.AlphaBar(1000); }, ThrowsMessage<TensorError>(HasSubstr("wanted 0 to 999")));
}

TEST(VPrediction, GoesRoundBetweenCleanNoiseAndVelocity) {
  const NoiseSchedule schedule{ScheduleConfig{}};
  const Tensor x0 = Noise({2, 3, 4}, 1).to(at::kDouble), noise = Noise({2, 3, 4}, 2).to(at::kDouble);
  for (const std::int64_t t : {0, 37, 481, 999}) {
    const double bar = schedule.AlphaBar(t);
    const Tensor x_t = AddNoise(x0, noise, bar), v = VelocityFrom(x0, noise, bar);
    EXPECT_LT(LargestDifference(CleanFrom(x_t, v, bar), x0), 1e-12) << t;
    EXPECT_LT(LargestDifference(NoiseFrom(x_t, v, bar), noise), 1e-12) << t;
  }
}

TEST(Ddim, DrawsFromTheGaussianItWasToldOf) {
  const NoiseSchedule schedule{ScheduleConfig{}};
  for (const double eta : {0.0, 1.0}) {
    std::uint64_t draw = 100;
    const SampleStart start{Noise({1, 4, 8, 16, 32}, 5), 0, true};
    const Tensor samples = SampleDdim(schedule, {1000, eta, false}, start, GaussianDenoise(schedule), [&] {
      return Noise({1, 4, 8, 16, 32}, ++draw);
    });
    EXPECT_NEAR(samples.mean().item<double>(), kMean, 0.01) << eta;
    EXPECT_NEAR(samples.std().item<double>(), kDeviation, 0.015) << eta;
  }
}

TEST(Ddim, WithoutNoiseApproachesTheFlowAsStepsAreAdded) {
  const NoiseSchedule schedule{ScheduleConfig{}};
  const SampleStart start = FromNoise(3);
  const auto error = [&](std::int64_t steps) {
    const Tensor samples = SampleDdim(schedule, {steps, 0, false}, start, GaussianDenoise(schedule), nullptr);
    return LargestDifference(samples, kMean + start.x * kDeviation);
  };
  EXPECT_LT(error(100), 0.6 * error(50));
  EXPECT_LT(error(1000), 0.02);
}

TEST(Ddim, LeavesNoiseAndShrinksTheLatentOnlyWithTheQuirkResidualNoise) {
  const NoiseSchedule schedule{ScheduleConfig{}};
  const DdimStep right = DdimTable(schedule, {27, 1, false}).front(),
                 quirk = DdimTable(schedule, {27, 1, true}).front();
  EXPECT_EQ(right.sigma, 0);
  EXPECT_EQ(right.scale_previous, 1);
  EXPECT_NEAR(quirk.sigma, 0.0288, 1e-4);
  EXPECT_NEAR(quirk.scale_previous, 0.9729, 1e-4);
}

TEST(Ddim, KeepsTheMemoryAndShowsItScaledUnlessTheQuirkMemoryNotScaled) {
  const NoiseSchedule schedule{ScheduleConfig{}};
  for (const bool scaled : {true, false}) {
    const SampleStart start{Noise({1, 4, 3, 2, 2}, 4), 1, scaled};
    const Denoise denoise = [&](const Tensor& x_t, std::int64_t t) {
      const double factor = scaled ? schedule.Scale(t) : 1;
      EXPECT_LT(LargestDifference(x_t.narrow(2, 0, 1), start.x.narrow(2, 0, 1) * factor), 1e-6);
      return x_t * 0.1;
    };
    const Tensor samples = SampleDdim(schedule, {4, 0, false}, start, denoise, nullptr);
    EXPECT_TRUE(samples.narrow(2, 0, 1).equal(start.x.narrow(2, 0, 1)));
  }
}

TEST(Ddim, RefusesStepsAndNoiseThatAreNone) {
  const NoiseSchedule schedule{ScheduleConfig{}};
  EXPECT_THAT([&] { DdimTable(schedule, {0, 1, false}); }, ThrowsMessage<TensorError>(HasSubstr("0 sampler steps")));
  EXPECT_THAT(
      [&] {
        DdimTable(schedule, {1001, 1, false});
      },
      ThrowsMessage<TensorError>(HasSubstr("wanted 1 to 1000")));
  EXPECT_THAT([&] { DdimTable(schedule, {27, NAN, false}); }, ThrowsMessage<TensorError>(HasSubstr("eta is nan")));
}

/// Error of the last x that the solver reaches (step 0), against the flow.
double DpmSolverError(const NoiseSchedule& schedule, std::int64_t calls) {
  const SampleStart start = FromNoise(6);
  Tensor reached;
  const StepObserver observer = [&](std::int64_t index, const Tensor& x, const Tensor&) {
    if (index == 0) reached = x;
  };
  SampleDpmSolver(schedule, calls, start, GaussianDenoise(schedule), &observer);
  return LargestDifference(reached, FlowTo(schedule, start.x, 0));
}

TEST(DpmSolver, ErrsWithTheSquareOfTheStep) {
  ScheduleConfig fine;  // whole steps are coarse: a finer schedule lets the order show
  fine.steps = 100'000;
  fine.turning_step = 40'000;
  const NoiseSchedule schedule{fine};
  const double error20 = DpmSolverError(schedule, 20), error40 = DpmSolverError(schedule, 40),
               error80 = DpmSolverError(schedule, 80);
  EXPECT_NEAR(std::log2(error20 / error40), 2, 0.4) << error20 << " " << error40;
  EXPECT_NEAR(std::log2(error40 / error80), 2, 0.4) << error40 << " " << error80;
}

TEST(DpmSolver, IsNearerInSixteenStepsThanDdimInTwentySeven) {
  const NoiseSchedule schedule{ScheduleConfig{}};
  const SampleStart start = FromNoise(7);
  const Tensor truth = kMean + start.x * kDeviation;
  const Tensor few = SampleDpmSolver(schedule, 16, start, GaussianDenoise(schedule));
  const Tensor many = SampleDdim(schedule, {27, 0, false}, start, GaussianDenoise(schedule), nullptr);
  EXPECT_LT(LargestDifference(few, truth), LargestDifference(many, truth));
}

TEST(DpmSolver, AsksFromTheLastStepToTheFirstAndNeverTwice) {
  const NoiseSchedule schedule{ScheduleConfig{}};
  for (const std::int64_t calls : {2, 5, 10, 50, 1000}) {
    const std::vector<std::int64_t> steps = DpmSolverSteps(schedule, calls);
    ASSERT_EQ(steps.size(), static_cast<std::size_t>(calls));
    EXPECT_EQ(steps.front(), 999);
    EXPECT_EQ(steps.back(), 0);
    for (std::size_t i = 1; i < steps.size(); ++i) EXPECT_LT(steps[i], steps[i - 1]) << calls;
  }
}

TEST(Guidance, OfOneAsksOnceAndRescalingRestoresTheSpread) {
  int asked = 0;
  const Denoise half = [&](const Tensor& x, std::int64_t) { return ++asked, x * 0.5; };
  const Denoise other = [&](const Tensor& x, std::int64_t) { return ++asked, x * -1.5; };
  const Tensor x = Noise({2, 4, 2, 4, 4}, 9);
  Guided(half, other, 1, 0.7)(x, 3);
  EXPECT_EQ(asked, 1);
  EXPECT_LT(LargestDifference(Guided(half, other, 2, 0)(x, 3), x * 2.5), 1e-5);
  EXPECT_LT(LargestDifference(Guided(half, other, 2, 1)(x, 3), x * 0.5), 1e-5);
}

}  // namespace
}  // namespace evac::nn
