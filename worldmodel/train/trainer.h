#pragma once

#include <filesystem>
#include <functional>
#include <limits>
#include <optional>
#include <string>
#include <vector>

#include "core/tensor_file.h"
#include "worldmodel/train/adamw.h"
#include "worldmodel/train/dice.h"
#include "worldmodel/train/flat_parameters.h"
#include "worldmodel/train/muon.h"

/// Gradient descent on anything: parameters by name, and a function that says the loss at a step. It knows no network
/// and no data; codec, world model, policies and judges are trained by it alike.
namespace evac::train {

/// The defaults are the paper's (docs/train.md, the column `paper`).
struct TrainerOptions {
  std::int64_t steps = 100'000;
  /// Above 0: as many steps as fit into so many minutes, at least one. Counted once, after the first steps or before
  /// one that would end behind the minutes, and written into the checkpoint: a training that is killed and goes on does
  /// the same steps. Other minutes are refused from then on.
  double minutes = 0;
  double learning_rate = 5e-5;
  std::int64_t warmup_steps = 0;  ///< the rate rises from 0
  double decay_from = 1;          ///< after this part of the steps the rate falls to 0 in a straight line; 1: never
  std::string optimiser = "adamw";  ///< or "muon": matrices by it, all else by AdamW (muon.h)
  double momentum = 0.95;           ///< Muon's
  AdamWOptions adamw;
  double clip_norm = 0.5;          ///< longer gradients are shortened to it; 0: never
  double average_decay = 0;        ///< of the moving average of the weights (EMA); 0: there is none
  std::int64_t accumulate = 1;     ///< parts of a step whose gradients are averaged
  std::int64_t holdout_every = 0;  ///< steps; 0: no hold-out
  /// Ends after so many hold-outs without a better one; 0: never. Above 0 wants `holdout_every`.
  std::int64_t patience = 0;
  double checkpoint_every_s = 60;  ///< 0: after every step
  std::uint64_t seed = 0;
  std::string identity;  ///< what else decides the numbers: data, network, loss. A checkpoint of another is refused
};

/// What Trainer asks of its options. @throws TensorError for those that make no training
void CheckOptions(const TrainerOptions& options);

/// The learning rate of a step: warm-up, constant, decay.
double LearningRateAt(const TrainerOptions& options, std::int64_t step, std::int64_t steps);

struct TrainerProgress {
  std::int64_t step = 0, steps = 0;  ///< done, in all; 0 while minutes are not yet turned into steps
  double loss = 0;                   ///< of the last steps where it was finite, smoothed
  double steps_per_s = 0;
  std::optional<double> holdout, best;
  std::int64_t left_out = 0;  ///< steps that moved nothing, since the training began: Trainer::Step
  /// "1200/6000 steps, loss .0312, hold-out .0298 (best .0291), 2.4 steps/s, 33 min left", and before the speed
  /// "7 left out: not finite" where there are such
  std::string Line() const;
};

struct TrainerCallbacks {
  /// The loss at a place: a number that can be differentiated. Whatever is random in it comes from Dice(place, …).
  std::function<Tensor(const StepPlace&)> loss;
  /// How well the weights do on what they do not see, smaller is better; called with the averaged ones in place.
  std::function<double()> holdout = {};
  /// Called after each hold-out, with the averaged weights in place: for pictures.
  std::function<void(std::int64_t step)> look = {};
  /// After each of these steps `keep` is called, with the averaged weights in place: checkpoints of one training. Killed
  /// before its own checkpoint, a training calls it again, with the same weights.
  std::vector<std::int64_t> keep_steps = {};
  std::function<void(std::int64_t step)> keep = {};
  std::function<bool()> interrupted = {};  ///< asked after every step; the checkpoint is written then
  std::function<void(const TrainerProgress&)> on_progress = {};
  std::function<double()> clock_s = {};  ///< seconds that never go back; empty: the machine's
};

/// A second copy of what is trained, for a thread of its own: parts of a step are computed side by side.
struct Replica {
  std::vector<NamedTensor> parameters;  ///< of the same names and shapes
  std::function<Tensor(const StepPlace&)> loss;
};

struct TrainerSummary {
  std::int64_t step = 0, steps = 0;  ///< done, and planned: 0 while minutes are not turned into steps
  std::string why;  ///< "done", "interrupted", "no better for 5 hold-outs"
  std::optional<double> best;  ///< a finite number: none before the first hold-out that is one
  std::int64_t best_step = 0;
  std::int64_t steps_now = 0;            ///< those that this process did
  std::int64_t left_out = 0;             ///< of all steps, those whose loss or gradient was not finite
  std::int64_t holdouts_since_best = 0;  ///< without a best: all that were measured
  bool IsDone() const { return why != "interrupted"; }
  /// What the card of its weights says: `steps` of the training and, where a hold-out was a number, `best_step`, after
  /// which the weights are those (Trainer::WithBest).
  TensorMetadata CardOfSteps() const;
};

/// Writes into its folder:
///   training.safetensors   weights, optimiser, average, best, step: whole or not at all. Killed at any moment and run
///                          again, a training goes on from there; on the CPU it ends in the same bytes.
///   metrics.csv            step,loss,learning_rate,gradient_norm,seconds
///   holdout.csv            step,holdout
///   curves.svg             both as a picture (curves.h), after each hold-out and at the end
///   training.unsaved       empty, until the first checkpoint: rows beside it are those of a training that was killed
class Trainer {
 public:
  /// @param parameters  floats; they stay where their holders see them (FlatParameters)
  /// @throws TensorError for options that make no training, or if the folder holds another training's checkpoint, one
  /// that is damaged (a step that is no number, tensors of other sizes), or none and a metrics.csv or holdout.csv of
  /// somebody's, or of a training whose checkpoint is gone
  Trainer(std::vector<NamedTensor> parameters, const TrainerOptions& options, std::filesystem::path folder);

