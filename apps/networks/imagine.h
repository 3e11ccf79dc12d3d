#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>

#include "apps/networks/imagine_start.h"
#include "core/error.h"
#include "worldmodel/action_statistics.h"
#include "worldmodel/conditioning.h"
#include "worldmodel/nn/model_config.h"
#include "worldmodel/trained_for.h"

namespace evac {

/// How the network is asked.
struct SamplerArguments {
  std::string solver = "ddim";  ///< or "dpm": DPM-Solver++(2M)
  std::int64_t steps = 0;       ///< 0: 27 with ddim, 10 with dpm
  double eta = 1;               ///< of ddim
  double cfg = 1;               ///< guidance; 1: none, and half the time
  double cfg_rescale = 0.7;     ///< of the guidance
  std::uint64_t seed = 0;
  std::string dtype = "f32";  ///< of the weights: f32, bf16, f16
  std::string device = "cpu";
  int threads = 0;  ///< 0: one per core
};

/// What both modes of `evac imagine` are told; the maps alone need no weights, and no sampler.
struct ImagineArguments {
  ImagineInputs inputs;
  std::string weights;  ///< a checkpoint
  SamplerArguments sampler;
  std::string statistics;  ///< a robot's page of motion statistics; empty: the weights' own
  bool png = false;        ///< also OUT/frames/frame_%05d.png
  bool restart = false;    ///< throw away what OUT holds of another job
  std::string config;      ///< a page of sizes; empty: the published ones
  std::filesystem::path out;
  std::size_t chunks = 0;    ///< at most so many; 0: until the actions end
  bool scaled_maps = false;  ///< radius and thickness in parts of the picture's height
  std::string quirks;        ///< names with commas between them, or "all" (docs/evac_quirks.md)
};

/// The sizes that a command asks for.
nn::ModelConfig ModelSizes(const ImagineArguments& arguments);

/// Which of the reference's quirks are on.
struct ReferenceQuirks {
  bool residual_noise = false, memory_not_scaled = false, delta_window = false, draw_behind_camera = false,
       decoded_start = false;
  /// @throws InvalidInput for a name that is none, listing those that are.
  static ReferenceQuirks Named(const std::string& names);
};

/// The motion statistics that a command asks for, or those of its weights (TrainedFor::StatisticsOr).
ActionStatistics StatisticsOf(const ImagineArguments& arguments);

/// How the maps of pictures of this size are drawn.
PoseMapOptions MapOptions(const ImagineArguments& arguments, const nn::ModelConfig& config);

/// ReadImagineStart, where what nobody asked for otherwise is as the network was trained; `inputs` says so then.
/// @throws InvalidInput also for what the network was not trained for, and for sizes of another number of views.
ImagineStart StartAsTrained(ImagineInputs& inputs, const nn::ModelConfig& config, const PoseMapOptions& drawn,
                            const TrainedFor& trained);

/// How many frames there are to imagine.
std::size_t FrameCount(const ImagineStart& start, const nn::ModelConfig& config, std::size_t chunks);

/// The maps of the frames to imagine, views side by side: map k shows `start.arms[k + 1]`.
class MapPainter {
 public:
  MapPainter(const ImagineStart& start, const nn::ModelConfig& config, const PoseMapOptions& options);
  cv::Mat Paint(std::size_t frame) const;

 private:
  const ImagineStart& start_;
  std::vector<Camera> cameras_;  ///< of the network's size
  PoseMapOptions options_;
};

/// Says in OUT that something was imagined there, and what.
inline constexpr const char* kImagined = "imagined.json";

/// OUT/maps/frame_%05d.png: needs no weights; of weights that are named it reads what they were trained for.
/// @throws InvalidInput also where OUT holds what was imagined, another process writes it, or its maps are somebody's
ExitCode ImagineMaps(ImagineArguments arguments);

/// OUT/imagined.mp4 and imagined.json, maps, and frames if asked. Killed at any moment and called again, it goes on
/// after the last whole chunk and writes the same bytes.
ExitCode ImagineFrames(ImagineArguments arguments);

/// Writes those maps. @returns how many. @throws InvalidInput if somebody's files are in their place.
std::size_t WriteMaps(const MapPainter& painter, std::size_t frames, const std::filesystem::path& out);

}  // namespace evac
