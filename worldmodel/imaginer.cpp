#include "worldmodel/imaginer.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <utility>

#include "core/error.h"
#include "core/geometry.h"
#include "core/seed.h"
#include "worldmodel/chunk_key.h"
#include "worldmodel/frame_memory.h"
#include "worldmodel/nn/hand_turns.h"
#include "worldmodel/nn/imagine.h"
#include "worldmodel/nn/noise.h"
#include "worldmodel/nn/pictures.h"

namespace evac {
namespace {

using nn::Tensor;

Tensor TensorOf(const std::vector<float>& values, at::IntArrayRef shape) {
  return at::from_blob(const_cast<float*>(values.data()), shape, at::TensorOptions().dtype(at::kFloat));
}

/// RGB picture, bytes or floats, as [3, H, W] float.
Tensor TensorOf(const cv::Mat& picture) {
  const at::ScalarType type = picture.depth() == CV_8U ? at::kByte : at::kFloat;
  const cv::Mat rows = picture.isContinuous() ? picture : picture.clone();
  return at::from_blob(rows.data, {rows.rows, rows.cols, 3}, at::TensorOptions().dtype(type))
      .permute({2, 0, 1})
      .to(at::kFloat)
      .clone();
}

Tensor StackOf(const std::vector<cv::Mat>& pictures) {
  std::vector<Tensor> parts;
  for (const cv::Mat& picture : pictures) parts.push_back(TensorOf(picture));
  return at::stack(parts);
}

/// [3, H, W] → CV_32FC3.
cv::Mat FloatPicture(const Tensor& picture) {
  const Tensor rows = picture.permute({1, 2, 0}).cpu().contiguous();
  cv::Mat image(static_cast<int>(rows.size(0)), static_cast<int>(rows.size(1)), CV_32FC3);
  std::memcpy(image.data, rows.data_ptr<float>(), static_cast<std::size_t>(rows.numel()) * sizeof(float));
  return image;
}

/// [H, W, 3] bytes → CV_8UC3.
cv::Mat BytePicture(const Tensor& rows) {
  cv::Mat image(static_cast<int>(rows.size(0)), static_cast<int>(rows.size(1)), CV_8UC3);
  std::memcpy(image.data, rows.data_ptr<std::uint8_t>(), static_cast<std::size_t>(rows.numel()));
  return image;
}

std::vector<float> ValuesOf(const Tensor& tensor) {
  const Tensor whole = tensor.cpu().contiguous();
  const float* values = whole.data_ptr<float>();
  return {values, values + whole.numel()};
}

/// Noise of one purpose: each view's from its camera's name, so that the order of the views changes nothing.
Tensor NoiseOf(const ImaginedScene& scene, const char* purpose, std::uint32_t step, at::IntArrayRef shape) {
  std::vector<Tensor> views;
  for (const Camera& camera : scene.cameras) {
    const std::uint64_t seed = SeedFor(SeedFor(scene.seed, purpose), camera.name);
    views.push_back(nn::StandardNormal({seed, static_cast<std::uint32_t>(scene.frames.size()), step}, shape));
  }
  return at::stack(views);
}

/// [T][V] ray maps → directions and origins, each [V, 3, T, h, w].
void SetRays(const std::vector<std::vector<RayMap>>& rays, nn::ChunkRequest& request) {
  std::vector<Tensor> directions, origins;
  for (const std::vector<RayMap>& views : rays) {
    std::vector<Tensor> direction, origin;
    for (const RayMap& map : views) {
      const std::vector<std::int64_t> shape = {3, map.height, map.width};
      direction.push_back(TensorOf(map.direction, shape));
      const std::vector<float> at(map.origin.begin(), map.origin.end());
      origin.push_back(TensorOf(at, {3, 1, 1}).expand(shape).clone());
    }
    directions.push_back(at::stack(direction));
    origins.push_back(at::stack(origin));
  }
  request.direction = at::stack(directions, 2);
  request.origin = at::stack(origins, 2);
}

Tensor DeltasOf(const std::vector<DeltaRow>& deltas) {
  std::vector<float> values;
  for (const DeltaRow& row : deltas) values.insert(values.end(), row.begin(), row.end());
  return TensorOf(values, {1, static_cast<std::int64_t>(deltas.size()), 14}).clone();
}

std::vector<std::int64_t> LatentShape(const nn::ModelConfig& config) {
  return {config.vae.z_channels, config.LatentHeight(), config.LatentWidth()};
}

std::vector<std::int64_t> With(std::vector<std::int64_t> shape, std::size_t at, std::int64_t side) {
  shape.insert(shape.begin() + static_cast<std::ptrdiff_t>(at), side);
  return shape;
}

/// Whether an entry of the cache, whose file anybody may have written, is of the sizes that were asked for.
bool Fits(const CachedChunk& chunk, std::size_t count, const nn::ModelConfig& config) {
  const auto values =
      static_cast<std::size_t>(config.views * config.vae.z_channels * config.LatentHeight() * config.LatentWidth());
  const cv::Size size(static_cast<int>(config.image_width_px), static_cast<int>(config.image_height_px));
  const auto is_frame = [&](const std::vector<float>& latent) { return latent.size() == values; };
  const auto is_picture = [&](const cv::Mat& picture) { return picture.size() == size; };
  const auto are_views = [&](const std::vector<cv::Mat>& views) {
    return views.size() == static_cast<std::size_t>(config.views) &&
           std::all_of(views.begin(), views.end(), is_picture);
  };
  return chunk.latents.size() == count && chunk.pictures.size() == count &&
         std::all_of(chunk.latents.begin(), chunk.latents.end(), is_frame) &&
         std::all_of(chunk.pictures.begin(), chunk.pictures.end(), are_views);
}

void CheckStart(const InitialScene& start, const nn::ModelConfig& config) {
  if (start.cameras.size() != static_cast<std::size_t>(config.views))
    throw InvalidInput("the scene has {} cameras, the network imagines {} views", start.cameras.size(), config.views);
  if (start.images.size() != start.cameras.size())
    throw InvalidInput("the scene has {} images of {} cameras", start.images.size(), start.cameras.size());
  for (std::size_t v = 0; v < start.cameras.size(); ++v) {
    const cv::Mat& image = start.images[v];
    const Camera& camera = start.cameras[v];
    if (image.type() != CV_8UC3 || image.cols != camera.width_px || image.rows != camera.height_px)
      throw InvalidInput("the first image of camera {} is {}x{} with {} channels, wanted {}x{} RGB", camera.name,
                         image.cols, image.rows, image.channels(), camera.width_px, camera.height_px);
  }
}

}  // namespace

Imaginer::Imaginer(std::unique_ptr<const nn::EvacModel> model, ImaginerOptions options)
    : model_(std::move(model)), options_(std::move(options)) {
  if (!options_.cache) return;
  if (options_.identity.empty()) throw InvalidInput("a chunk cache wants to know which network it is for");
  cache_ = std::make_unique<ChunkCache>(*options_.cache);
}
Imaginer::Imaginer(Imaginer&&) noexcept = default;
Imaginer& Imaginer::operator=(Imaginer&&) noexcept = default;
Imaginer::~Imaginer() = default;

const nn::ModelConfig& Imaginer::config() const { return model_->config(); }

ImaginedScene Imaginer::Begin(const InitialScene& start, std::uint64_t seed) const {
  const at::NoGradGuard no_gradients;
  CheckStart(start, config());
  ImaginedScene scene{.cameras = {}, .frames = {}, .first = {}, .newest = {}, .seed = seed};
  std::vector<Tensor> pictures;
  for (std::size_t v = 0; v < start.cameras.size(); ++v) {
    scene.cameras.push_back(Resized(start.cameras[v], static_cast<int>(config().image_width_px),
                                    static_cast<int>(config().image_height_px)));
    const Tensor given = TensorOf(start.images[v]).unsqueeze(0) / 255;
    pictures.push_back(
        nn::ToNetworkRange(nn::ResizeAntialiased(given, config().image_height_px, config().image_width_px)));
    scene.first.push_back(FloatPicture(pictures.back()[0]));
  }
  scene.newest = scene.first;
  const Tensor noise = NoiseOf(scene, "first frame", 0, LatentShape(config()));
  const at::Device device(options_.device);
  const Tensor latent = nn::EncodeImages(*model_, at::cat(pictures).to(device), noise.to(device));  // [V, z, h, w]
  scene.frames.assign(static_cast<std::size_t>(config().memory), {ValuesOf(latent), start.arms});
  return scene;
}

std::vector<std::size_t> Imaginer::Remember(const ImaginedScene& scene) const {
  return SparseMemory(scene.frames.size(), static_cast<std::size_t>(config().memory));
}

ChunkConditioning Imaginer::Condition(const ImaginedScene& scene, std::vector<std::size_t> memory,
                                      std::span<const Arms> targets) const {
  return evac::Condition(scene, std::move(memory), targets, config(), options_.conditioning);
}

ChunkLatents Imaginer::Denoise(const ImaginedScene& scene, const ChunkConditioning& conditioning) const {
  if (!cache_) return DenoiseAnew(scene, conditioning);
  const std::string key = ChunkKey(options_, scene, conditioning);
  auto known = cache_->Find(key);
  if (known && Fits(*known, conditioning.count, config()))
    return {std::move(known->latents), key, std::move(known->pictures)};
  ChunkLatents latents = DenoiseAnew(scene, conditioning);
  latents.key = key;
  return latents;
}

Pictures Imaginer::Decode(const ChunkLatents& latents) const {
  if (!latents.pictures.empty()) return latents.pictures;
  Pictures pictures = DecodeAnew(latents);
  if (cache_ && !latents.key.empty()) cache_->Keep(latents.key, {latents.frames, pictures});
  return pictures;
}

ChunkLatents Imaginer::DenoiseAnew(const ImaginedScene& scene, const ChunkConditioning& conditioning) const {
  const at::NoGradGuard no_gradients;
  const std::vector<std::int64_t> frame = LatentShape(config());  // [z, h, w]
  const at::Device device(options_.device);
  nn::ChunkRequest request;
  std::vector<Tensor> memory, maps;
  for (const std::size_t index : conditioning.memory)
    memory.push_back(TensorOf(scene.frames.at(index).latent, With(frame, 0, config().views)));
  request.memory = at::stack(memory, 2).to(device);
  const bool starts = conditioning.memory.front() < static_cast<std::size_t>(config().memory);
  request.image = StackOf(starts ? scene.first : scene.newest).to(device);
  for (const std::vector<cv::Mat>& views : conditioning.pose_maps)
    maps.push_back(nn::ToNetworkRange(StackOf(views) / 255));
  const Tensor map_noise = NoiseOf(scene, "pose maps", 0, With(frame, 0, config().chunk));
  request.pose_maps = nn::EncodePoseMaps(*model_, at::stack(maps, 1).to(device), map_noise.to(device));
  SetRays(conditioning.rays, request);
  request.direction = request.direction.to(device);
  request.origin = request.origin.to(device);
  request.deltas = DeltasOf(conditioning.deltas).to(device);
  request.arms = TensorOf(conditioning.arms, {1, config().Frames(), 16}).to(device);
  request.turns =
      TensorOf(conditioning.turns, {1, config().Frames(), static_cast<std::int64_t>(nn::kTurnRow)}).to(device);

  std::uint32_t step = 0;  // first the noise from which the chunk is denoised, then the sampler's
  const auto draw = [&](std::int64_t frames) {
    return NoiseOf(scene, "sampler", step++, With(frame, 1, frames)).to(device);
  };
  const nn::ChunkNoise noise{draw(config().chunk), [&] { return draw(config().Frames()); }};
  const Tensor imagined = nn::ImagineChunk(*model_, request, noise, options_.sampler);  // [V, z, T, h, w]
  ChunkLatents latents;
  for (std::size_t k = 0; k < conditioning.count; ++k)
    latents.frames.push_back(ValuesOf(imagined.select(2, config().memory + static_cast<std::int64_t>(k))));
  return latents;
}

Pictures Imaginer::DecodeAnew(const ChunkLatents& latents) const {
  const at::NoGradGuard no_gradients;
  std::vector<Tensor> all;
  for (const std::vector<float>& frame : latents.frames)
    all.push_back(TensorOf(frame, With(LatentShape(config()), 0, config().views)));
  if (all.empty()) return {};
  const Tensor decoded =
      nn::DecodeLatents(*model_, at::cat(all).to(at::Device(options_.device)));  // [frames V, 3, H, W]
  if (!decoded.isfinite().all().item<bool>())
    throw InternalError("the codec answers finite latents with numbers that are not");
  const Tensor bytes = nn::ToBytes(decoded).permute({0, 2, 3, 1}).cpu().contiguous();
  Pictures pictures(all.size());
  for (std::size_t i = 0; i < all.size() * static_cast<std::size_t>(config().views); ++i)
    pictures[i / static_cast<std::size_t>(config().views)].push_back(BytePicture(bytes[static_cast<std::int64_t>(i)]));
  return pictures;
}

void Imaginer::Append(ImaginedScene& scene, std::span<const Arms> targets, ChunkLatents latents,
                      const Pictures& pictures) const {
  if (latents.frames.size() != targets.size() || pictures.size() != targets.size())
    throw InternalError("{} latents and {} pictures of {} targets", latents.frames.size(), pictures.size(),
                        targets.size());
  const at::NoGradGuard no_gradients;
  if (options_.decoded_start && scene.frames.size() == static_cast<std::size_t>(config().memory)) {
    const Tensor start = TensorOf(scene.frames.front().latent, With(LatentShape(config()), 0, config().views));
    const Tensor decoded = nn::DecodeLatents(*model_, start.to(at::Device(options_.device))).clamp(-1, 1);
    for (std::size_t v = 0; v < scene.first.size(); ++v)
      scene.first[v] = FloatPicture(decoded[static_cast<std::int64_t>(v)]);
  }
  for (std::size_t k = 0; k < targets.size(); ++k) scene.frames.push_back({std::move(latents.frames[k]), targets[k]});
  for (std::size_t v = 0; v < scene.newest.size(); ++v)
    scene.newest[v] = FloatPicture(nn::ToNetworkRange(TensorOf(pictures.back()[v]) / 255));
}

std::optional<std::string> WhatIsWrong(const ChunkLatents& latents) {
  std::size_t wrong = 0, all = 0;
  for (const std::vector<float>& frame : latents.frames) {
    all += frame.size();
    wrong += static_cast<std::size_t>(
        std::count_if(frame.begin(), frame.end(), [](float value) { return !std::isfinite(value); }));
  }
  if (wrong == 0) return std::nullopt;
  return fmt::format("{} of {} numbers of the imagined latents are not finite", wrong, all);
}

}  // namespace evac
