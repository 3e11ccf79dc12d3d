#include <fmt/format.h>

#include <cmath>

#include "apps/golden/golden_checks.h"
#include "apps/golden/golden_geometry.h"
#include "worldmodel/nn/diffusion_loss.h"
#include "worldmodel/nn/imagine.h"
#include "worldmodel/nn/parameters.h"

namespace evac::golden {
namespace {

/// The parameters that training moves: the denoiser and the image resampler.
bool IsTrained(const std::string& key) {
  return key.starts_with("model.diffusion_model.") || key.starts_with("image_proj_model.");
}

class Training {
 public:
  Training(const GoldenFile& file, Comparison& comparison)
      : file_(file),
        comparison_(comparison),
        config_(file.Model()),
        weights_(hashes_),
        model_(weights_, config_),
        noise_(file.Noise()) {}

  void Run() {
    {
      const at::NoGradGuard no_gradients;
      Encode();
      Project();
    }
    for (const auto& parameter : weights_.parameters())
      Tensor(parameter.tensor).set_requires_grad(IsTrained(parameter.key));
    const Tensor loss = Loss();
    comparison_.Close("loss", loss.detach(), file_.Get("loss"), kTrainTolerance);
    loss.backward();
    CompareGradients();
  }

 private:
  std::int64_t Rows() const { return latents_.size(0); }

  /// [B, 3, T, H, W] or [B, V, 3, T, H, W] → [BV, 3, T, H, W]
  Tensor Flat(const std::string& name) const {
    const Tensor tensor = file_.Get(name);
    return tensor.dim() == 6 ? tensor.flatten(0, 1) : tensor;
  }

  Tensor Encoded(const Tensor& pictures) {
    const std::int64_t rows = pictures.size(0), frames = pictures.size(2);
    std::vector<Tensor> noise;
    for (std::int64_t count = 0; count < rows * frames; count += noise.back().size(0))
      noise.push_back(noise_[drawn_++]);
    const Tensor z = nn::EncodeImages(model_, pictures.transpose(1, 2).flatten(0, 1), at::cat(noise, 0));
    return z.unflatten(0, {rows, frames}).transpose(1, 2).contiguous();
  }

  void Encode() {
    video_ = Flat("video");
    latents_ = Encoded(video_);
    comparison_.Close("z", latents_, file_.Get("z"), kModuleTolerance);
    const Tensor maps = Encoded(Flat("traj"));
    concat_.pose_map =
        at::cat({at::zeros_like(maps.narrow(2, 0, config_.memory)), maps.narrow(2, config_.memory, config_.chunk)}, 2);
    concat_.mask = at::ones_like(maps.narrow(1, 0, 1));
    nn::Remember(model_, latents_.narrow(2, 0, config_.memory), concat_);
  }

  void Project() {
    const Tensor cameras = file_.Get("extrinsic").reshape({Rows(), -1, 4, 4}),
                 intrinsics = file_.Get("intrinsic").reshape({-1, 3, 3});
    std::vector<Tensor> directions, origins;
    const double stride = 1.0 / static_cast<double>(config_.vae.Stride());
    for (std::int64_t row = 0; row < Rows(); ++row) {
      const Eigen::Matrix3f k =
          ScaledIntrinsics(Matrix3(intrinsics[row * intrinsics.size(0) / Rows()]), stride, stride);
      for (std::int64_t t = 0; t < cameras.size(1); ++t) {
        const Rays rays = AsTensors(MakeRayMap(k, Matrix4(cameras[row][t]), static_cast<int>(config_.LatentHeight()),
                                               static_cast<int>(config_.LatentWidth())));
        directions.push_back(rays.direction);
        origins.push_back(rays.origin);
      }
    }
    const auto by_row = [&](const std::vector<Tensor>& parts) {
      return at::stack(parts).unflatten(0, {Rows(), cameras.size(1)}).transpose(1, 2);
    };
    concat_.direction = by_row(directions);
    concat_.origin = by_row(origins);
  }

  Tensor Loss() {
    const std::int64_t scenes = file_.Get("delta_action").size(0);
    const Tensor image_tokens = model_.ImageTokens(video_.select(2, 0));
    const Tensor tokens = model_.ContextTokens(image_tokens, model_.ActionTokens(file_.Get("delta_action")));
    CompareConditioning(tokens);
    const auto constant = [&](std::int64_t value) { return at::full({scenes}, value, at::kLong); };
    nn::DiffusionBatch batch{
        latents_,       concat_,       {tokens, constant(config_.fps), constant(config_.domain), Rows() / scenes},
        file_.Get("t"), noise_.back(), config_.memory,
        std::nullopt};
    const std::int64_t divisor = file_.Get("randint").item<std::int64_t>();
    if (divisor > 0) {
      const Tensor angle = (noise_[drawn_] * 2 - 1) * 1.57;
      batch.teacher_forcing = nn::TeacherForcing{angle.reshape({Rows(), config_.memory}), divisor, noise_[drawn_ + 1]};
    }
    return nn::DiffusionLoss(model_, batch);
  }

  void CompareConditioning(const Tensor& tokens) {
    const Tensor* parts[] = {&concat_.image, &concat_.mask, &concat_.pose_map, &concat_.direction, &concat_.origin};
    for (int i = 0; i < 5; ++i) {
      const std::string name = fmt::format("cond.c_concat{}", i);
      comparison_.Close(name, *parts[i], file_.Get(name), kModuleTolerance);
    }
    comparison_.Close("cond.c_crossattn0", tokens.detach(), file_.Get("cond.c_crossattn0"), kModuleTolerance);
  }

  void CompareGradients() {
    const auto norm = [](const Tensor& gradient) { return gradient.to(at::kDouble).norm().item<double>(); };
    const auto compare = [&](const std::string& name, double got) {
      const double wanted = file_.Get(name).item<double>();
      comparison_.Within(name, at::full({}, got / wanted, at::kDouble), at::ones({}, at::kDouble), kTrainTolerance);
    };
    double squares = 0;
    for (const auto& parameter : weights_.parameters()) {
      if (!IsTrained(parameter.key) || !parameter.tensor.grad().defined()) continue;
      squares += std::pow(norm(parameter.tensor.grad()), 2);
    }
    compare("gradnorm_total_optimised", std::sqrt(squares));
    for (const std::string& name : file_.Names()) {
      if (name.starts_with("gradnorm.")) compare(name, norm(weights_.Get(name.substr(9)).grad()));
    }
    const Tensor wanted = file_.Get("grad.out2"), got = weights_.Get("model.diffusion_model.out.2.weight").grad();
    const double largest = wanted.abs().max().item<double>();
    comparison_.Within("grad.out2", got / largest, wanted / largest, kTrainTolerance);
  }

  const GoldenFile& file_;
  Comparison& comparison_;
  nn::ModelConfig config_;
  nn::HashWeights hashes_;
  nn::RecordedWeights weights_;
  nn::EvacModel model_;
  std::vector<Tensor> noise_;
  std::size_t drawn_ = 0;
  Tensor video_, latents_;
  nn::Concat concat_;
};

}  // namespace

void CheckTraining(const GoldenFile& file, Workshop&, Comparison& comparison) { Training(file, comparison).Run(); }

}  // namespace evac::golden
