#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <thread>

#include "apps/networks/imagine.h"
#include "apps/networks/imagine_chunks.h"
#include "apps/networks/imagine_job.h"
#include "apps/networks/imagine_output.h"
#include "apps/networks/imagine_progress.h"
#include "core/file.h"
#include "core/store_lock.h"
#include "worldmodel/action_delta.h"
#include "worldmodel/frame_memory.h"
#include "worldmodel/imaginer.h"
#include "worldmodel/nn/library.h"
#include "worldmodel/nn/memory.h"
#include "worldmodel/nn/threads.h"
#include "worldmodel/nn/weights.h"
#include "worldmodel/trained_for.h"

namespace evac {
namespace {

namespace fs = std::filesystem;
using Clock = std::chrono::steady_clock;

constexpr std::int64_t kDdimSteps = 27, kDpmSteps = 10;

at::ScalarType TypeNamed(const std::string& name) {
  if (name == "f32") return at::kFloat;
  return name == "bf16" ? at::kBFloat16 : at::kHalf;
}

void FillIn(SamplerArguments& sampler, const nn::ModelConfig& config) {
  const bool ddim = sampler.solver == "ddim";
  if (sampler.steps == 0) sampler.steps = ddim ? kDdimSteps : kDpmSteps;
  const std::int64_t fewest = ddim ? 1 : 2, most = config.schedule.steps;
  if (sampler.steps < fewest || sampler.steps > most)
    throw InvalidInput("--steps {}: wanted {} … {} with {}", sampler.steps, fewest, most, sampler.solver);
  if (sampler.threads == 0) sampler.threads = static_cast<int>(std::max(1U, std::thread::hardware_concurrency()));
  if (sampler.device == "cuda" && !nn::HasCuda())
    throw InvalidInput("--device cuda: the libtorch that evac was built with has no CUDA; wanted cpu");
  if (sampler.device == "cpu" && sampler.dtype == "f16")
    throw InvalidInput(
        "--dtype f16: libtorch does not compute in it on a processor; wanted bf16 or f32, or --device cuda");
}

nn::EvacModel Load(const ImagineArguments& arguments, const nn::ModelConfig& config) {
  nn::LoadReport report;
  const nn::LoadOptions options{.dtype = TypeNamed(arguments.sampler.dtype),
                                .device = arguments.sampler.device == "cuda" ? at::kCUDA : at::kCPU};
  nn::EvacModel model = nn::LoadModel(arguments.weights, config, options, &report);
  if (!report.schedule.empty()) fmt::print(stderr, "{}: {}\n", arguments.weights, report.schedule);
  return model;
}

ImaginerOptions OptionsOf(const ImagineArguments& arguments, const nn::ModelConfig& config) {
  const SamplerArguments& sampler = arguments.sampler;
  const ReferenceQuirks quirks = ReferenceQuirks::Named(arguments.quirks);
  ImaginerOptions options;
  options.sampler.solver = sampler.solver == "ddim" ? nn::Solver::kDdim : nn::Solver::kDpmSolver;
  options.sampler.steps = sampler.steps;
  options.sampler.eta = sampler.eta;
  options.sampler.guidance = sampler.cfg;
  options.sampler.guidance_rescale = sampler.cfg_rescale;
  options.sampler.memory_not_scaled = quirks.memory_not_scaled;
  options.sampler.residual_noise = quirks.residual_noise;
  options.decoded_start = quirks.decoded_start;
  options.device = sampler.device;
  options.conditioning.statistics = StatisticsOf(arguments);
  options.conditioning.pose_map = MapOptions(arguments, config);
  return options;
}

/// Chunk by chunk, those that are there already skipped.
class FrameRun {
 public:
  FrameRun(const ImagineArguments& arguments, const ImagineStart& start, const Imaginer& imaginer,
           const ChunkFolder& chunks, ImagineProgress& progress)
      : arguments_(arguments), start_(start), imaginer_(imaginer), chunks_(chunks), progress_(progress) {}

  void Run(std::size_t frames) {
    ImaginedScene scene = imaginer_.Begin(start_.scene, arguments_.sampler.seed);
    for (std::size_t first = 0; first < frames; first += imaginer_.chunk()) {
      const std::span<const Arms> targets(&start_.arms[first + 1], std::min(imaginer_.chunk(), frames - first));
      FinishedChunk chunk = Chunk(scene, first / imaginer_.chunk(), targets);
      imaginer_.Append(scene, targets, std::move(chunk.latents), chunk.pictures);
    }
  }

 private:
  FinishedChunk Chunk(const ImaginedScene& scene, std::size_t index, std::span<const Arms> targets) {
    std::string warning;
    if (auto chunk = chunks_.Load(index, targets.size(), warning)) {
      progress_.SkipChunk();
      return std::move(*chunk);
    }
    if (!warning.empty()) progress_.Say(warning + "; it is imagined again");
    FinishedChunk chunk = Imagined(scene, index, targets);
    chunks_.Save(index, chunk);
    progress_.FinishChunk();
    return chunk;
  }

