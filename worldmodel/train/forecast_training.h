#pragma once

#include "worldmodel/nn/object_forecast.h"
#include "worldmodel/train/dice.h"
#include "worldmodel/train/shards.h"

/// Training of the small network that says where the thing will be (nn/object_forecast.h): on shards that know where
/// their objects are, no codec wanted. Not in the paper.
namespace evac::train {

struct ForecastTrainingOptions {
  std::int64_t batch = 32;     ///< clips
  std::int64_t frames = 5;     ///< of each: the last, and others at random
  double late_start = 0.3;     ///< of the clips that are looked at from a later picture on, as denoisers' windows are
  double drop = 0.3;           ///< p of the numbers between the layers that are left out
  double picture_gain = 0.1;   ///< deviation of a factor on a clip's colours
  double picture_noise = 0.05; ///< deviation of what is added to each colour; pictures reach from -1 to 1
  double success_weight = 1;   ///< of whether the task is done at the end, beside where the thing is
  double finder_weight = 1;    ///< of finding it in the first picture
};

/// Some frames of some clips.
struct ForecastBatch {
  nn::ObjectForecast::Scenes scenes;
  Tensor place;      ///< [BV, T, 2]: latent's places, the first one's middle is 0; not a number: not to be seen
  Tensor first;      ///< [BV, 2]: the same in the picture that is given
  Tensor success;    ///< [B, T]: 1, 0, or -1 where nothing is known
};

/// What it says of clips, frame by frame.
struct ForecastQuality {
  double loss = 0;
  double agreement = 0;    ///< of the last frames whose outcome is known: said rightly whether the task is done
  std::int64_t told = 0;   ///< so many
  double finder_px = 0;    ///< half of the things in the first pictures are found within so many pixels of the first view
};

class ForecastTraining {
 public:
  /// @throws TensorError for options that make no training, or if no clip says where its object is
  ForecastTraining(const ShardSet& shards, const nn::ModelConfig& config, const ForecastTrainingOptions& options);

  Tensor Loss(const nn::ObjectForecast& forecast, const StepPlace& place) const;
  /// Of all clips from their first picture on, nothing left out and nothing added.
  ForecastQuality Measure(const nn::ObjectForecast& forecast) const;

 private:
  struct View {
    const Clip* clip;
    std::int64_t start;                ///< the picture's frame
    std::vector<std::int64_t> frames;  ///< those asked about
  };
  ForecastBatch BatchOf(const std::vector<View>& views) const;
  Tensor LossOf(const nn::ObjectForecast::Answer& answer, const ForecastBatch& batch) const;

  const ShardSet& shards_;
  nn::ModelConfig config_;
  ForecastTrainingOptions options_;
};

}  // namespace evac::train
