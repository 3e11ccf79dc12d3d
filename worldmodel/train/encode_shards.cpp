#include "worldmodel/train/encode_shards.h"

#include <algorithm>
#include <vector>

#include "worldmodel/nn/latent_pictures.h"

namespace evac::train {
namespace {

constexpr std::int64_t kBatch = 32;  ///< of small pictures

/// [F, V, H, W, 3] bytes → [F, V, z, h, w] half
Tensor Encode(const nn::Vae& vae, const Tensor& pictures, at::Device device) {
  const Tensor all = pictures.flatten(0, 1);
  const std::int64_t at_once = std::min(kBatch, nn::PicturesAtOnce(all.size(1) * all.size(2)));
  std::vector<Tensor> parts;
  for (std::int64_t from = 0; from < all.size(0); from += at_once) {
    const Tensor batch = PicturesFrom(all.narrow(0, from, std::min(at_once, all.size(0) - from))).to(device);
    parts.push_back((vae.Encode(batch).Sample({}) * vae.scale_factor()).to(at::kHalf).cpu());
  }
  return at::cat(parts).unflatten(0, {pictures.size(0), pictures.size(1)}).contiguous();
}

}  // namespace

void EncodeShard(const nn::Vae& vae, const std::filesystem::path& shard, const EncodeOptions& options) {
  const at::NoGradGuard no_gradients;
  const nn::MappedTensors file(TensorFile::Open(shard));
  const Tensor frames = Encode(vae, file.Get("frames"), options.device),
               maps = Encode(vae, file.Get("maps"), options.device);
  const TensorView views[] = {nn::ViewOf("latents", frames), nn::ViewOf("map_latents", maps)};
  WriteTensorFile(LatentsPath(shard), views,
                  {{"format", "evac-latents"},
                   {"version", "1"},
                   {"codec", options.codec},
                   {"shard_sha256", options.shard_sha256},
                   {"products", options.products},
                   {"scale_factor", ScaleText(vae.scale_factor())}});
}

bool IsEncoded(const std::filesystem::path& shard, const EncodeOptions& options) {
  if (!std::filesystem::exists(LatentsPath(shard))) return false;
  const TensorFile file = TensorFile::Open(LatentsPath(shard));
  const auto says = [&](const char* key, const std::string& wanted) {
    const auto found = file.metadata().find(key);
    return found != file.metadata().end() && found->second == wanted;
  };
  return says("codec", options.codec) &&
         (options.shard_sha256.empty() || says("shard_sha256", options.shard_sha256)) &&
         says("products", options.products) &&
         (!options.scale_factor || MayBeScaledBy(file.metadata(), *options.scale_factor));
}

}  // namespace evac::train
