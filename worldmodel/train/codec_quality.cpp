#include <algorithm>
#include <cmath>

#include "worldmodel/nn/latent_pictures.h"
#include "worldmodel/train/codec_training.h"

namespace evac::train {
namespace {

constexpr std::int64_t kBatch = 16;           ///< of small pictures
constexpr std::int64_t kNormaliseWith = 512;  ///< pictures whose latents are measured
constexpr double kPointLogVariance = -30;     ///< the least that a posterior can say

/// Every so-manieth frame of a set, all views, so that they make about `pictures`.
/// @param pick  frames or maps of a shard
/// @returns bytes [N, H, W, 3] and where their objects are [N, 2]
struct Sampled {
  Tensor pictures, object_px;
};
Sampled Sample(const ShardSet& shards, std::int64_t pictures, Tensor Shard::*pick) {
  const std::int64_t every = std::max<std::int64_t>(1, shards.frame_count() * shards.views() / std::max<std::int64_t>(pictures, 1));
  std::vector<Tensor> parts, objects;
  std::int64_t next = 0, passed = 0;
  for (const Shard& shard : shards.shards()) {
    for (; next < passed + shard.frames.size(0); next += every) {
      parts.push_back((shard.*pick)[next - passed]);
      objects.push_back(shard.object_px[next - passed]);
    }
    passed += shard.frames.size(0);
  }
  return {at::cat(parts), at::cat(objects)};
}

/// Sums of squared errors of colours 0 … 1.
struct Errors {
  double sum = 0;
  std::int64_t count = 0;
  void Add(const Tensor& squares) {
    sum += squares.sum().item<double>();
    count += squares.numel();
  }
  double Psnr() const { return count == 0 ? 0 : -10 * std::log10(std::max(sum / static_cast<double>(count), 1e-12)); }
};

/// The square about the object that lies in the picture; undefined if there is none, or nobody knows where it is.
Tensor AroundObject(const Tensor& picture, const Tensor& object_px) {
  const double x = object_px[0].item<double>(), y = object_px[1].item<double>();
  const std::int64_t height = picture.size(1), width = picture.size(2), reach = std::max<std::int64_t>(4, height / 6);
  const auto is_near = [&](double middle, std::int64_t side) {  // what is no number is not; nor need it fit an integer
    return middle > static_cast<double>(-reach) && middle < static_cast<double>(side + reach);
  };
  if (!is_near(x, width) || !is_near(y, height)) return {};
  const auto part = [&](double middle, std::int64_t side) {
    const auto at = static_cast<std::int64_t>(middle);
    const std::int64_t from = std::clamp<std::int64_t>(at - reach, 0, side), to = std::clamp<std::int64_t>(at + reach, 0, side);
    return std::pair(from, to - from);
  };
  const auto [top, rows] = part(y, height);
  const auto [left, columns] = part(x, width);
  if (rows == 0 || columns == 0) return {};
  return picture.narrow(1, top, rows).narrow(2, left, columns);
}

/// @param pictures  [N, H, W, 3]
template <typename Function>
void InBatches(const Tensor& pictures, Function function) {
  const std::int64_t count = pictures.size(0);
  const std::int64_t at_once = std::min(kBatch, nn::PicturesAtOnce(pictures.size(1) * pictures.size(2)));
  for (std::int64_t from = 0; from < count; from += at_once) function(from, std::min(at_once, count - from));
}

/// [N, 3, H, W]: squared errors of what comes back, as colours 0 … 1.
Tensor SquaredErrors(const nn::Vae& vae, const Tensor& pictures) {
  const Tensor back = vae.Decode(vae.Encode(pictures).Sample({}) * vae.scale_factor()).clamp(-1, 1);
  return ((back - pictures) / 2).square();
}

}  // namespace

CodecQuality MeasureCodec(const nn::Vae& vae, const ShardSet& shards, std::int64_t pictures, at::Device device) {
  const at::NoGradGuard no_gradients;
  Errors whole, object, maps;
  const Sampled frames = Sample(shards, pictures, &Shard::frames);
  InBatches(frames.pictures, [&](std::int64_t from, std::int64_t count) {
    const Tensor squares = SquaredErrors(vae, PicturesFrom(frames.pictures.narrow(0, from, count)).to(device));
    whole.Add(squares);
    for (std::int64_t i = 0; i < count; ++i) {
      const Tensor around = AroundObject(squares[i], frames.object_px[from + i]);
      if (around.defined()) object.Add(around);
    }
  });
  const Sampled drawn = Sample(shards, std::max<std::int64_t>(1, pictures / 4), &Shard::maps);
  InBatches(drawn.pictures, [&](std::int64_t from, std::int64_t count) {
    maps.Add(SquaredErrors(vae, PicturesFrom(drawn.pictures.narrow(0, from, count)).to(device)));
  });
  return {whole.Psnr(), object.Psnr(), maps.Psnr()};
}

void NormaliseLatents(const nn::Vae& vae, const ShardSet& shards, const std::vector<NamedTensor>& weights, bool point) {
  const at::NoGradGuard no_gradients;
  std::vector<Tensor> means;
  const at::Device device = weights.front().tensor.device();
  const Sampled frames = Sample(shards, kNormaliseWith, &Shard::frames);
  InBatches(frames.pictures, [&](std::int64_t from, std::int64_t count) {
    const Tensor pictures = PicturesFrom(frames.pictures.narrow(0, from, count)).to(device);
    means.push_back(vae.Encode(pictures).Sample({}));
  });
  const Tensor latents = at::cat(means).transpose(0, 1).flatten(1);  // [z, all]
  const Tensor middle = latents.mean(1);
  Tensor factor = latents.std(1);
  factor = at::maximum(factor, factor.mean() * 0.1) * vae.scale_factor();  // a channel that says nothing stays quiet
  const auto find = [&](const std::string& end) {
    const auto found = std::find_if(weights.begin(), weights.end(), [&](const NamedTensor& w) { return w.name.ends_with(end); });
    if (found == weights.end()) throw TensorError("the codec has no " + end);
    return found->tensor.detach();
  };
  const std::int64_t z = middle.numel();
  // mean' = (mean - middle) / factor, and the other way round behind the latents.
  Tensor out = find("post_quant_conv.weight"), out_bias = find("post_quant_conv.bias");
  out_bias.add_(at::matmul(out.flatten(1), middle));
  out.mul_(factor.reshape({1, z, 1, 1}));
  Tensor in = find(".quant_conv.weight"), in_bias = find(".quant_conv.bias");
  in.narrow(0, 0, z).div_(factor.reshape({z, 1, 1, 1}));
  in_bias.narrow(0, 0, z).sub_(middle).div_(factor);
  if (point) {
    in.narrow(0, z, z).zero_();
    in_bias.narrow(0, z, z).fill_(kPointLogVariance);
  } else {
    in_bias.narrow(0, z, z).sub_(2 * factor.log());
  }
}

}  // namespace evac::train
