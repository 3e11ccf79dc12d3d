#include "worldmodel/train/muon.h"

#include <ATen/ops/linalg_svdvals.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/support/temp_folder.h"
#include "worldmodel/train/trainer.h"

namespace evac::train {
namespace {

Tensor Noise(std::int64_t rows, std::int64_t columns, std::int64_t step = 0) {
  return Dice({3, step, 0, 0}, 1).Normal({rows, columns});
}

AdamWState Fresh(std::int64_t count) {
  return {at::ones({count}), at::zeros({count}), at::zeros({count}), at::zeros({count}), at::ones({count})};
}

TEST(Muon, BringsAllSingularValuesNearOneAndKeepsTheDirections) {
  for (const auto& [rows, columns] : {std::pair<std::int64_t, std::int64_t>{20, 64}, {64, 20}, {32, 32}}) {
    const Tensor matrix = Noise(rows, columns) * 1e-3, near = Orthogonalised(matrix);
    ASSERT_EQ(near.sizes(), matrix.sizes());
    const Tensor values = at::linalg_svdvals(near);
    EXPECT_GT(values.min().item<double>(), rows == columns ? 0.1 : 0.6)
        << "a square one may have hardly any of some direction";
    EXPECT_LT(values.max().item<double>(), 1.3);
    EXPECT_GT((near * matrix).sum().item<double>(), 0) << "still down the gradient";
    EXPECT_TRUE(at::allclose(Orthogonalised(matrix * 100), near, 1e-3, 1e-4)) << "whatever the gradient's length";
  }
}

TEST(Muon, TakesMatricesAndConvolutionsAndLeavesTheRest) {
  const std::vector<NamedTensor> parameters = {{"bias", at::zeros({64})},
                                               {"matrix", at::zeros({16, 16})},
                                               {"table", at::zeros({12, 64})},
                                               {"convolution", at::zeros({32, 8, 3, 3})},
                                               {"last", at::zeros({8, 64, 3, 3})}};
  const std::vector<MatrixPlace> places = MatricesOf(parameters);
  ASSERT_EQ(places.size(), 2u);
  EXPECT_EQ(places[0].from, 64);
  EXPECT_EQ(places[0].columns, 16);
  EXPECT_EQ(places[1].from, 64 + 256 + 768);
  EXPECT_EQ(places[1].rows, 32);
  EXPECT_EQ(places[1].columns, 72);
}

TEST(Muon, StepsAMatrixAsFarAsAdamWWouldAndAllElseAsAdamWDoes) {
  constexpr std::int64_t kBefore = 10, kMatrix = 16 * 40, kBehind = 7, kAll = kBefore + kMatrix + kBehind;
  AdamWState muon = Fresh(kAll), adamw = Fresh(kAll);
  const AdamWOptions options;
  const double rate = 0.01;
  for (std::int64_t t = 0; t < 3; ++t) {
    for (AdamWState* state : {&muon, &adamw}) state->gradients.copy_(Noise(1, kAll, t).flatten() * 50);
    const AdamWStep step{t, rate, 0.5, 0.9};
    const Tensor before = muon.values.clone();
    StepMuon(muon, {{kBefore, 16, 40}}, 0.95, options, step);
    StepAdamW(adamw, options, step);
    const Tensor moved = (muon.values - before * (1 - rate * options.weight_decay)).narrow(0, kBefore, kMatrix);
    EXPECT_NEAR(moved.square().mean().sqrt().item<double>(), 0.2 * rate, 0.04 * rate)
        << "of √(rows) of √(rows columns)";
  }
  for (const auto& [from, count] : {std::pair{std::int64_t{0}, kBefore}, {kBefore + kMatrix, kBehind}}) {
    EXPECT_TRUE(at::allclose(muon.values.narrow(0, from, count), adamw.values.narrow(0, from, count), 0, 1e-6));
    EXPECT_TRUE(at::allclose(muon.average.narrow(0, from, count), adamw.average.narrow(0, from, count), 0, 1e-6));
  }
  EXPECT_EQ(muon.gradients.abs().max().item<double>(), 0) << "gradients are ready for the next step";
  EXPECT_FALSE(at::equal(muon.average.narrow(0, kBefore, 5), at::ones({5}))) << "the average follows";
}

/// A matrix that must become another, from noisy products.
struct Products {
  Tensor weight = at::zeros({20, 20}), bias = at::zeros({20});
  Tensor Loss(const StepPlace& place) const {
    const Tensor x = Dice(place, 1).Normal({32, 20}), wanted = Noise(20, 20, 99);
    return (at::matmul(x, weight - wanted) + bias).square().mean();
  }
  double Error() const { return (weight.detach() - Noise(20, 20, 99)).abs().max().item<double>(); }
};

TrainerOptions WithMuon() {
  TrainerOptions options;
  options.optimiser = "muon";
  options.steps = 300;
  options.learning_rate = 0.2;
  options.adamw.weight_decay = 0;
  options.decay_from = 0.3;
  options.clip_norm = 10;
  options.checkpoint_every_s = 0;
  return options;
}

TEST(Muon, WorkersChangeNoNumber) {
  constexpr std::int64_t kEach = 16 * 24, kMatrices = 7;
  std::vector<MatrixPlace> matrices;
  for (std::int64_t i = 0; i < kMatrices; ++i) matrices.push_back({5 + i * (kEach + 3), 16, 24});
  const auto after = [&](std::size_t workers) {
    AdamWState state = Fresh(5 + kMatrices * (kEach + 3));
    for (std::int64_t t = 0; t < 3; ++t) {
      state.gradients.copy_(Noise(1, state.gradients.numel(), t).flatten());
      StepMuon(state, matrices, 0.95, {}, {t, 0.01, 1, 0.9}, workers);
    }
    return at::cat({state.values, state.first_moment, state.average, state.gradients});
  };
  const Tensor alone = after(1);
  for (const std::size_t workers : {2, 3, 20}) EXPECT_TRUE(at::equal(after(workers), alone)) << workers;
}

TEST(Muon, LearnsAndGoesOnAfterAnyKillAsIfNothingHadHappened) {
  const TempFolder whole_folder, killed_folder;
  Products whole;
  const auto train = [](Products& products, const std::filesystem::path& folder, std::int64_t kill_at) {
    Trainer trainer({{"weight", products.weight}, {"bias", products.bias}}, WithMuon(), folder);
    trainer.Run({.loss = [&](const StepPlace& place) { return products.Loss(place); },
                 .interrupted = [&] { return trainer.step() == kill_at; }});
  };
  train(whole, whole_folder.path(), -1);
  EXPECT_LT(whole.Error(), 0.1);
  Products last;
  for (const std::int64_t kill_at : {3, 150, -1}) {
    Products killed;
    train(killed, killed_folder.path(), kill_at);
    last = killed;
  }
  EXPECT_TRUE(at::equal(last.weight, whole.weight));
}

TEST(Muon, AnUnknownOptimiserIsRefused) {
  TrainerOptions options = WithMuon();
  options.optimiser = "moun";
  const TempFolder folder;
  EXPECT_THROW(Trainer({{"weight", at::zeros({2})}}, options, folder.path()), TensorError);
}

}  // namespace
}  // namespace evac::train
