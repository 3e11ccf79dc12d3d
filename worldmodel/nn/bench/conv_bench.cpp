// What a convolution of 3x3 costs, by conv_kernel.h and by libtorch in turns, at the sizes of the desk's network and
// codec and of the published network's:
//   evac_conv_bench [--threads 1] [--rounds 5]
// Each number is the best of its rounds. Needs a compiler and libtorch alone.
#include <ATen/Parallel.h>
#include <ATen/ops/conv2d.h>
#include <ATen/ops/convolution_backward.h>
#include <ATen/ops/empty.h>
#include <ATen/ops/randn.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <string>

#include "worldmodel/nn/conv_kernel.h"
#include "worldmodel/nn/tensor.h"

namespace evac::nn {
namespace {

using Clock = std::chrono::steady_clock;

struct Layer {
  const char* where;
  kernels::ConvShape shape;
  double Flop() const {
    return 18.0 * static_cast<double>(shape.samples * shape.height * shape.width * shape.in * shape.out);
  }
};

constexpr Layer kLayers[] = {
    {"desk, codec, 8x12", {32, 8, 12, 128, 128}},      {"desk, codec, 16x24", {32, 16, 24, 64, 64}},
    {"desk, codec, narrower", {32, 16, 24, 128, 64}},  {"desk, network, input", {40, 8, 12, 49, 64}},
    {"desk, network, 8x12", {40, 8, 12, 64, 64}},      {"desk, network, 4x6", {40, 4, 6, 128, 128}},
    {"published, 40x64", {20, 40, 64, 320, 320}},      {"published, 20x32", {20, 20, 32, 640, 640}},
    {"published, 10x16", {20, 10, 16, 1280, 1280}},
};

template <typename Function>
double Seconds(Function function) {
  const Clock::time_point start = Clock::now();
  function();
  return std::chrono::duration<double>(Clock::now() - start).count();
}

struct Pair {
  double ours = 1e9, theirs = 1e9;
  template <typename Ours, typename Theirs>
  void Round(Ours our_way, Theirs their_way) {
    ours = std::min(ours, Seconds(our_way));
    theirs = std::min(theirs, Seconds(their_way));
  }
  void Print(double flop) const {
    std::printf("%10.2f %6.0f %10.2f %6.0f %6.2f", theirs * 1e3, flop / theirs / 1e9, ours * 1e3, flop / ours / 1e9,
                theirs / ours);
  }
};

void Measure(const Layer& layer, int rounds) {
  const kernels::ConvShape& shape = layer.shape;
  const Tensor x = at::randn({shape.samples, shape.height, shape.width, shape.in}), bias = at::randn({shape.out});
  const Tensor weight = at::randn({shape.out, shape.in, 3, 3}) / std::sqrt(9.0 * static_cast<double>(shape.in));
  const Tensor gradient = at::randn({shape.samples, shape.height, shape.width, shape.out});
  const Tensor pictures = x.permute({0, 3, 1, 2}), of_pictures = gradient.permute({0, 3, 1, 2});
  Pair answer, weights;
  for (int round = 0; round <= rounds; ++round) {
    Pair first;
    Pair &answers = round == 0 ? first : answer, &gradients = round == 0 ? first : weights;  // the first warms up
    answers.Round(
        [&] {
          const Tensor y = at::empty(gradient.sizes());
          kernels::Conv3x3(shape, x.data_ptr<float>(), weight.data_ptr<float>(), bias.data_ptr<float>(),
                           y.data_ptr<float>());
        },
        [&] { at::conv2d(pictures, weight, bias, 1, 1); });
    gradients.Round(
        [&] {
          const Tensor to = at::empty(weight.sizes());
          kernels::Conv3x3WeightGradient(shape, x.data_ptr<float>(), gradient.data_ptr<float>(), to.data_ptr<float>());
        },
        [&] {
          at::convolution_backward(of_pictures, pictures, weight, {}, {1, 1}, {1, 1}, {1, 1}, false, {0, 0}, 1,
                                   {false, true, false});
        });
  }
  std::printf("%-24s", layer.where);
  answer.Print(layer.Flop());
  std::printf("  |");
  weights.Print(layer.Flop());
  std::printf("\n");
  std::fflush(stdout);
}

int Main(int argc, char** argv) {
  int threads = 1, rounds = 5;
  for (int i = 1; i + 1 < argc; i += 2) {
    const std::string name = argv[i];
    if (name == "--threads") threads = std::max(1, std::atoi(argv[i + 1]));
    if (name == "--rounds") rounds = std::max(1, std::atoi(argv[i + 1]));
  }
  at::set_num_threads(threads);
  const at::NoGradGuard no_gradients;
  std::printf("%-24s%46s  |%s\n%-24s", "", "answer", "   gradient of the weights", "");
  for (int i = 0; i < 2; ++i)
    std::printf("%10s %6s %10s %6s %6s%s", "libtorch", "GF/s", "ours, ms", "GF/s", "times", i == 0 ? "  |" : "\n");
  for (const Layer& layer : kLayers) Measure(layer, rounds);
  return 0;
}

}  // namespace
}  // namespace evac::nn

int main(int argc, char** argv) { return evac::nn::Main(argc, argv); }
