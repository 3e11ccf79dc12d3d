#include <cstring>
#include <memory>
#include <opencv2/core.hpp>

#include "apps/network_parts.h"
#include "core/hash.h"
#include "worldmodel/evac_config.h"
#include "worldmodel/nn/pictures.h"
#include "worldmodel/nn/threads.h"
#include "worldmodel/nn/vae.h"
#include "worldmodel/train/weight_files.h"

namespace evac {
namespace {

/// A world's codec, and pictures of its size.
struct PictureCodec {
  PictureCodec(const std::filesystem::path& weights, const nn::ModelConfig& model)
      : config(model), file(weights), vae(nn::Scope(file, train::kCodecPrefix), model.vae) {}

  /// As an imagined world shows a first frame that it was given.
  cv::Mat Show(const cv::Mat& picture) const {
    const at::NoGradGuard no_gradients;
    const cv::Mat given = picture.isContinuous() ? picture : picture.clone();
    const at::Tensor bytes =
        at::from_blob(given.data, {1, given.rows, given.cols, 3}, at::TensorOptions().dtype(at::kByte));
    const at::Tensor image = bytes.permute({0, 3, 1, 2}).to(at::kFloat) / 255;
    const at::Tensor seen =
        nn::ToNetworkRange(nn::ResizeAntialiased(image, config.image_height_px, config.image_width_px));
    const at::Tensor shown = vae.Decode(vae.Encode(seen).Sample({}) * vae.scale_factor()).clamp(-1, 1);
    const at::Tensor back = nn::ResizeAntialiased(shown, given.rows, given.cols);
    const at::Tensor rows = nn::ToBytes(back)[0].permute({1, 2, 0}).contiguous();
    cv::Mat result(given.rows, given.cols, CV_8UC3);
    std::memcpy(result.data, rows.data_ptr<std::uint8_t>(), static_cast<std::size_t>(rows.numel()));
    return result;
  }

  nn::LibraryThreads one{1};  ///< one small picture at a time: more threads would wait for each other
  nn::ModelConfig config;
  train::CheckpointWeights file;
  nn::Vae vae;
};

}  // namespace

ClipRoundTrip CodecRoundTrip(const std::filesystem::path& weights, const std::filesystem::path& config) {
  const auto codec = std::make_shared<const PictureCodec>(weights, ReadEvacConfig(config));
  return {Sha256HexOfFile(weights), [codec](const cv::Mat& picture) { return codec->Show(picture); }};
}

}  // namespace evac