  FinishedChunk Imagined(const ImaginedScene& scene, std::size_t index, std::span<const Arms> targets) const {
    ChunkConditioning conditioning = imaginer_.Condition(scene, imaginer_.Remember(scene), targets);
    if (ReferenceQuirks::Named(arguments_.quirks).delta_window) conditioning.deltas = LateDeltas(index);
    FinishedChunk chunk{imaginer_.Denoise(scene, conditioning), {}};
    if (const auto wrong = WhatIsWrong(chunk.latents)) {
      throw InternalError("chunk {}: {}: weights that were never trained, or too coarse a --dtype ({})", index, *wrong,
                          arguments_.sampler.dtype);
    }
    chunk.pictures = imaginer_.Decode(chunk.latents);
    return chunk;
  }

  /// Quirk delta_window: those that the reference takes.
  std::vector<DeltaRow> LateDeltas(std::size_t index) const {
    const ConditioningOptions& options = imaginer_.options().conditioning;
    const auto memory = static_cast<std::size_t>(imaginer_.config().memory);
    const ChunkPlan plan = PlanChunk(start_.arms.size() - 1 + memory, index,
                                     {.chunk = imaginer_.chunk(), .memory = memory, .delta_window = true});
    std::vector<DeltaRow> rows;
    for (const std::optional<std::size_t>& delta : plan.deltas) {
      rows.push_back(
          delta ? Normalised(DeltaBetween(GrippersOf(start_.arms[*delta]), GrippersOf(start_.arms[*delta + 1])),
                             options.statistics, options.stride)
                : DeltaRow{});
    }
    return rows;
  }

  const ImagineArguments& arguments_;
  const ImagineStart& start_;
  const Imaginer& imaginer_;
  const ChunkFolder& chunks_;
  ImagineProgress& progress_;
};

/// The video, and the frames if asked, out of the chunks.
FinishedVideo WriteFrames(const ImagineArguments& arguments, const ImagineStart& start, const MapPainter& painter,
                          const ChunkFolder& chunks, std::size_t frames, std::size_t per_chunk) {
  VideoWriter video(arguments.out / "imagined.mp4", {.period_s = start.period_s});
  std::optional<PictureFolder> pictures;
  if (arguments.png) pictures.emplace(arguments.out / "frames");
  for (std::size_t first = 0; first < frames; first += per_chunk) {
    std::string warning;
    const auto chunk = chunks.Load(first / per_chunk, std::min(per_chunk, frames - first), warning);
    if (!chunk) throw InternalError("{}: a chunk is gone that was there: {}", arguments.out.string(), warning);
    for (std::size_t k = 0; k < chunk->pictures.size(); ++k) {
      const cv::Mat picture = SideBySide(chunk->pictures[k]);
      video.Append(PictureAboveMap(picture, painter.Paint(first + k)));
      if (pictures) pictures->Append(picture);
    }
  }
  if (pictures) pictures->Finish();
  return video.Finish();
}

}  // namespace

ExitCode ImagineFrames(ImagineArguments arguments) {
  const auto begin = Clock::now();
  const nn::ModelConfig config = ModelSizes(arguments);
  FillIn(arguments.sampler, config);
  const TrainedFor trained = TrainedFor::Read(arguments.weights);
  ImaginerOptions options = OptionsOf(arguments, config);
  if (trained.period_s) options.conditioning.stride = *trained.period_s * kStatisticsFrames_hz;
  const ImagineStart start = StartAsTrained(arguments.inputs, config, options.conditioning.pose_map, trained);
  nn::KeepFreedMemory();
  const nn::LibraryThreads threads(arguments.sampler.threads);
  auto model = std::make_unique<const nn::EvacModel>(Load(arguments, config));

  const std::size_t frames = FrameCount(start, config, arguments.chunks),
                    per_chunk = static_cast<std::size_t>(config.chunk);
  ImagineProgress progress((frames + per_chunk - 1) / per_chunk, static_cast<std::size_t>(options.sampler.steps),
                           stderr);
  options.sampler.on_step = [&] { progress.Step(); };
  const Imaginer imaginer(std::move(model), std::move(options));

  nlohmann::json job = JobOf(arguments, start);
  MakeFolders(arguments.out);
  const RunLock lock(arguments.out / "lock");
  const Sidecar sidecar(arguments, start, std::move(job));
  if (!trained.statistics && arguments.statistics.empty())
    fmt::print(stderr, "evac: warning: neither --statistics nor {} says the statistics of the arms' motion: taken are "
               "AgiBot World's\n", arguments.weights);
  sidecar.WriteBegun();
  const ChunkFolder chunks(arguments.out / "chunks", sidecar.hash(), config);
  const MapPainter painter(start, config, imaginer.options().conditioning.pose_map);
  WriteMaps(painter, frames, arguments.out);
  FrameRun(arguments, start, imaginer, chunks, progress).Run(frames);
  const FinishedVideo video = WriteFrames(arguments, start, painter, chunks, frames, per_chunk);
  sidecar.WriteFinished(video, std::chrono::duration<double>(Clock::now() - begin).count());
  fmt::print("{}: {} frames of {}x{}, {:.4g} s apart\n", video.path.string(), frames,
             config.views * config.image_width_px, 2 * config.image_height_px, start.period_s);
  return ExitCode::kOk;
}

}  // namespace evac
