#include <fmt/format.h>

#include <algorithm>
#include <sstream>

#include "apps/networks/imagine.h"
#include "apps/networks/imagine_output.h"
#include "core/file.h"
#include "core/geometry.h"
#include "core/names.h"
#include "core/store_lock.h"
#include "worldmodel/conditioning.h"
#include "worldmodel/evac_config.h"
#include "worldmodel/shard_writer.h"
#include "worldmodel/trained_for.h"

namespace evac {

nn::ModelConfig ModelSizes(const ImagineArguments& arguments) {
  return arguments.config.empty() ? nn::ModelConfig() : ReadEvacConfig(arguments.config);
}

ActionStatistics StatisticsOf(const ImagineArguments& arguments) {
  const std::optional<std::filesystem::path> page =
      arguments.statistics.empty() ? std::nullopt : std::optional<std::filesystem::path>(arguments.statistics);
  return TrainedFor::Read(arguments.weights).StatisticsOr(page);
}

ReferenceQuirks ReferenceQuirks::Named(const std::string& names) {
  ReferenceQuirks quirks;
  const std::pair<const char*, bool*> known[] = {{"residual_noise", &quirks.residual_noise},
                                                 {"memory_not_scaled", &quirks.memory_not_scaled},
                                                 {"delta_window", &quirks.delta_window},
                                                 {"draw_behind_camera", &quirks.draw_behind_camera},
                                                 {"decoded_start", &quirks.decoded_start}};
  std::istringstream list(names);
  for (std::string name; std::getline(list, name, ',');) {
    bool found = false;
    for (const auto& [known_name, value] : known) {
      if (name != known_name && name != "all") continue;
      *value = found = true;
    }
    if (!found) {
      throw InvalidInput(
          "--reference-quirks: found '{}', wanted all, or some of residual_noise, memory_not_scaled, "
          "delta_window, draw_behind_camera, decoded_start with commas between them",
          name);
    }
  }
  return quirks;
}

PoseMapOptions MapOptions(const ImagineArguments& arguments, const nn::ModelConfig& config) {
  nn::ModelConfig drawn = config;
  drawn.pose_map.scaled |= arguments.scaled_maps;
  PoseMapOptions options = PoseMapOptions::Of(drawn);
  options.draw_behind_camera = ReferenceQuirks::Named(arguments.quirks).draw_behind_camera;
  return options;
}

std::size_t FrameCount(const ImagineStart& start, const nn::ModelConfig& config, std::size_t chunks) {
  const std::size_t targets = start.arms.size() - 1;
  return chunks == 0 ? targets : std::min(targets, chunks * static_cast<std::size_t>(config.chunk));
}

MapPainter::MapPainter(const ImagineStart& start, const nn::ModelConfig& config, const PoseMapOptions& options)
    : start_(start), options_(options) {
  for (const Camera& camera : start.scene.cameras) {
    cameras_.push_back(
        Resized(camera, static_cast<int>(config.image_width_px), static_cast<int>(config.image_height_px)));
  }
}

cv::Mat MapPainter::Paint(std::size_t frame) const {
  const Arms seen = SeenArms(start_.arms.at(frame), start_.arms.at(frame + 1), options_.lag_frames);
  return SideBySide(DrawPoseMaps(seen, cameras_, options_));
}

std::size_t WriteMaps(const MapPainter& painter, std::size_t frames, const std::filesystem::path& out) {
  MakeFolders(out);
  PictureFolder maps(out / "maps");
  for (std::size_t frame = 0; frame < frames; ++frame) maps.Append(painter.Paint(frame));
  maps.Finish();
  return frames;
}

namespace {

/// Whichever cameras are asked for, weights of more or fewer views need the page of their own.
void RequireViews(const TrainedFor& trained, std::int64_t views) {
  if (trained.cameras.empty() || std::ssize(trained.cameras) == views) return;
  throw InvalidInput(
      "{}: its network sees {} ({} views), the sizes are of {} (without --config the published ones): wanted --config "
      "PAGE with its own sizes",
      trained.weights, Joined(trained.cameras), trained.cameras.size(), views);
}

}  // namespace

ImagineStart StartAsTrained(ImagineInputs& inputs, const nn::ModelConfig& config, const PoseMapOptions& drawn,
                            const TrainedFor& trained) {
  RequireViews(trained, config.views);
  if (inputs.cameras.empty()) inputs.cameras = trained.cameras;
  inputs.period_s = trained.period_s.value_or(inputs.period_s);
  inputs.read_told = trained.arms_read == "told";
  ImagineStart start = ReadImagineStart(inputs, static_cast<std::size_t>(config.views));
  trained.CheckCameras(NamesOf(start.scene.cameras), start.source);
  trained.CheckArms(start.arm_names, start.source);
  trained.CheckPeriod(start.period_s, start.source);
  trained.CheckPoseMap(PoseMapWords(drawn), "--config and --scaled-maps");
  return start;
}

ExitCode ImagineMaps(ImagineArguments arguments) {
  const nn::ModelConfig config = ModelSizes(arguments);
  const PoseMapOptions options = MapOptions(arguments, config);
  const TrainedFor trained = arguments.weights.empty() ? TrainedFor() : TrainedFor::Read(arguments.weights);
  const ImagineStart start = StartAsTrained(arguments.inputs, config, options, trained);
  const MapPainter painter(start, config, options);
  RequireOwnPictures(arguments.out / "maps");
  MakeFolders(arguments.out);
  const std::filesystem::path lock_file = arguments.out / "lock";
  const bool was_there = std::filesystem::exists(lock_file);
  const RunLock lock(lock_file);
  if (std::filesystem::exists(arguments.out / kImagined))
    throw InvalidInput("{}: holds what was imagined, with its maps; wanted another --out for --maps-only",
                       arguments.out.string());
  const std::size_t frames = WriteMaps(painter, FrameCount(start, config, arguments.chunks), arguments.out);
  if (!was_there) std::filesystem::remove(lock_file);  // maps alone leave nothing else
  fmt::print("{}: {} maps of {}x{}, {:.4g} s apart\n", (arguments.out / "maps").string(), frames,
             config.views * config.image_width_px, config.image_height_px, start.period_s);
  return ExitCode::kOk;
}

}  // namespace evac
