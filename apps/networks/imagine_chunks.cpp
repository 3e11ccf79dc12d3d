#include "apps/networks/imagine_chunks.h"

#include <cstring>

#include "core/error.h"
#include "core/file.h"
#include "core/hash.h"
#include "core/tensor_file.h"

namespace evac {
namespace {

/// The two tensors of a file, as bytes.
struct ChunkBytes {
  std::string latents, frames;
  std::string Hash() const { return Sha256Hex(Sha256Hex(latents) + Sha256Hex(frames)); }
};

std::string Text(const TensorView& tensor) {
  return {reinterpret_cast<const char*>(tensor.bytes.data()), tensor.bytes.size()};
}

std::span<const std::byte> Bytes(const std::string& text) { return std::as_bytes(std::span(text)); }

TensorDeclaration LatentsOf(std::size_t count, const nn::ModelConfig& config) {
  return {"latents",
          TensorType::kF32,
          {static_cast<std::int64_t>(count), config.views, config.vae.z_channels, config.LatentHeight(),
           config.LatentWidth()}};
}

TensorDeclaration FramesOf(std::size_t count, const nn::ModelConfig& config) {
  return {"frames",
          TensorType::kU8,
          {static_cast<std::int64_t>(count), config.views, config.image_height_px, config.image_width_px, 3}};
}

ChunkBytes BytesOf(const FinishedChunk& chunk) {
  ChunkBytes bytes;
  for (const std::vector<float>& frame : chunk.latents.frames)
    bytes.latents.append(reinterpret_cast<const char*>(frame.data()), frame.size() * sizeof(float));
  for (const std::vector<cv::Mat>& views : chunk.pictures) {
    for (const cv::Mat& picture : views) {
      const cv::Mat rows = picture.isContinuous() ? picture : picture.clone();
      bytes.frames.append(reinterpret_cast<const char*>(rows.data), rows.total() * rows.elemSize());
    }
  }
  return bytes;
}

FinishedChunk ChunkOf(const ChunkBytes& bytes, std::size_t count, const nn::ModelConfig& config) {
  FinishedChunk chunk;
  const std::size_t latent = bytes.latents.size() / count;
  const char* picture = bytes.frames.data();
  for (std::size_t k = 0; k < count; ++k) {
    std::vector<float>& frame = chunk.latents.frames.emplace_back(latent / sizeof(float));
    std::memcpy(frame.data(), bytes.latents.data() + k * latent, latent);
    std::vector<cv::Mat>& views = chunk.pictures.emplace_back();
    for (std::int64_t v = 0; v < config.views; ++v) {
      cv::Mat& view = views.emplace_back(static_cast<int>(config.image_height_px),
                                         static_cast<int>(config.image_width_px), CV_8UC3);
      const std::size_t size = view.total() * view.elemSize();
      std::memcpy(view.data, picture, size);
      picture += size;
    }
  }
  return chunk;
}

void CheckDeclared(const TensorFile& file, const TensorDeclaration& wanted) {
  const TensorView& found = file.Get(wanted.name);
  if (found.type != wanted.type || found.shape != wanted.shape)
    throw TensorError(fmt::format("{}: {} has another type or shape", file.name(), wanted.name));
}

}  // namespace

ChunkFolder::ChunkFolder(std::filesystem::path folder, std::string job, const nn::ModelConfig& config)
    : folder_(std::move(folder)), job_(std::move(job)), config_(config) {
  MakeFolders(folder_);
}

std::filesystem::path ChunkFolder::FileOf(std::size_t index) const {
  return folder_ / fmt::format("chunk_{:05}.safetensors", index);
}

std::string ChunkFolder::KeyOf(std::size_t index, std::size_t count) const {
  return Sha256Hex(fmt::format("{} {} {}", job_, index, count));
}

std::optional<FinishedChunk> ChunkFolder::Load(std::size_t index, std::size_t count, std::string& warning) const {
  if (!std::filesystem::exists(FileOf(index))) return std::nullopt;
  try {
    const TensorFile file = TensorFile::Open(FileOf(index));
    const auto meta = [&](const char* name) {
      const auto found = file.metadata().find(name);
      return found == file.metadata().end() ? std::string() : found->second;
    };
    if (meta("job") != KeyOf(index, count)) throw TensorError(file.name() + ": of another job, or another length");
    CheckDeclared(file, LatentsOf(count, config_));
    CheckDeclared(file, FramesOf(count, config_));
    const ChunkBytes bytes{Text(file.Get("latents")), Text(file.Get("frames"))};
    if (meta("sha256") != bytes.Hash())
      throw TensorError(file.name() + ": its numbers are not those that were written");
    return ChunkOf(bytes, count, config_);
  } catch (const TensorError& error) {
    warning = error.what();
    return std::nullopt;
  }
}

void ChunkFolder::Save(std::size_t index, const FinishedChunk& chunk) const {
  const std::size_t count = chunk.pictures.size();
  const ChunkBytes bytes = BytesOf(chunk);
  const TensorView tensors[] = {{LatentsOf(count, config_), Bytes(bytes.latents)},
                                {FramesOf(count, config_), Bytes(bytes.frames)}};
  WriteTensorFile(FileOf(index), tensors, {{"job", KeyOf(index, count)}, {"sha256", bytes.Hash()}});
}

}  // namespace evac
