#pragma once

#include <functional>

#include "worldmodel/nn/model_config.h"
#include "worldmodel/nn/parameters.h"
#include "worldmodel/nn/tensor.h"

/// Where the thing that is acted on will be, told from the first picture and what the arms are told alone
/// (`object_forecast`). Not in the paper, whose denoiser finds out while it learns to draw, and most of what it learns
/// from is not about that. This network draws nothing: it is small, learns from many recordings in minutes, and tells
/// several ends apart. The denoiser is shown one of them as a map beside the pose maps: the one that came while it learns,
/// so that it draws what it is told; the likeliest later.
namespace evac::nn {

class ObjectForecast {
 public:
  /// @param config  views, sizes of picture and latent, schedule.carry_plane_m
  ObjectForecast(const Scope& at, const ModelConfig& config);

  struct Scenes {
    Tensor image;      ///< [BV, 3, H, W] in [-1, 1]: what the cameras of frame 0 saw
    Tensor direction;  ///< [BV, 3, T, h, w] unit rays of pinhole cameras, base frame
    Tensor origin;     ///< [BV, 3, T, h, w] metres, base frame
    Tensor arms;       ///< [B, T, 16]: rows as in frame_actions.h
    Tensor turns;      ///< [B, T, kTurnRow]: HandTurns since frame 0
  };
  /// Where it is in the first picture.
  struct Found {
    Tensor scores;  ///< [BV, cells]: logits of kCell_px squares, row by row
    Tensor place;   ///< [BV, 2]: x, y among the latent's places (the first one's middle is 0)
    Tensor seen;    ///< [BV]: logit of its being seen at all
  };
  struct Answer {
    Found found;
    Tensor ends;     ///< [B, T, kEnds]: logits of each way that it may have ended by then: held, say, or left where it lay
    Tensor places;   ///< [BV, T, kEnds, h w + 1]: logits of the latent's places in each, row by row; the last: not to be
                     ///< seen
    Tensor success;  ///< [B, T, kEnds]: logit of the task's being done then, in each; what training learns from beside,
                     ///< and measures
    Tensor Done() const;  ///< [B, T] in [0, 1]: how likely it is done then, whichever end
  };
  static constexpr std::int64_t kCell_px = 4, kEnds = 3;

  /// What leaves out numbers at random while it is trained.
  using Drop = std::function<Tensor(const Tensor&)>;
  /// Of a hand that let go, what came later than 24 frames after it (2.4 s at 10 Hz) is not looked at: where it is then, and how long ago. The
  /// thing lies where it lies, and an episode may go on for longer than any that was learned from.
  Answer operator()(const Scenes& scenes, const Drop& drop = {}) const;

  /// How likely it is at each place, in the likeliest end alone: the views tell of the same one. A denoiser that is shown
  /// two ends at once, each half as likely, draws neither, or one in each view. The likeliest is the one whose places are
  /// the likeliest, whichever ends have them: two ends of .3 that lay it on the plate count more than one of .4 that leaves it.
  /// @returns [BV, 1, T, h, w] in [0, 1], their sum at most 1
  Tensor Maps(const Scenes& scenes) const;
  /// The same of an end that is given for each frame.
  /// @param end  [B, T], whole numbers below kEnds
  Tensor MapsOf(const Answer& answer, const Tensor& end) const;

 private:
  /// Computed in floats, whatever the rest is: a millimetre is the 500th part of what these numbers reach.
  struct Layer {
    Layer(const Scope& at, std::vector<std::int64_t> shape);
    Tensor weight, bias;
  };
  Found Find(const Tensor& image) const;
  Tensor AboutThing(const Found& found, const Scenes& scenes) const;

  std::int64_t views_, height_, width_;  ///< of the latent
  std::int64_t stride_;
  double plane_m_, tool_length_m_;
  std::vector<Layer> finder_;
  Layer eye_, hand_, both_, ends_, places_, success_;
};

/// [B, T]: for each frame the likeliest end (ObjectForecast::Maps).
Tensor LikeliestEnd(const ObjectForecast::Answer& answer, std::int64_t views);

/// The point that is nearest to what several cameras say, each as much as it is sure, and a little to the plane.
/// @param places     [BV, 2] among the latent's places of frame 0
/// @param sure       [BV] in [0, 1]
/// @returns          [B, 3] metres, base frame, double
Tensor PointSeenAt(const Tensor& places, const Tensor& sure, const Tensor& direction, const Tensor& origin,
                   std::int64_t views, double plane_m);

}  // namespace evac::nn
