#include <fmt/format.h>

#include "apps/golden/golden_checks.h"
#include "apps/golden/golden_geometry.h"
#include "worldmodel/frame_memory.h"
#include "worldmodel/nn/imagine.h"
#include "worldmodel/nn/pictures.h"

namespace evac::golden {
namespace {

constexpr double kMapTolerance = 3e-4;
constexpr double kChainTolerance = 1e-4;  // codec, sampler and codec again, chunk upon chunk

/// The recorded random numbers, handed out in the order they were drawn.
class Draws {
 public:
  explicit Draws(std::vector<Tensor> noise) : noise_(std::move(noise)) {}
  Tensor Next() {
    if (at_ == noise_.size()) throw TensorError("more random numbers are needed than were recorded");
    return noise_[at_++];
  }
  /// As many batches as hold `count` rows.
  Tensor Rows(std::int64_t count) {
    std::vector<Tensor> parts;
    for (std::int64_t rows = 0; rows < count; rows += parts.back().size(0)) parts.push_back(Next());
    return at::cat(parts, 0);
  }

 private:
  std::vector<Tensor> noise_;
  std::size_t at_ = 0;
};

nn::Conditioning RecordedConditioning(const GoldenFile& file, const std::string& prefix,
                                      const nn::ModelConfig& config) {
  const auto concat = [&](int i) { return file.Get(fmt::format("{}c_concat{}", prefix, i)); };
  return {config.views,
          config.memory,
          {concat(0), concat(1), concat(2), concat(3), concat(4)},
          file.Get(prefix + "c_crossattn0")};
}

void CompareConditioning(const GoldenFile& file, const std::string& prefix, const nn::Conditioning& got,
                         double tolerance, Comparison& comparison) {
  const Tensor* parts[] = {&got.concat.image, &got.concat.mask, &got.concat.pose_map, &got.concat.direction,
                           &got.concat.origin};
  for (int i = 0; i < 5; ++i) {
    const std::string name = fmt::format("{}c_concat{}", prefix, i);
    comparison.Close(name, *parts[i], file.Get(name), tolerance);
  }
  comparison.Close(prefix + "c_crossattn0", got.tokens, file.Get(prefix + "c_crossattn0"), tolerance);
}

/// One recorded inference: several chunks, each seeing what the ones before it imagined.
class Inference {
 public:
  Inference(const GoldenFile& file, const nn::EvacModel& model, Comparison& comparison)
      : file_(file),
        model_(model),
        config_(file.Model()),
        comparison_(comparison),
        draws_(file.Noise()),
        actions_(file.Get("action")),
        tolerance_(file.Number("cfg", 1) == 1 ? kModuleTolerance : kGuidedTolerance),
        plan_{static_cast<std::size_t>(config_.chunk), static_cast<std::size_t>(config_.memory), true} {}

  void Run() {
    const auto rows = static_cast<std::size_t>(actions_.size(0));
    for (std::size_t index = 0; index < ChunkCount(rows, plan_); ++index)
      RunChunk(index, PlanChunk(rows, index, plan_));
    comparison_.Same("traj_u8", at::cat(maps_, 0), file_.Get("traj_u8"));
    const Tensor wanted = file_.Get("frames_u8");
    comparison_.Within("frames_u8", at::cat(frames_, 0).narrow(0, 0, wanted.size(0)), wanted, 1);
  }

 private:
  std::string Name(std::size_t index, const std::string& name) const { return fmt::format("chunk{}.{}", index, name); }

  /// Frame f of all views as pictures side by side, [F, H, V W, 3].
  static Tensor SideBySide(const Tensor& bytes) {
    return bytes.permute({2, 3, 0, 4, 1}).flatten(2, 3);
  }  // [V, 3, F, H, W]

  Tensor PerView(const Tensor& tensor, std::int64_t view, std::int64_t sides) const {
    return tensor.dim() > sides ? tensor[view] : tensor;
  }

  /// Chunk 0: the frames that were given, the last repeated, all encoded. @returns [V, z, T, h, w]
  Tensor EncodeStart() {
    const Tensor given = file_.Get("image_views_u8").transpose(0, 1).to(at::kFloat) / 255;  // [V, 3, H, W]
    const Tensor start =
        nn::ToNetworkRange(nn::ResizeAntialiased(given, config_.image_height_px, config_.image_width_px));
    images_ = start.unsqueeze(2);  // [V, 3, frames, H, W]
    const std::int64_t count = config_.views * config_.Frames();
    const Tensor z = nn::EncodeImages(model_, start.repeat_interleave(config_.Frames(), 0), draws_.Rows(count));
    return z.reshape({config_.views, config_.Frames(), z.size(1), z.size(2), z.size(3)}).transpose(1, 2);
  }

