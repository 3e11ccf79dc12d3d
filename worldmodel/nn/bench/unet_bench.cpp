// What one call of the denoiser costs and where the time goes, with weights of noise, beside the matrix product's peak
// of the same run:
//   evac_unet_bench [--width 320] [--frames 20] [--height 40] [--latent-width 64] [--scenes 1] [--calls 1]
//                   [--threads 2] [--dtype f32|bf16] [--device cpu|cuda] [--plain 1]
// --plain 1: the path that training takes.
// Needs a compiler and libtorch alone, so that it also runs on a machine that has nothing else.
#include <ATen/Context.h>
#include <ATen/Parallel.h>
#include <ATen/ops/randn.h>
#include <ATen/record_function.h>
#include <sys/resource.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <map>
#include <memory>
#include <string>
#include <utility>

#include "worldmodel/nn/memory.h"
#include "worldmodel/nn/unet.h"

namespace evac::nn {
namespace {

using Clock = std::chrono::steady_clock;

double SecondsSince(Clock::time_point start) { return std::chrono::duration<double>(Clock::now() - start).count(); }

struct Options {
  std::int64_t width = 320, frames = 20, height = 40, latent_width = 64, scenes = 1, calls = 1;
  int threads = 2;
  at::ScalarType dtype = at::kFloat;
  at::Device device = at::kCPU;
  bool plain = false;
};

/// Weights of noise of a plausible size, in the type and place asked for.
class NoiseWeights final : public ParameterSource {
 public:
  explicit NoiseWeights(const Options& options) : options_(options) {}
  Tensor Take(const std::string&, at::IntArrayRef shape) override {
    const Tensor noise = at::randn(shape, at::TensorOptions().dtype(at::kFloat));
    const double fan_in = shape.size() > 1 ? static_cast<double>(noise.numel() / shape[0]) : 100;
    return (noise / std::sqrt(fan_in)).to(options_.device, options_.dtype);
  }

