#pragma once

#include <filesystem>
#include <functional>
#include <optional>
#include <string>

#include "apps/golden/golden_file.h"
#include "worldmodel/nn/evac_model.h"

/// One check per kind of golden file. A file's kind is told by what it holds, not by its name.
namespace evac::golden {

/// What a check may look at beside its own file: the folder, and a network made of hashed weights.
class Workshop {
 public:
  explicit Workshop(std::filesystem::path folder) : folder_(std::move(folder)) {}

  const std::filesystem::path& folder() const { return folder_; }
  /// The network of these sizes; the last one is kept.
  const nn::EvacModel& ModelFor(const nn::ModelConfig& config);
  /// The first frame of the first recording, [3, H, W] in [0, 1]: the input of image_resize stands in other files of
  /// the folder.
  /// @throws TensorError if none of them has it.
  Tensor FirstFrame() const;

 private:
  std::filesystem::path folder_;
  std::optional<nn::EvacModel> model_;
};

using Check = std::function<void(const GoldenFile&, Workshop&, Comparison&)>;

/// The check for a file, or nothing if it is of no known kind.
std::optional<Check> CheckFor(const GoldenFile& file);

void CheckSchedule(const GoldenFile& file, Workshop& workshop, Comparison& comparison);
void CheckActions(const GoldenFile& file, Workshop& workshop, Comparison& comparison);
void CheckActionMaps(const GoldenFile& file, Workshop& workshop, Comparison& comparison);
void CheckRayMaps(const GoldenFile& file, Workshop& workshop, Comparison& comparison);
void CheckWeights(const GoldenFile& file, Workshop& workshop, Comparison& comparison);
void CheckImageResize(const GoldenFile& file, Workshop& workshop, Comparison& comparison);
void CheckVae(const GoldenFile& file, Workshop& workshop, Comparison& comparison);
void CheckClipResampler(const GoldenFile& file, Workshop& workshop, Comparison& comparison);
void CheckUNet(const GoldenFile& file, Workshop& workshop, Comparison& comparison);
void CheckDdim(const GoldenFile& file, Workshop& workshop, Comparison& comparison);
void CheckInference(const GoldenFile& file, Workshop& workshop, Comparison& comparison);
void CheckTraining(const GoldenFile& file, Workshop& workshop, Comparison& comparison);

}  // namespace evac::golden
