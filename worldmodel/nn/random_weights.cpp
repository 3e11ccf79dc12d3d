#include <cmath>

#include "worldmodel/nn/weights.h"

namespace evac::nn {
namespace {

/// The finaliser of SplitMix64 (Steele et al. 2014): every bit of the answer depends on every bit of z.
std::uint64_t Mix(std::uint64_t z) {
  z = (z ^ (z >> 30)) * 0xBF58476D1CE4E5B9;
  z = (z ^ (z >> 27)) * 0x94D049BB133111EB;
  return z ^ (z >> 31);
}

/// The beginning of a key's own stream.
std::uint64_t StreamOf(std::uint64_t seed, const std::string& key) {
  std::uint64_t hash = 0xcbf29ce484222325;  // FNV-1a
  for (const char c : key) hash = (hash ^ static_cast<unsigned char>(c)) * 0x100000001b3;
  return Mix(hash ^ Mix(seed + 0x9E3779B97F4A7C15));
}

/// Uniform in [-bound, bound) with 24 bits: any of them may be asked for first, none needs another.
void DrawUniform(std::uint64_t stream, double bound, Tensor& tensor) {
  float* values = tensor.data_ptr<float>();
  const std::int64_t count = tensor.numel();
  for (std::int64_t i = 0; i < count; ++i) {
    const std::uint64_t bits = Mix(stream + (static_cast<std::uint64_t>(i) + 1) * 0x9E3779B97F4A7C15) >> 40;
    values[i] = static_cast<float>((static_cast<double>(bits) / 8388608.0 - 1) * bound);
  }
}

bool StartsAtZero(const std::string& key) {
  static const char* const kLayers[] = {".out_layers.3.", ".temopral_conv.conv4.3.", ".proj_out.", "l.fps_embedding.2.",
                                        "l.hand_view_embedding.2.", "diffusion_model.out.2."};
  if (!key.starts_with("model.diffusion_model.")) return false;
  for (const char* layer : kLayers) {
    if (key.find(layer) != std::string::npos) return true;
  }
  return false;
}

/// Tables of numbers that are looked up or learned, not multiplied: the last side is their width.
bool IsTable(const std::string& key) {
  return key.ends_with("embedding.weight") || key.ends_with("embedding") || key.ends_with(".latents");
}

}  // namespace

Tensor RandomWeights::Take(const std::string& key, at::IntArrayRef shape) {
  Tensor tensor = at::empty(shape, at::kFloat);
  if (shape.empty()) return tensor.fill_(2.6593F);  // CLIP's logit scale, which nothing reads
  if (last_ == LastLayers::kZero && StartsAtZero(key)) return tensor.zero_();
  if (IsTable(key)) {
    DrawUniform(StreamOf(seed_, key), std::sqrt(3.0 / static_cast<double>(shape.back())), tensor);
    return tensor;
  }
  if (shape.size() == 1) return tensor.fill_(key.ends_with("weight") ? 1.0F : 0.0F);
  const double fan_in = static_cast<double>(tensor.numel()) / static_cast<double>(shape[0]);
  DrawUniform(StreamOf(seed_, key), 1 / std::sqrt(fan_in), tensor);
  return tensor;
}

}  // namespace evac::nn
