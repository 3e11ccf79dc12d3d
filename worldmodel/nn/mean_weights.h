#pragma once

#include <filesystem>
#include <memory>
#include <vector>

#include "worldmodel/nn/weights.h"

namespace evac::nn {

/// The mean of several trainings of one network, parameter by parameter. Trainings that began from common weights and
/// went on with other data err about other things, and their mean about fewer ("model soups", Wortsman et al. 2022,
/// arXiv 2203.05482). Codec and forecast, which all have in common, are as the first file of floats has them, or the
/// first of all where each is of halves. What nothing reads is left out.
class MeanWeights final : public ParameterSource {
 public:
  /// @param paths  at least two, of one size
  /// @throws TensorError as FileWeights; files whose metadata name different codecs, whose latents mean different things,
  ///   or that were trained for different things or with different sizes (CompareSizes); naming the first key of codec or
  ///   forecast that differs by more than how its types round
  MeanWeights(const std::vector<std::filesystem::path>& paths, const ModelConfig& config);

  Tensor Take(const std::string& key, at::IntArrayRef shape) override;

  /// What the files say in common; `recipe`, `seed` and `steps` of each, in order, with " | " between them where they
  /// differ. Not what was measured of one of them.
  TensorMetadata Metadata() const;

 private:
  std::vector<std::unique_ptr<FileWeights>> files_;
};

}  // namespace evac::nn