  /// From now on the parts of a step (`accumulate`) are shared out among the trainer's own loss and its replicas', each
  /// in a thread that uses one core. The number of replicas decides in which order gradients are added up.
  void AddReplica(Replica replica);

  /// Trains from the checkpoint's step, or from 0, to the end.
  /// A step whose loss or gradient is not finite moves nothing and is counted.
  /// @throws TensorError after 100 such steps in a row, or if a step to be kept is behind the last
  TrainerSummary Run(const TrainerCallbacks& callbacks);

  std::int64_t step() const { return step_; }
  /// Calls `function` with the best weights in place, those of the best hold-out; without one the averaged, or the last.
  void WithBest(const std::function<void()>& function) { With(best_score_ ? best_ : Averaged(), function); }

 private:
  struct StepOutcome {
    double loss = 0, gradient_norm = 0, learning_rate = 0;
  };

  bool Load();  ///< @returns false if there is no checkpoint
  void Save() const;
  void BeginTables() const;
  std::filesystem::path Unsaved() const { return folder_ / "training.unsaved"; }
  std::string Identity() const;
  double LossOfParts(std::size_t worker, const TrainerCallbacks& callbacks, double done) const;
  double LossOfStep(const TrainerCallbacks& callbacks);
  StepOutcome Step(const TrainerCallbacks& callbacks);
  void HoldOut(const TrainerCallbacks& callbacks);
  std::string WhyEnd(const TrainerCallbacks& callbacks) const;
  void PlanSteps(double now_s);
  std::int64_t StepsInAll() const;
  void CheckKept(const TrainerCallbacks& callbacks) const;
  void Report(const TrainerCallbacks& callbacks) const;
  void Record(const StepOutcome& outcome, double seconds);
  const Tensor& Averaged() const { return state_.average.defined() ? state_.average : state_.values; }
  void With(const Tensor& weights, const std::function<void()>& function);

  struct Worker {
    FlatParameters parameters;
    std::function<Tensor(const StepPlace&)> loss;
  };

  FlatParameters parameters_;
  std::vector<MatrixPlace> matrices_;  ///< of the parameters, Muon's; none if it is not asked for
  std::vector<Worker> replicas_;
  TrainerOptions options_;
  std::filesystem::path folder_;
  AdamWState state_;
  Tensor best_;  ///< [count], what the best hold-out that is a finite number was measured with
  std::optional<double> best_score_, last_score_;
  std::int64_t best_step_ = 0, step_ = 0, steps_ = 0, holdouts_since_best_ = 0;
  std::int64_t not_finite_ = 0, left_out_ = 0;  ///< steps whose loss is none: in a row, in all
  bool planned_ = false;  ///< the number of steps stands
  double smooth_loss_ = std::numeric_limits<double>::quiet_NaN();  ///< until there was one
  std::int64_t run_steps_ = 0, timed_from_ = 0;  ///< by this process; those after which time is taken
  double began_s_ = 0, timed_from_s_ = 0, saved_s_ = 0;  ///< by the clock: the run, `timed_from_`, the checkpoint
};

}  // namespace evac::train
