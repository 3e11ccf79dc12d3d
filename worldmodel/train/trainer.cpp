#include "worldmodel/train/trainer.h"

#include <ATen/ops/zeros_like.h>

#include <algorithm>
#include <cerrno>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <cstring>
#include <fstream>
#include <future>
#include <utility>

#include "worldmodel/nn/threads.h"
#include "worldmodel/train/csv_log.h"
#include "worldmodel/train/curves.h"
#include "worldmodel/train/option_limits.h"

namespace evac::train {
namespace {

constexpr std::int64_t kPlanFrom = 4;  ///< steps that are not timed: caches and buffers are still cold
constexpr double kPlanSeconds = 10;    ///< timing takes about as long
constexpr std::int64_t kNotFiniteAtMost = 100;
constexpr const char* kMetrics = "step,loss,learning_rate,gradient_norm,seconds";
constexpr const char* kHoldouts = "step,holdout";
constexpr std::int64_t kUnplanned = std::int64_t{1} << 40;  ///< steps, so many that those done are no part of them

void Require(bool holds, const char* name, double found, const char* wanted) {
  if (!holds) throw OptionError("training", name, "is " + std::to_string(found) + ", wanted " + wanted);
}

void CheckMeasuring(const TrainerOptions& o) {
  Require(o.holdout_every >= 0, "holdout_every", static_cast<double>(o.holdout_every), "at least 0");
  Require(o.patience >= 0, "patience", static_cast<double>(o.patience), "at least 0");
  Require(o.patience == 0 || o.holdout_every > 0, "patience", static_cast<double>(o.patience),
          "0 where holdout_every is 0: nothing is measured");
}

}  // namespace

void CheckOptions(const TrainerOptions& o) {
  Require(o.steps > 0, "steps", static_cast<double>(o.steps), "at least 1");
  Require(o.minutes >= 0, "minutes", o.minutes, "at least 0");
  Require(o.learning_rate > 0, "learning_rate", o.learning_rate, "a number above 0");
  Require(o.warmup_steps >= 0, "warmup_steps", static_cast<double>(o.warmup_steps), "at least 0");
  Require(o.decay_from >= 0 && o.decay_from <= 1, "decay_from", o.decay_from, "0 to 1");
  Require(o.average_decay >= 0 && o.average_decay < 1, "average_decay", o.average_decay, "0 to below 1");
  Require(o.accumulate > 0, "accumulate", static_cast<double>(o.accumulate), "at least 1");
  Require(o.adamw.beta1 >= 0 && o.adamw.beta1 < 1, "beta1", o.adamw.beta1, "0 to below 1");
  Require(o.momentum >= 0 && o.momentum < 1, "momentum", o.momentum, "0 to below 1");
  if (o.optimiser != "adamw" && o.optimiser != "muon")
    throw OptionError("training", "optimiser", "is '" + o.optimiser + "', wanted adamw or muon");
  Require(o.adamw.beta2 >= 0 && o.adamw.beta2 < 1, "beta2", o.adamw.beta2, "0 to below 1");
  Require(o.adamw.epsilon > 0, "epsilon", o.adamw.epsilon, "a number above 0");
  Require(o.adamw.weight_decay >= 0, "weight_decay", o.adamw.weight_decay, "at least 0");
  Require(o.clip_norm >= 0, "clip_norm", o.clip_norm, "at least 0");
  Require(o.checkpoint_every_s >= 0, "checkpoint_every_s", o.checkpoint_every_s, "at least 0");
  CheckMeasuring(o);
}

namespace {

template <typename... Args>
std::string Text(const char* format, Args... args) {
  char text[256];
  std::snprintf(text, sizeof text, format, args...);
  return text;
}

std::string Duration(double seconds) {
  if (seconds < 90) return Text("%.0f s", seconds);
  return seconds < 5400 ? Text("%.0f min", seconds / 60) : Text("%.1f h", seconds / 3600);
}

double Now_s(const TrainerCallbacks& callbacks) {
  if (callbacks.clock_s) return callbacks.clock_s();
  return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count();
}

}  // namespace

double LearningRateAt(const TrainerOptions& options, std::int64_t step, std::int64_t steps) {
  const double rise = options.warmup_steps > 0
                          ? std::min(1.0, static_cast<double>(step + 1) / static_cast<double>(options.warmup_steps))
                          : 1;
  const double done = static_cast<double>(step) / static_cast<double>(std::max<std::int64_t>(steps, 1));
  const double fall = done > options.decay_from ? (1 - done) / (1 - options.decay_from) : 1;
  return options.learning_rate * rise * std::max(fall, 0.0);
}

std::string TrainerProgress::Line() const {
  std::string line = Text("%lld", static_cast<long long>(step));
  if (steps > 0) line += Text("/%lld", static_cast<long long>(steps));
  line += Text(" steps, loss %.5f", loss);
  if (holdout) line += Text(", hold-out %.5f", *holdout);
  if (best) line += Text(" (best %.5f)", *best);
  if (left_out > 0) line += Text(", %lld left out: not finite", static_cast<long long>(left_out));
  if (steps_per_s > 0) line += Text(", %.2f steps/s", steps_per_s);
  if (steps_per_s > 0 && steps > 0) line += ", " + Duration(static_cast<double>(steps - step) / steps_per_s) + " left";
  return line;
}

TensorMetadata TrainerSummary::CardOfSteps() const {
  TensorMetadata card = {{"steps", std::to_string(step)}};
  if (best) card["best_step"] = std::to_string(best_step);
  return card;
}

Trainer::Trainer(std::vector<NamedTensor> parameters, const TrainerOptions& options, std::filesystem::path folder)
    : parameters_(std::move(parameters)), options_(options), folder_(std::move(folder)), steps_(options.steps) {
  CheckOptions(options_);
  if (options_.optimiser == "muon") matrices_ = MatricesOf(parameters_.parameters());
  const auto zeros = [&] { return at::zeros_like(parameters_.values()); };
  state_ = {parameters_.values(), parameters_.gradients(), zeros(), zeros(), {}};
  if (options_.average_decay > 0) state_.average = parameters_.values().clone();
  planned_ = options_.minutes <= 0;
  std::filesystem::create_directories(folder_);
  if (!Load()) BeginTables();
  CsvLog::Trim(folder_ / "metrics.csv", kMetrics, step_);
  CsvLog::Trim(folder_ / "holdout.csv", kHoldouts, step_ + 1);
}

/// Where there is no checkpoint. What it finds is its own where a training was killed before the first.
void Trainer::BeginTables() const {
  const bool was_killed = std::filesystem::exists(Unsaved());
  for (const auto& [name, header] : {std::pair("metrics.csv", kMetrics), std::pair("holdout.csv", kHoldouts)}) {
    CsvLog::RequireOwn(folder_ / name, header);
    if (!was_killed) CsvLog::RequireNoRows(folder_ / name, header);
  }
  if (!std::ofstream(Unsaved(), std::ios::app))
    throw TensorWriteError(Unsaved().string() + ": cannot be written: " + std::strerror(errno));
}

void Trainer::AddReplica(Replica replica) {
  replicas_.push_back({FlatParameters(std::move(replica.parameters), parameters_), std::move(replica.loss)});
}

/// Every so-manieth part, one after the other; gradients are added up in the worker's own.
double Trainer::LossOfParts(std::size_t worker, const TrainerCallbacks& callbacks, double done) const {
  const auto& function = worker == 0 ? callbacks.loss : replicas_[worker - 1].loss;
  const auto share = static_cast<double>(options_.accumulate);
  double sum = 0;
  for (auto part = static_cast<std::int64_t>(worker); part < options_.accumulate;
       part += static_cast<std::int64_t>(replicas_.size()) + 1) {
    const Tensor loss = function({options_.seed, step_, part, done});
    (options_.accumulate > 1 ? loss / share : loss).backward();
    sum += loss.item<double>() / share;
  }
  return sum;
}

/// What learning rate and losses are told. Before minutes are turned into steps nobody knows, and the page's `steps`
/// mean nothing: the training is at its very beginning.
std::int64_t Trainer::StepsInAll() const { return planned_ ? steps_ : kUnplanned; }

double Trainer::LossOfStep(const TrainerCallbacks& callbacks) {
  const double done = static_cast<double>(step_) / static_cast<double>(StepsInAll());
  std::vector<std::future<double>> others;
  for (std::size_t worker = 1; worker <= replicas_.size(); ++worker) {
    others.push_back(std::async(std::launch::async, [this, worker, done, &callbacks] {
      nn::UseLibraryThreadsHere(1);
      return LossOfParts(worker, callbacks, done);
    }));
  }
  double loss = LossOfParts(0, callbacks, done);  // if it throws, the futures wait for the others
  const at::NoGradGuard no_gradients;
  for (std::size_t i = 0; i < others.size(); ++i) {
    loss += others[i].get();
    Tensor(state_.gradients).add_(replicas_[i].parameters.gradients());
    Tensor(replicas_[i].parameters.gradients()).zero_();
  }
  return loss;
}

Trainer::StepOutcome Trainer::Step(const TrainerCallbacks& callbacks) {
  StepOutcome outcome;
  outcome.loss = LossOfStep(callbacks);
  outcome.gradient_norm = Norm(state_.gradients);
  outcome.learning_rate = LearningRateAt(options_, step_, StepsInAll());
  if (!std::isfinite(outcome.gradient_norm) || !std::isfinite(outcome.loss)) {
    Tensor(state_.gradients).zero_();
    ++left_out_;
    if (++not_finite_ >= kNotFiniteAtMost)
      throw TensorError("training: loss or gradient is not finite for " + std::to_string(kNotFiniteAtMost) +
                        " steps in a row, at step " + std::to_string(step_) +
                        ": the data hold what is no number, or learning_rate is too large");
    return outcome;
  }
  not_finite_ = 0;
  const bool too_long = options_.clip_norm > 0 && outcome.gradient_norm > options_.clip_norm;
  const auto n = static_cast<double>(step_);
  StepMuon(state_, matrices_, options_.momentum, options_.adamw,
           {step_, outcome.learning_rate, too_long ? options_.clip_norm / outcome.gradient_norm : 1.0,
            std::min(options_.average_decay, (1 + n) / (10 + n))},
           replicas_.size() + 1);
  return outcome;
}

/// By the mean of the steps that are timed. Where the next would end behind the minutes, what is done is all.
void Trainer::PlanSteps(double now_s) {
  const std::int64_t timed = run_steps_ - timed_from_;
  const double timed_s = now_s - timed_from_s_, step_s = timed_s / static_cast<double>(timed);
  const double left_s = options_.minutes * 60 - (now_s - began_s_);
  const bool is_timed = run_steps_ > kPlanFrom && timed >= 4 && timed_s >= std::min(kPlanSeconds, options_.minutes * 6);
  if (step_s > left_s || is_timed) {
    steps_ = step_ + (step_s > left_s ? 0 : static_cast<std::int64_t>(left_s / step_s));
    planned_ = true;
  } else if (run_steps_ == kPlanFrom) {
    timed_from_ = run_steps_;
    timed_from_s_ = now_s;
  }
}

/// A checkpoint that is to be kept after the end would never be written.
void Trainer::CheckKept(const TrainerCallbacks& callbacks) const {
  for (const std::int64_t step : callbacks.keep_steps) {
    if (step >= 1 && (!planned_ || step <= steps_)) continue;
    throw TensorError("training: step " + std::to_string(step) + " is to be kept, wanted " +
                      (planned_ ? "1 to " + std::to_string(steps_) + ", the last" : "at least 1"));
  }
}

void Trainer::With(const Tensor& weights, const std::function<void()>& function) {
  const at::NoGradGuard no_gradients;
  if (weights.is_same(state_.values)) return function();
  const Tensor kept = state_.values.clone();
  Tensor values = state_.values;
  values.copy_(weights);
  try {
    function();
  } catch (...) {
    values.copy_(kept);
    throw;
  }
  values.copy_(kept);
}

void Trainer::HoldOut(const TrainerCallbacks& callbacks) {
  With(Averaged(), [&] {
    last_score_ = callbacks.holdout();
    ++holdouts_since_best_;
    // What is no number says nothing of the weights it was measured with.
    if (std::isfinite(*last_score_) && (!best_score_ || *last_score_ < *best_score_)) {
      best_score_ = last_score_;
      best_step_ = step_;
      best_ = state_.values.clone();
      holdouts_since_best_ = 0;
    }
    if (callbacks.look) callbacks.look(step_);
  });
  CsvLog::Add(folder_ / "holdout.csv", Text("%lld,%.9g", static_cast<long long>(step_), *last_score_));
  WriteCurves(folder_);
}

void Trainer::Record(const StepOutcome& outcome, double seconds) {
  if (!std::isfinite(smooth_loss_))
    smooth_loss_ = outcome.loss;
  else if (std::isfinite(outcome.loss))
    smooth_loss_ += 0.02 * (outcome.loss - smooth_loss_);
  CsvLog::Add(folder_ / "metrics.csv", Text("%lld,%.9g,%.9g,%.9g,%.4f", static_cast<long long>(step_), outcome.loss,
                                            outcome.learning_rate, outcome.gradient_norm, seconds));
}

void Trainer::Report(const TrainerCallbacks& callbacks) const {
  if (!callbacks.on_progress) return;
  const auto timed = static_cast<double>(run_steps_ - timed_from_);
  const double timed_s = Now_s(callbacks) - timed_from_s_;
  callbacks.on_progress({step_, planned_ ? steps_ : 0, smooth_loss_, timed / std::max(timed_s, 1e-6), last_score_,
                         best_score_, left_out_});
}

std::string Trainer::WhyEnd(const TrainerCallbacks& callbacks) const {
  if (planned_ && step_ >= steps_) return "done";
  if (options_.patience > 0 && holdouts_since_best_ >= options_.patience)
    return "no better for " + std::to_string(holdouts_since_best_) + " hold-outs";
  return callbacks.interrupted && callbacks.interrupted() ? "interrupted" : "";
}

TrainerSummary Trainer::Run(const TrainerCallbacks& callbacks) {
  began_s_ = timed_from_s_ = saved_s_ = Now_s(callbacks);
  run_steps_ = timed_from_ = 0;
  CheckKept(callbacks);
  std::string why = WhyEnd(callbacks);
  while (why.empty()) {
    const double started_s = Now_s(callbacks);
    const StepOutcome outcome = Step(callbacks);
    Record(outcome, Now_s(callbacks) - started_s);
    ++step_;
    ++run_steps_;
    if (!planned_) {
      PlanSteps(Now_s(callbacks));
      CheckKept(callbacks);
    }
    const bool last = planned_ && step_ >= steps_;
    if (callbacks.holdout && options_.holdout_every > 0 && (step_ % options_.holdout_every == 0 || last))
      HoldOut(callbacks);
    if (std::count(callbacks.keep_steps.begin(), callbacks.keep_steps.end(), step_) > 0)
      With(Averaged(), [&] { callbacks.keep(step_); });
    Report(callbacks);
    why = WhyEnd(callbacks);
    if (!why.empty() || Now_s(callbacks) - saved_s_ >= options_.checkpoint_every_s) {
      Save();
      saved_s_ = Now_s(callbacks);
    }
  }
  WriteCurves(folder_);
  return {step_, planned_ ? steps_ : 0, why, best_score_, best_step_, run_steps_, left_out_, holdouts_since_best_};
}

}  // namespace evac::train
