#include "worldmodel/train/muon.h"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <future>

#include "worldmodel/nn/threads.h"

namespace evac::train {
namespace {

constexpr std::int64_t kSmallest = 16;  ///< rows and columns
constexpr int kIterations = 5;
constexpr double kA = 3.4445, kB = -4.7750, kC = 2.0315, kLikeAdam = 0.2;

AdamWState Part(const AdamWState& state, std::int64_t from, std::int64_t count) {
  const auto part = [&](const Tensor& whole) { return whole.defined() ? whole.narrow(0, from, count) : whole; };
  return {part(state.values), part(state.gradients), part(state.first_moment), part(state.second_moment),
          part(state.average)};
}

void StepMatrix(const AdamWState& state, const MatrixPlace& place, double momentum, const AdamWOptions& options,
                const AdamWStep& step) {
  Tensor values = state.values, gradient = state.gradients, moment = state.first_moment;
  gradient.mul_(step.gradient_factor);
  moment.mul_(momentum).add_(gradient);
  const Tensor direction = Orthogonalised((gradient + moment * momentum).view({place.rows, place.columns}));
  const double length = kLikeAdam * std::sqrt(static_cast<double>(std::max(place.rows, place.columns)));
  values.mul_(1 - step.learning_rate * options.weight_decay).sub_(direction.flatten(), step.learning_rate * length);
  if (state.average.defined()) Tensor(state.average).add_(values - state.average, 1 - step.average_decay);
  gradient.zero_();
}

}  // namespace

std::vector<MatrixPlace> MatricesOf(const std::vector<NamedTensor>& parameters) {
  std::vector<MatrixPlace> places;
  std::int64_t from = 0;
  for (const NamedTensor& parameter : parameters) {
    const std::int64_t count = parameter.tensor.numel(),
                       rows = parameter.tensor.dim() < 2 ? 1 : parameter.tensor.size(0);
    if (rows >= kSmallest && count / rows >= kSmallest) places.push_back({from, rows, count / rows});
    from += count;
  }
  return places;
}

Tensor Orthogonalised(const Tensor& matrix) {
  const bool tall = matrix.size(0) > matrix.size(1);
  Tensor x = tall ? matrix.t() : matrix;
  x = x / (x.norm() + 1e-7);
  for (int i = 0; i < kIterations; ++i) {
    const Tensor a = at::mm(x, x.t());
    x = x * kA + at::mm(a * kB + at::mm(a, a) * kC, x);
  }
  return tall ? x.t() : x;
}

void StepMuon(const AdamWState& state, const std::vector<MatrixPlace>& matrices, double momentum,
              const AdamWOptions& options, const AdamWStep& step, std::size_t workers) {
  const at::NoGradGuard no_gradients;
  std::int64_t from = 0;
  const auto others_until = [&](std::int64_t until) {
    if (until > from) StepAdamW(Part(state, from, until - from), options, step);
  };
  for (const MatrixPlace& place : matrices) {
    others_until(place.from);
    from = place.from + place.count();
  }
  others_until(state.values.numel());

  std::atomic<std::size_t> next = 0;
  const auto step_matrices = [&] {
    for (std::size_t i = next++; i < matrices.size(); i = next++)
      StepMatrix(Part(state, matrices[i].from, matrices[i].count()), matrices[i], momentum, options, step);
  };
  std::vector<std::future<void>> others;
  for (std::size_t worker = 1; worker < std::min(workers, matrices.size()); ++worker) {
    others.push_back(std::async(std::launch::async, [&] {
      const at::NoGradGuard none_here_either;
      nn::UseLibraryThreadsHere(1);
      step_matrices();
    }));
  }
  step_matrices();  // if it throws, the futures wait for the others
  for (std::future<void>& other : others) other.get();
}

}  // namespace evac::train
