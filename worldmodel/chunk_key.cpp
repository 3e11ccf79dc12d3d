#include "worldmodel/chunk_key.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "core/hash.h"
#include "core/version.h"
#include "worldmodel/nn/library.h"

namespace evac {
namespace {

/// Bytes one after the other, each piece behind its length, so that no two lists of pieces make the same text.
class Collected {
 public:
  void Add(const void* bytes, std::size_t count) {
    text_ += std::to_string(count) + ":";
    text_.append(static_cast<const char*>(bytes), count);
  }
  void Add(const std::string& text) { Add(text.data(), text.size()); }
  void Add(const std::vector<float>& values) { Add(values.data(), values.size() * sizeof(float)); }
  void Add(const cv::Mat& picture) {
    const cv::Mat rows = picture.isContinuous() ? picture : picture.clone();
    Add(fmt::format("{}x{}", rows.cols, rows.rows));
    Add(rows.data, rows.total() * rows.elemSize());
  }
  std::string Hash() const { return Sha256Hex(text_); }

 private:
  std::string text_;
};

/// One more whenever the same weights give other bits.
constexpr int kArithmetic = 4;

}  // namespace

std::string ChunkSettings(const ImaginerOptions& options) {
  const nn::ImagineOptions& sampler = options.sampler;
  return fmt::format("evac {} arithmetic {} {} {} solver {} steps {} eta {} guidance {} {} memory_not_scaled {} "
                     "residual_noise {}",
                     EVAC_VERSION, kArithmetic, nn::Arithmetic(), options.identity, static_cast<int>(sampler.solver),
                     sampler.steps, sampler.eta, sampler.guidance, sampler.guidance_rescale, sampler.memory_not_scaled,
                     sampler.residual_noise);
}

std::string ChunkKey(const ImaginerOptions& options, const ImaginedScene& scene,
                     const ChunkConditioning& conditioning) {
  Collected all;
  all.Add(ChunkSettings(options));
  all.Add(fmt::format("seed {} frames {} count {} memory {}", scene.seed, scene.frames.size(), conditioning.count,
                      fmt::join(conditioning.memory, " ")));
  for (const std::size_t frame : conditioning.memory) all.Add(scene.frames.at(frame).latent);
  for (std::size_t v = 0; v < scene.cameras.size(); ++v) {
    all.Add(scene.cameras[v].name);
    all.Add(scene.first[v]);
    all.Add(scene.newest[v]);
  }
  for (const DeltaRow& row : conditioning.deltas) all.Add(row.data(), sizeof(row));
  all.Add(conditioning.arms);
  all.Add(conditioning.turns);
  for (const std::vector<cv::Mat>& views : conditioning.pose_maps)
    for (const cv::Mat& map : views) all.Add(map);
  for (const std::vector<RayMap>& views : conditioning.rays) {
    for (const RayMap& rays : views) {
      all.Add(rays.direction);
      all.Add(rays.origin.data(), 3 * sizeof(float));
    }
  }
  return all.Hash();
}

}  // namespace evac
