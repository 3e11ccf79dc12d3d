#include "worldmodel/clip.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <opencv2/imgproc.hpp>

#include "core/error.h"
#include "core/geometry.h"
#include "worldmodel/action_delta.h"
#include "worldmodel/conditioning.h"
#include "worldmodel/nn/pictures.h"

namespace evac {
namespace {

constexpr int kCropParts = 8;           // a crop leaves out at most an eighth before it, and an eighth after

/// Uniform in low … high, both included.
int Between(int low, int high, SplitMix64& random) {
  return low + static_cast<int>(random.Below(static_cast<std::uint64_t>(high - low + 1)));
}

/// `crop` of a picture of size `first`, as the same part of a picture of another size.
Crop SamePart(const Crop& crop, const cv::Size& first_px, const cv::Size& other_px) {
  if (first_px == other_px) return crop;
  const double x = static_cast<double>(other_px.width) / first_px.width;
  const double y = static_cast<double>(other_px.height) / first_px.height;
  const auto scaled = [](int px, double factor) { return static_cast<int>(std::lround(px * factor)); };
  Crop part{scaled(crop.x_px, x), scaled(crop.y_px, y), scaled(crop.width_px, x), scaled(crop.height_px, y)};
  part.width_px = std::min(part.width_px, other_px.width - part.x_px);
  part.height_px = std::min(part.height_px, other_px.height - part.y_px);
  return part;
}

/// The part of the picture, resized; a crop that has the size already is copied as it is.
cv::Mat CropAndResize(const cv::Mat& picture, const Crop& crop, const cv::Size& size_px) {
  const cv::Mat part = picture(cv::Rect(crop.x_px, crop.y_px, crop.width_px, crop.height_px)).clone();
  if (part.size() == size_px) return part;
  const nn::Tensor rows = at::from_blob(part.data, {part.rows, part.cols, 3}, at::TensorOptions().dtype(at::kByte));
  const nn::Tensor image = rows.permute({2, 0, 1}).unsqueeze(0).to(at::kFloat);
  const nn::Tensor resized = nn::ResizeAntialiased(image, size_px.height, size_px.width).clamp(0, 255).round();
  const nn::Tensor bytes = resized.squeeze(0).permute({1, 2, 0}).to(at::kByte).contiguous();
  return cv::Mat(size_px, CV_8UC3, bytes.data_ptr<std::uint8_t>()).clone();
}

void AppendPicture(const cv::Mat& picture, std::vector<std::uint8_t>& to) {
  const cv::Mat rows = picture.isContinuous() ? picture : picture.clone();
  to.insert(to.end(), rows.data, rows.data + rows.total() * rows.elemSize());
}

template <typename Matrix>
void AppendRowMajor(const Matrix& matrix, std::vector<float>& to) {
  for (Eigen::Index row = 0; row < matrix.rows(); ++row) {
    for (Eigen::Index column = 0; column < matrix.cols(); ++column)
      to.push_back(static_cast<float>(matrix(row, column)));
  }
}

void AppendCamera(const Camera& camera, const Arms& arms, Clip& clip) {
  AppendRowMajor(BaseFromCamera(camera, arms).matrix(), clip.c2w);
  Eigen::Matrix3d k;
  k << camera.fx_px, 0, camera.cx_px, 0, camera.fy_px, camera.cy_px, 0, 0, 1;
  AppendRowMajor(k, clip.k);
}

void AppendArms(const Arms* before, const Arms& now, const ClipOptions& options, Clip& clip) {
  const std::vector<float> action = ActionRow(now);
  clip.actions.insert(clip.actions.end(), action.begin(), action.end());
  std::array<float, 14> delta{};
  if (before != nullptr)
    delta = Normalised(DeltaBetween(GrippersOf(*before), GrippersOf(now)), options.statistics, options.delta_frames);
  clip.deltas.insert(clip.deltas.end(), delta.begin(), delta.end());
}

EpisodeTruth NothingKnown(std::size_t frames, const std::vector<Camera>& cameras) {
  EpisodeTruth truth;
  for (const Camera& camera : cameras) truth.cameras.push_back(camera.name);
  truth.object_px.assign(frames * cameras.size() * 2, std::numeric_limits<float>::quiet_NaN());
  truth.contact.assign(frames, 0);
  return truth;
}

}  // namespace

Crop RandomCrop(const cv::Size& picture_px, SplitMix64& random) {
  Crop crop;
  crop.y_px = Between(0, picture_px.height / kCropParts, random);
  crop.x_px = Between(0, picture_px.width / kCropParts, random);
  const int height_px = picture_px.height - crop.y_px, width_px = picture_px.width - crop.x_px;
  crop.height_px = Between(std::min(height_px, 7 * picture_px.height / kCropParts), height_px, random);
  crop.width_px = Between(std::min(width_px, 7 * picture_px.width / kCropParts), width_px, random);
  return crop;
}

Camera Cropped(const Camera& camera, const Crop& crop, const cv::Size& picture_px) {
  Camera part = camera;
  part.cx_px -= crop.x_px;
  part.cy_px -= crop.y_px;
  part.width_px = crop.width_px;
  part.height_px = crop.height_px;
  return Resized(part, picture_px.width, picture_px.height);
}

ClipSource ReadClipSource(const Recording& recording, const EpisodeTruth* truth) {
  ClipSource source;
  source.arms = ToldTrack(recording);
  source.cameras = recording.cameras;
  const std::size_t steps = source.arms.size();
  RecordedFrames walk(recording);
  for (std::size_t step = 0; step < steps; ++step) {
    std::vector<cv::Mat>& pictures = source.pictures.emplace_back();
    for (const cv::Mat& picture : walk.Next()) pictures.push_back(picture.clone());
  }
  source.truth = truth != nullptr ? *truth : NothingKnown(steps, recording.cameras);
  for (float& value : source.truth.object_px) value /= static_cast<float>(recording.shrink);
  return source;
}

Clip MakeClip(const ClipSource& source, const Crop& crop, const ClipOptions& options) {
  const at::NoGradGuard no_gradients;
  const cv::Size &size_px = options.picture_px, first_px = source.pictures.front().front().size();
  Clip clip;
  clip.crop = crop;
  clip.length = source.arms.size();
  clip.views = source.cameras.size();
  clip.contact = source.truth.contact;
  std::vector<Crop> parts;
  std::vector<Camera> cameras;
  for (const Camera& camera : source.cameras) {
    parts.push_back(SamePart(crop, first_px, {camera.width_px, camera.height_px}));
    cameras.push_back(Cropped(camera, parts.back(), size_px));
  }
  for (std::size_t step = 0; step < clip.length; ++step) {
    const Arms& arms = source.arms[step];
    AppendArms(step == 0 ? nullptr : &source.arms[step - 1], arms, options, clip);
    const Arms seen = SeenArms(step == 0 ? arms : source.arms[step - 1], arms, options.pose_map.lag_frames);
    const std::vector<cv::Mat> maps = DrawPoseMaps(seen, cameras, options.pose_map);
    for (std::size_t view = 0; view < clip.views; ++view) {
      const Crop& part = parts[view];
      AppendPicture(CropAndResize(source.pictures[step][view], part, size_px), clip.frames);
      AppendPicture(maps[view], clip.maps);
      AppendCamera(cameras[view], seen, clip);
      const float* object_px = source.truth.At(step, view);
      clip.object_px.push_back((object_px[0] - static_cast<float>(part.x_px)) * static_cast<float>(size_px.width) /
                               static_cast<float>(part.width_px));
      clip.object_px.push_back((object_px[1] - static_cast<float>(part.y_px)) * static_cast<float>(size_px.height) /
                               static_cast<float>(part.height_px));
    }
  }
  return clip;
}

}  // namespace evac