  /// What the chunk's maps and rays show.
  void Draw(std::size_t index, const ChunkPlan& plan, nn::ChunkRequest& request) {
    const Tensor intrinsics = file_.Get("K"), cameras = file_.Get("w2c"), picture = file_.Get("image_views_u8");
    std::vector<Tensor> maps, directions, origins, extrinsics;
    for (std::int64_t v = 0; v < config_.views; ++v) {
      const Eigen::Matrix3f k =
          ScaledIntrinsics(Matrix3(PerView(intrinsics, v, 2)),
                           static_cast<double>(config_.image_width_px) / static_cast<double>(picture.size(3)),
                           static_cast<double>(config_.image_height_px) / static_cast<double>(picture.size(2)));
      const double stride = 1.0 / static_cast<double>(config_.vae.Stride());
      for (std::size_t i = 0; i < plan.rows.size(); ++i) {
        const Eigen::Matrix4f camera_from_base =
            Matrix4(PerView(cameras, v, 3)[static_cast<std::int64_t>(plan.rows[i])]);
        const Eigen::Matrix4f base_from_camera = camera_from_base.inverse();
        const Rays rays =
            AsTensors(MakeRayMap(ScaledIntrinsics(k, stride, stride), base_from_camera,
                                 static_cast<int>(config_.LatentHeight()), static_cast<int>(config_.LatentWidth())));
        directions.push_back(rays.direction);
        origins.push_back(rays.origin);
        for (int j = 0; j < 16; ++j) extrinsics.push_back(at::full({1}, base_from_camera(j / 4, j % 4), at::kFloat));
        if (i < plan.memory.size()) continue;
        const PoseMapView view{camera_from_base, k, static_cast<int>(config_.image_width_px),
                               static_cast<int>(config_.image_height_px)};
        const auto grippers = GrippersOfAction(actions_[static_cast<std::int64_t>(plan.rows[i])]);
        maps.push_back(AsTensor(DrawPoseMap(grippers, view, ReferencePoseMap())));
      }
    }
    const auto by_view = [&](const std::vector<Tensor>& parts) {
      return at::stack(parts).unflatten(0, {config_.views, static_cast<std::int64_t>(parts.size()) / config_.views});
    };
    const Tensor bytes = by_view(maps);                             // [V, K, H, W, 3]
    maps_.push_back(bytes.permute({1, 2, 0, 3, 4}).flatten(2, 3));  // [K, H, V W, 3]
    pictures_ = nn::ToNetworkRange(bytes.permute({0, 1, 4, 2, 3}).to(at::kFloat) / 255);
    request.direction = by_view(directions).transpose(1, 2);
    request.origin = by_view(origins).transpose(1, 2);
    comparison_.Within(Name(index, "extrinsic"), at::cat(extrinsics).reshape({1, config_.views, -1, 4, 4}),
                       file_.Get(Name(index, "extrinsic")), 1e-6);
  }

  Tensor Deltas(std::size_t index, const ChunkPlan& plan) {
    const Tensor all = file_.Get("delta");
    std::vector<Tensor> rows;
    for (const auto& delta : plan.deltas)
      rows.push_back(delta ? all[static_cast<std::int64_t>(*delta)] : at::zeros_like(all[0]));
    const Tensor deltas = at::stack(rows).unsqueeze(0);
    comparison_.Same(Name(index, "delta_in"), deltas, file_.Get(Name(index, "delta_in")));
    return deltas;
  }

  Tensor Pick(const Tensor& frames, const std::vector<std::size_t>& indices) const {
    std::vector<Tensor> picked;
    for (const std::size_t i : indices) picked.push_back(frames.select(2, static_cast<std::int64_t>(i)));
    return at::stack(picked, 2);
  }

  nn::ImagineOptions Options() const {
    nn::ImagineOptions options;
    options.steps = static_cast<std::int64_t>(file_.Number("ddim_steps", 27));
    options.eta = file_.Number("eta", 1);
    options.guidance = file_.Number("cfg", 1);
    options.guidance_rescale = file_.Number("guidance_rescale", 0);
    options.memory_not_scaled = options.residual_noise = true;
    return options;
  }

  void RunChunk(std::size_t index, const ChunkPlan& plan) {
    nn::ChunkRequest request;
    if (index == 0) {
      const Tensor z = EncodeStart();
      comparison_.Close(Name(0, "z"), z, file_.Get(Name(0, "z")), kModuleTolerance);
      request.memory = z.narrow(2, 0, config_.memory).contiguous();
      request.image = images_.select(2, 0);
    } else {
      request.memory = Pick(latents_, plan.memory);
      const Tensor recorded = file_.Get(Name(index, "pre_z"));
      comparison_.Close(Name(index, "pre_z"), request.memory, recorded.narrow(2, 0, config_.memory), tolerance_);
      request.image = images_.select(2, static_cast<std::int64_t>(plan.memory.front()));
    }
    Draw(index, plan, request);
    request.deltas = Deltas(index, plan);
    Imagine(index, request);
  }

