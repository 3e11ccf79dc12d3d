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
  double variant_share = 0.5;  ///< of the clips that are variants (`evac vary`), where the shards have some
  double failure_weight = 1;   ///< how many times as often those that failed are drawn as those that succeeded: it believes
                               ///< in success less by the logarithm of that
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

/// Which end came: the likeliest by what is said of each and by where the thing was. A denoiser that is shown this one
/// learns to draw what it is told; which one comes is the forecast's to say.
/// @param place    [BV, T, 2] as in ForecastBatch; scenes of which no place is a number get their likeliest end
/// @returns        [B, T], whole numbers below kEnds
Tensor EndThatCame(const nn::ObjectForecast::Answer& answer, const Tensor& place, const nn::ModelConfig& config);

class ForecastTraining {
 public:
  /// @throws TensorError for options that make no training, or if no clip says where its object is
  ForecastTraining(const ShardSet& shards, const nn::ModelConfig& config, const ForecastTrainingOptions& options);

  Tensor Loss(const nn::ObjectForecast& forecast, const StepPlace& place) const;
  /// Of all clips from their first picture on, nothing left out and nothing added.
  ForecastQuality Measure(const nn::ObjectForecast& forecast) const;

 private:
  /// A recording, or what was done in its scene instead.
  struct Track {
    std::size_t shard;
    std::int64_t picture;       ///< row of the shard: the first picture
    Tensor actions, object_px;  ///< [T, 16], [T, V, 2], from the first picture on
    std::int8_t outcome;
    std::int64_t frames() const { return actions.size(0); }
  };
  struct View {
    Track track;
    std::vector<std::int64_t> frames;  ///< of it, those asked about
  };
  Track TrackOf(const Clip& clip, std::int64_t start) const;
  Track TrackOf(const Variant& variant) const;
  View PickView(Dice& dice) const;
  ForecastBatch BatchOf(const std::vector<View>& views) const;
  Tensor LossOf(const nn::ObjectForecast::Answer& answer, const ForecastBatch& batch) const;

  const ShardSet& shards_;
  nn::ModelConfig config_;
  ForecastTrainingOptions options_;
};

}  // namespace evac::train
