#include "apps/golden/golden_file.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>

namespace evac::golden {
namespace {

using Json = nlohmann::json;

template <typename T>
void Read(const Json& json, const char* key, T& value) {
  if (json.contains(key)) value = json.at(key).get<T>();
}

void ReadResamplers(const Json& json, nn::ModelConfig& config) {
  for (nn::ResamplerConfig* resampler : {&config.action_resampler, &config.image_resampler}) {
    Read(json, "dim", resampler->dim);
    Read(json, "depth", resampler->depth);
    Read(json, "dim_head", resampler->dim_head);
    Read(json, "heads", resampler->heads);
    Read(json, "output_dim", resampler->output_dim);
    Read(json, "ff_mult", resampler->ff_mult);
  }
  Read(json, "action_queries", config.action_resampler.queries);
  Read(json, "action_embedding_dim", config.action_resampler.embedding_dim);
  Read(json, "image_queries", config.image_resampler.queries);
  Read(json, "image_embedding_dim", config.image_resampler.embedding_dim);
}

void ReadClip(const Json& json, nn::ImageEncoderConfig& clip) {
  clip.vocabulary = 64;  // of the tiny text tower whose leftovers stand in the key list
  Read(json, "width", clip.width);
  Read(json, "layers", clip.layers);
  Read(json, "head_width", clip.head_width);
  Read(json, "patch", clip.patch_px);
  Read(json, "image", clip.image_px);
  Read(json, "embed", clip.embed_dim);
  Read(json, "vocab", clip.vocabulary);
  Read(json, "text_length", clip.text_length);
}

nn::ModelConfig ReadModel(const Json& json) {
  nn::ModelConfig config;
  Read(json, "model_channels", config.unet.model_channels);
  Read(json, "channel_mult", config.unet.channel_mult);
  Read(json, "num_res_blocks", config.unet.num_res_blocks);
  Read(json, "attention_resolutions", config.unet.attention_resolutions);
  Read(json, "num_head_channels", config.unet.num_head_channels);
  Read(json, "transformer_depth", config.unet.transformer_depth);
  Read(json, "context_dim", config.unet.context_dim);
  Read(json, "in_channels", config.unet.in_channels);
  Read(json, "out_channels", config.unet.out_channels);
  Read(json, "vae_channels", config.vae.channels);
  Read(json, "vae_mult", config.vae.channel_mult);
  Read(json, "vae_res_blocks", config.vae.num_res_blocks);
  Read(json, "z_channels", config.vae.z_channels);
  Read(json, "scale_factor", config.vae.scale_factor);
  if (json.contains("resampler")) ReadResamplers(json.at("resampler"), config);
  if (json.contains("clip")) ReadClip(json.at("clip"), config.image_encoder);
  Read(json, "image_height", config.image_height_px);
  Read(json, "image_width", config.image_width_px);
  return config;
}

}  // namespace

GoldenFile::GoldenFile(const std::filesystem::path& path) : path_(path), file_(TensorFile::Open(path)) {}

Tensor GoldenFile::Get(const std::string& name) const { return nn::TensorFrom(file_.Get(name)); }

std::vector<std::string> GoldenFile::Names() const {
  std::vector<std::string> names;
  for (const TensorView& tensor : file_.tensors()) names.push_back(tensor.name);
  return names;
}

std::vector<std::string> GoldenFile::PrefixesOf(const std::string& suffix) const {
  std::vector<std::string> prefixes;
  for (const std::string& name : Names()) {
    if (name.ends_with(suffix)) prefixes.push_back(name.substr(0, name.size() - suffix.size()));
  }
  std::sort(prefixes.begin(), prefixes.end());
  return prefixes;
}

std::vector<Tensor> GoldenFile::Noise() const {
  std::vector<std::string> names = Names();
  std::erase_if(names, [](const std::string& name) { return !name.starts_with("noise_"); });
  std::sort(names.begin(), names.end());
  std::vector<Tensor> noise;
  for (const std::string& name : names) noise.push_back(Get(name));
  return noise;
}

double GoldenFile::Number(const std::string& key, double otherwise) const {
  const auto found = file_.metadata().find(key);
  if (found == file_.metadata().end()) return otherwise;
  char* end = nullptr;
  const double value = std::strtod(found->second.c_str(), &end);
  if (end == found->second.c_str()) throw TensorError(file_.name() + ": metadata '" + key + "' is no number");
  return value;
}

nn::ModelConfig GoldenFile::Model() const {
  if (!HasModel()) throw TensorError(file_.name() + ": the metadata names no model");
  const Json json = Json::parse(file_.metadata().at("model"), nullptr, false);
  if (!json.is_object()) throw TensorError(file_.name() + ": metadata 'model' is no JSON object");
  try {
    nn::ModelConfig config = ReadModel(json);
    config.chunk = static_cast<std::int64_t>(Number("chunk", 16));
    config.memory = static_cast<std::int64_t>(Number("n_previous", 4));
    config.views = static_cast<std::int64_t>(Number("n_view", 1));
    config.Check();
    return config;
  } catch (const Json::exception& error) {
    throw TensorError(file_.name() + ": metadata 'model': " + error.what());
  }
}

void Comparison::Close(const std::string& name, const Tensor& got, const Tensor& wanted, double tolerance) {
  nn::CheckShape(name, got, wanted.sizes());
  const double magnitude = wanted.numel() == 0 ? 1 : wanted.to(at::kDouble).abs().max().item<double>();
  Add(name, (got.to(at::kDouble) - wanted.to(at::kDouble)).abs(), std::max(1.0, magnitude), tolerance);
}

void Comparison::Within(const std::string& name, const Tensor& got, const Tensor& wanted, double tolerance) {
  nn::CheckShape(name, got, wanted.sizes());
  Add(name, (got.to(at::kDouble) - wanted.to(at::kDouble)).abs(), 1, tolerance);
}

void Comparison::Add(const std::string& name, const Tensor& error, double scale, double tolerance) {
  entries_.push_back({name, 0, tolerance});
  if (error.numel() == 0) return;
  const Tensor scaled = error / scale;
  const double largest = scaled.max().item<double>();
  entries_.back().error = largest;
  worst_ = std::max(worst_, largest);
  squares_ += scaled.square().sum().item<double>();
  numbers_ += static_cast<double>(scaled.numel());
  if (!(largest <= tolerance)) failures_.push_back(Each().back());  // a NaN fails too
}

std::vector<std::string> Comparison::Each() const {
  std::vector<std::string> lines;
  for (const Entry& entry : entries_)
    lines.push_back(fmt::format("{}: error {:.3g}, at most {:.3g}", entry.name, entry.error, entry.tolerance));
  return lines;
}

double Comparison::rms() const { return numbers_ == 0 ? 0 : std::sqrt(squares_ / numbers_); }

}  // namespace evac::golden