  void Imagine(std::size_t index, nn::ChunkRequest request) {
    const Tensor maps = draws_.Rows(config_.views * config_.Frames());
    const Tensor map_noise =
        maps.unflatten(0, {config_.views, config_.Frames()}).narrow(1, config_.memory, config_.chunk);
    const Tensor start = draws_.Next();
    request.pose_maps = MapLatents(index, map_noise);
    nn::Conditioning conditioning = nn::Condition(model_, request);
    const Tensor samples = nn::ImagineChunk(model_, request, {start, [&] { return draws_.Next(); }}, Options());
    draws_.Next();  // the reference draws once more, for nothing
    comparison_.Close(Name(index, "samples"), samples, file_.Get(Name(index, "samples")), tolerance_);
    // The reference moves its image condition on, in place, before it is recorded: the memory less its oldest, then the
    // newest.
    const Tensor moved =
        at::cat({samples.narrow(2, 1, config_.memory - 1), samples.narrow(2, config_.Frames() - 1, 1)}, 2);
    nn::Remember(model_, moved, conditioning.concat);
    CompareConditioning(file_, Name(index, "cond."), conditioning, tolerance_, comparison_);
    Remember(index, samples);
  }

  /// The reference's own rounding is large here: of chunk 0's maps (channels last in its memory, where libtorch 1.13's
  /// normalisation subtracts squares) it is 8e-5 off a computation in double, we are 2e-6 off. So ours are compared,
  /// and the recorded ones go on: what follows is compared for itself.
  Tensor MapLatents(std::size_t index, const Tensor& noise) {
    const std::string name = Name(index, "cond.c_concat2");
    const Tensor recorded = file_.Get(name).narrow(2, config_.memory, config_.chunk).contiguous();
    comparison_.Close(name + " (ours)", nn::EncodePoseMaps(model_, pictures_, noise), recorded, kMapTolerance);
    return recorded;
  }

  /// The reference decodes the memory of chunk 0 too, and sees that, not what it was given (quirk decoded_start).
  void Remember(std::size_t index, const Tensor& samples) {
    const std::int64_t from = index == 0 ? 0 : config_.memory, count = config_.Frames() - from;
    const Tensor fresh = samples.narrow(2, from, count);
    const Tensor decoded = nn::DecodeLatents(model_, fresh.transpose(1, 2).flatten(0, 1)).clamp(-1, 1);
    const Tensor pictures = decoded.unflatten(0, {config_.views, count}).transpose(1, 2);  // [V, 3, frames, H, W]
    latents_ = index == 0 ? fresh : at::cat({latents_, fresh}, 2);
    images_ = index == 0 ? pictures : at::cat({images_, pictures}, 2);
    frames_.push_back(SideBySide(nn::ToBytes(pictures.narrow(2, count - config_.chunk, config_.chunk))));
  }

  const GoldenFile& file_;
  const nn::EvacModel& model_;
  nn::ModelConfig config_;
  Comparison& comparison_;
  Draws draws_;
  Tensor actions_;
  double tolerance_;
  ChunkPlanOptions plan_;
  Tensor pictures_;          ///< [V, K, 3, H, W]: this chunk's maps
  Tensor latents_, images_;  ///< [V, z or 3, frames so far, ...]
  std::vector<Tensor> frames_, maps_;
};

}  // namespace

void CheckDdim(const GoldenFile& file, Workshop& workshop, Comparison& comparison) {
  const nn::ModelConfig config = file.Model();
  const nn::EvacModel& model = workshop.ModelFor(config);
  const double guidance = file.Number("cfg", 1), tolerance = guidance == 1 ? kModuleTolerance : kGuidedTolerance;
  const nn::Conditioning conditioning = RecordedConditioning(file, "cond.", config);
  nn::Denoise denoise = nn::MakeDenoise(model, conditioning);
  if (guidance != 1)
    denoise = nn::Guided(denoise, nn::MakeDenoise(model, RecordedConditioning(file, "uncond.", config)), guidance,
                         file.Number("guidance_rescale", 0));
  Draws draws(file.Noise());
  const Tensor memory = conditioning.concat.image.narrow(2, 0, config.memory);
  const nn::SampleStart start{at::cat({memory, draws.Next()}, 2), config.memory, false};
  const nn::DdimOptions options{static_cast<std::int64_t>(file.Number("steps", 5)), file.Number("eta", 1), true};
  const nn::StepObserver observer = [&](std::int64_t index, const Tensor& x, const Tensor& x0) {
    const std::string step = fmt::format("step{}.", index);
    if (file.Has(step + "x_prev")) comparison.Close(step + "x_prev", x, file.Get(step + "x_prev"), tolerance);
    if (file.Has(step + "pred_x0")) comparison.Close(step + "pred_x0", x0, file.Get(step + "pred_x0"), tolerance);
  };
  const Tensor samples = nn::SampleDdim(
      model.schedule(), options, start, denoise, [&] { return draws.Next(); }, &observer);
  comparison.Close("samples", samples, file.Get("samples"), tolerance);
}

void CheckInference(const GoldenFile& file, Workshop& workshop, Comparison& comparison) {
  Inference(file, workshop.ModelFor(file.Model()), comparison).Run();
}

}  // namespace evac::golden
