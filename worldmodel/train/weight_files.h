#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "worldmodel/nn/evac_model.h"
#include "worldmodel/nn/mapped_tensors.h"
#include "worldmodel/train/flat_parameters.h"

/// Where a training's first weights come from.
namespace evac::train {

/// Parameters of one file by key: a key that is missing or of another shape is an error. Keys that nobody asks for are
/// no concern of it: CheckStart looks for them (train_world.h).
class CheckpointWeights final : public nn::ParameterSource {
 public:
  explicit CheckpointWeights(const std::filesystem::path& path);
  Tensor Take(const std::string& key, at::IntArrayRef shape) override;
  const TensorFile& file() const { return tensors_.file(); }

 private:
  nn::MappedTensors tensors_;
};

/// The same, of a model that is shown more than the one in the file was: what the first layer's weights lack for the
/// channels that are new is 0, so that the new model begins as the old one was, where its answers are counted from the
/// same (CheckStart asks the card). New channels come last, but before that of the object's forecast, where the file's
/// model has one (nn::DenoiserInput).
class WidenedWeights final : public nn::ParameterSource {
 public:
  /// @param object_forecast  whether the new model is shown one
  /// @throws TensorError if it is not, and the file's model is: nothing is left out
  WidenedWeights(const std::filesystem::path& path, bool object_forecast);
  Tensor Take(const std::string& key, at::IntArrayRef shape) override;

 private:
  nn::MappedTensors tensors_;
  std::int64_t last_ = 0;  ///< of the file's channels, so many stay behind the new ones
};

/// Several sources, each for the keys that begin with its prefix; the first that fits is asked.
class RoutedWeights final : public nn::ParameterSource {
 public:
  struct Route {
    std::string prefix;  ///< "": every key
    nn::ParameterSource* source;
  };
  explicit RoutedWeights(std::vector<Route> routes) : routes_(std::move(routes)) {}
  Tensor Take(const std::string& key, at::IntArrayRef shape) override;

 private:
  std::vector<Route> routes_;
};

/// The denoiser's weights that grow with what it is shown.
inline constexpr const char* kFirstLayer = "model.diffusion_model.input_blocks.0.0.weight";

/// The codec of a file that holds it alone or with a whole model.
inline constexpr const char* kCodecPrefix = "first_stage_model";

}  // namespace evac::train