 private:
  const Options& options_;
};

/// Time and arithmetic of the outermost operators, by name.
struct Profile {
  struct Entry {
    double seconds = 0, flop = 0;
    int calls = 0;
  };
  std::map<std::string, Entry> entries;
};

struct Running : at::ObserverContext {
  Clock::time_point start;
  double flop = 0;
};

thread_local int depth = 0;
Profile* profile = nullptr;

double FlopOf(const std::string& name, const at::RecordFunction& function) {
  const auto size = [&](std::size_t i) { return static_cast<double>(function.inputs()[i].toTensor().numel()); };
  const auto side = [&](std::size_t i, int axis) {
    return static_cast<double>(function.inputs()[i].toTensor().size(axis));
  };
  if (name == "aten::linear") return 2 * size(0) * side(1, 0);
  if (name == "evac::conv3x3") return 2 * size(0) / side(0, 3) * size(1);  // as if done place by place
  if (name == "evac::attention") return 4 * size(0) * side(1, 1);
  if (name == "evac::temporal_attention") return 4 * size(0) * side(1, 1);
  return 0;
}

/// Of a convolution only when its result is there.
double ConvolutionFlop(const at::RecordFunction& function) {
  const Tensor weight = function.inputs()[1].toTensor(), y = function.outputs()[0].toTensor();
  return 2 * static_cast<double>(y.numel()) * static_cast<double>(weight.numel() / weight.size(0));
}

std::unique_ptr<at::ObserverContext> Begin(const at::RecordFunction& function) {
  auto running = std::make_unique<Running>();
  if (++depth == 1) running->flop = FlopOf(function.name(), function);
  running->start = Clock::now();
  return running;
}

void End(const at::RecordFunction& function, at::ObserverContext* context) {
  if (--depth > 0 || profile == nullptr) return;
  const std::string name = function.name();
  Profile::Entry& entry = profile->entries[name];
  const auto* running = static_cast<Running*>(context);
  entry.seconds += SecondsSince(running->start);
  entry.flop += name == "aten::conv2d" ? ConvolutionFlop(function) : running->flop;
  ++entry.calls;
}

/// The largest rate of a square matrix product in a few tries, of the BLAS and of the convolutions' library, GFLOP/s.
double PeakGflops(const Options& options) {
  const std::int64_t n = 2048;
  const auto type = at::TensorOptions().dtype(options.dtype).device(options.device);
  const Tensor a = at::randn({n, n}).to(type), b = at::randn({n, n}).to(type);
  const Tensor pixels = a.view({1, n, 1, n}).permute({0, 3, 1, 2}), kernel = b.view({n, n, 1, 1});
  const auto rate = [&](const auto& multiply) {
    const auto start = Clock::now();
    multiply().select(0, 0).select(0, 0).to(at::kCPU);  // waits for a GPU
    return 2e-9 * static_cast<double>(n * n * n) / SecondsSince(start);
  };
  double best = 0;
  for (int i = 0; i < 16; ++i) {
    best = std::max(best, rate([&] { return at::linear(a, b); }));
    best = std::max(best, rate([&] { return at::conv2d(pixels, kernel); }));
  }
  return best;
}

double PeakResidentGib() {
  rusage usage{};
  ::getrusage(RUSAGE_SELF, &usage);
  return static_cast<double>(usage.ru_maxrss) / (1 << 20);
}

Options Parse(int count, char** words) {
  Options options;
  std::map<std::string, std::string> given;
  for (int i = 1; i + 1 < count; i += 2) given[words[i]] = words[i + 1];
  const std::map<std::string, std::int64_t*> numbers = {
      {"--width", &options.width},   {"--frames", &options.frames}, {"--latent-width", &options.latent_width},
      {"--height", &options.height}, {"--scenes", &options.scenes}, {"--calls", &options.calls}};
  for (const auto& [name, value] : given) {
    if (const auto number = numbers.find(name); number != numbers.end()) *number->second = std::stoll(value);
    if (name == "--threads") options.threads = std::stoi(value);
    if (name == "--dtype") options.dtype = value == "bf16" ? at::kBFloat16 : at::kFloat;
    if (name == "--device") options.device = at::Device(value);
    if (name == "--plain") options.plain = value == "1";
  }
  return options;
}

UNetConfig ConfigOf(const Options& options) {
  UNetConfig config;
  config.model_channels = options.width;
  config.num_head_channels = options.width % 64 == 0 && options.width >= 256 ? 64 : 16;
  return config;
}

void Print(const Profile& profile, double seconds, double peak_gflops) {
  std::vector<std::pair<std::string, Profile::Entry>> sorted(profile.entries.begin(), profile.entries.end());
  std::sort(sorted.begin(), sorted.end(), [](const auto& a, const auto& b) { return a.second.seconds > b.second.seconds; });
  double known = 0, flop = 0;
  std::printf("%-28s %7s %9s %7s %9s %8s\n", "operator", "calls", "seconds", "share", "GFLOP/s", "of peak");
  for (const auto& [name, entry] : sorted) {
    known += entry.seconds;
    flop += entry.flop;
    if (entry.seconds < .005 * seconds) continue;
    const double rate = 1e-9 * entry.flop / entry.seconds;
    std::printf("%-28s %7d %9.2f %6.1f%% %9.0f %7.0f%%\n", name.c_str(), entry.calls, entry.seconds,
                100 * entry.seconds / seconds, rate, 100 * rate / peak_gflops);
  }
  std::printf("everything else: %.2f s\n%.3f TFLOP in %.2f s: %.0f GFLOP/s, %.1f %% of the peak (%.0f GFLOP/s)\n",
              seconds - known, 1e-12 * flop, seconds, 1e-9 * flop / seconds, 100 * 1e-9 * flop / seconds / peak_gflops,
              peak_gflops);
}

void Run(const Options& options) {
  KeepFreedMemory();
  at::manual_seed(1);
  at::set_num_threads(options.threads);
  const at::AutoGradMode no_gradients(options.plain);  // the kernels are for inference alone
  const double peak = PeakGflops(options);
  const UNetConfig config = ConfigOf(options);
  NoiseWeights weights(options);
  const auto making = Clock::now();
  const UNet unet(Scope(weights, "model.diffusion_model"), config);
  std::printf("network of width %ld made in %.1f s, %.2f GiB resident at most\n", options.width, SecondsSince(making),
              PeakResidentGib());
  const auto floats = at::TensorOptions().device(options.device);
  const auto whole = floats.dtype(at::kLong);
  const std::int64_t b = options.scenes;
  const PreparedContext context =
      unet.Prepare({at::randn({b, config.image_tokens + config.action_tokens, config.context_dim}, floats),
                    at::full({b}, 2, whole), at::full({b}, 11, whole), 1});
  const UNet::Input input{at::randn({b, config.in_channels, options.frames, options.height, options.latent_width}, floats),
                          at::full({b}, 500, whole), 1, std::min<std::int64_t>(4, options.frames - 1)};
  Profile measured;
  at::addGlobalCallback(at::RecordFunctionCallback(&Begin, &End)
                            .needsInputs(true)
                            .needsOutputs(true)
                            .scopes({at::RecordScope::FUNCTION}));
  for (std::int64_t call = 0; call < options.calls; ++call) {
    measured = {};
    profile = &measured;
    const auto start = Clock::now();
    const Tensor y = unet(input, context);
    const double checksum = y.to(at::kFloat).abs().mean().item<double>();
    const double seconds = SecondsSince(start);
    profile = nullptr;
    Print(measured, seconds, peak);
    std::printf("mean |v| %.4f, %.2f GiB resident at most\n", checksum, PeakResidentGib());
  }
}

}  // namespace
}  // namespace evac::nn

int main(int count, char** words) {
  try {
    evac::nn::Run(evac::nn::Parse(count, words));
  } catch (const std::exception& error) {
    std::fprintf(stderr, "%s\n", error.what());
    return 2;
  }
}
