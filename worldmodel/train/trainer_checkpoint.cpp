#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <system_error>

#include "worldmodel/nn/mapped_tensors.h"
#include "worldmodel/nn/number_text.h"
#include "worldmodel/train/identity_text.h"
#include "worldmodel/train/trainer.h"

namespace evac::train {
namespace {

constexpr const char* kFile = "training.safetensors";
constexpr const char* kFormat = "evac-training 1";
constexpr std::int64_t kMostSteps = std::int64_t{1} << 40;
constexpr const char* kTables = ", and its metrics.csv and holdout.csv";

/// All 53 bits, so that a number read again is the number that was written.
std::string Exact(double value) {
  char text[40];
  std::snprintf(text, sizeof text, "%a", value);
  return text;
}

class Metadata {
 public:
  explicit Metadata(const TensorFile& file) : file_(file) {}
  bool Has(const char* key) const { return file_.metadata().contains(key); }
  std::string Text(const char* key) const {
    const auto found = file_.metadata().find(key);
    if (found == file_.metadata().end()) throw TensorError(file_.name() + ": its metadata has no '" + key + "'");
    return found->second;
  }
  /// Of a key that checkpoints of earlier versions may lack.
  std::int64_t WholeOr0(const char* key) const { return Has(key) ? Whole(key) : 0; }
  std::int64_t Whole(const char* key) const {
    std::int64_t found = 0;
    if (!nn::ParseNumber(Text(key), found) || found < 0 || found > kMostSteps)
      Refuse(key, "a whole number from 0 to 2^40");
    return found;
  }
  /// As Exact writes it. A loss or a score may be infinite, or "nan".
  double Number(const char* key) const {
    const std::string text = Text(key);
    char* end = nullptr;
    const double found = std::strtod(text.c_str(), &end);
    if (text.empty() || end != text.c_str() + text.size()) Refuse(key, "a number");
    return found;
  }
  const std::string& file() const { return file_.name(); }

 private:
  [[noreturn]] void Refuse(const char* key, const char* wanted) const {
    throw TensorError(file_.name() + ": its metadata's '" + key + "' is '" + Text(key) + "', wanted " + wanted);
  }

  const TensorFile& file_;
};

/// Minutes are counted once.
void RequireSameMinutes(const Metadata& metadata, double minutes) {
  const bool has_minutes = metadata.Has("minutes");
  if (has_minutes && metadata.Number("minutes") == minutes) return;
  char text[160];
  std::snprintf(text, sizeof text, ", %.6g minutes were asked for now: wanted %s", minutes,
                has_minutes ? "those of before, or more --steps to go on for longer" : "--steps, more go on for longer");
  throw TensorError(metadata.file() + " is planned for " + metadata.Text("steps") + " steps and has done " +
                    metadata.Text("step") + text);
}

void CopyFrom(const nn::MappedTensors& file, const char* name, const Tensor& to) {
  const Tensor found = file.Get(name);
  nn::CheckShape(file.file().name() + ": " + name, found, to.sizes());
  Tensor(to).copy_(found);
}

}  // namespace

/// What must be the same for two processes to work on one training. How long it goes on and how often it is looked at
/// may change from one to the next. WhatDiffers reads it.
std::string Trainer::Identity() const {
  const TrainerOptions& o = options_;
  std::string text;
  for (const double number : {o.learning_rate, o.decay_from, o.adamw.beta1, o.adamw.beta2, o.adamw.epsilon,
                              o.adamw.weight_decay, o.clip_norm, o.average_decay, static_cast<double>(o.warmup_steps),
                              static_cast<double>(o.accumulate)})
    text += Exact(number) + " ";
  if (o.optimiser != "adamw") text += o.optimiser + " " + Exact(o.momentum) + " ";
  return text + "seed " + std::to_string(o.seed) + " " + o.identity;
}

bool Trainer::Load() {
  const std::filesystem::path path = folder_ / kFile;
  if (!std::filesystem::exists(path)) return false;
  const at::NoGradGuard no_gradients;
  const nn::MappedTensors file(TensorFile::Open(path));
  const Metadata metadata(file.file());
  if (metadata.Text("format") != kFormat)
    throw TensorError(path.string() + ": format '" + metadata.Text("format") + "', wanted '" + kFormat + "'");
  if (metadata.Text("layout") != parameters_.Layout())
    throw TensorError(path.string() + " is a training of other parameters: another folder, or throw it away" + kTables);
  if (metadata.Text("identity") != Identity()) {
    const std::string named = WhatDiffers(metadata.Text("identity"), Identity());
    throw TensorError(path.string() + " is a training with other options: " +
                      (named.empty() ? "as another version of evac says them" : named) +
                      ": another folder, or throw it away" + kTables);
  }
  CopyFrom(file, "values", state_.values);
  CopyFrom(file, "first_moment", state_.first_moment);
  CopyFrom(file, "second_moment", state_.second_moment);
  if (state_.average.defined()) CopyFrom(file, "average", state_.average);
  step_ = metadata.Whole("step");
  not_finite_ = metadata.Whole("not_finite");
  left_out_ = metadata.WholeOr0("left_out");
  smooth_loss_ = metadata.Number("smooth_loss");
  if (options_.minutes > 0 && metadata.Text("planned") == "1") {
    planned_ = true;
    steps_ = metadata.Whole("steps");
    RequireSameMinutes(metadata, options_.minutes);
  }
  holdouts_since_best_ = metadata.WholeOr0("holdouts_since_best");
  // An earlier version took a first hold-out for the best though it was no number.
  if (!metadata.Has("best_score") || !std::isfinite(metadata.Number("best_score"))) return true;
  best_ = state_.values.clone();
  CopyFrom(file, "best", best_);
  best_score_ = metadata.Number("best_score");
  best_step_ = metadata.Whole("best_step");
  return true;
}

void Trainer::Save() const {
  std::vector<NamedTensor> tensors = {{"values", state_.values},
                                      {"first_moment", state_.first_moment},
                                      {"second_moment", state_.second_moment}};
  if (state_.average.defined()) tensors.push_back({"average", state_.average});
  TensorMetadata metadata = {{"format", kFormat},
                             {"layout", parameters_.Layout()},
                             {"identity", Identity()},
                             {"step", std::to_string(step_)},
                             {"steps", std::to_string(steps_)},
                             {"planned", planned_ ? "1" : "0"},
                             {"not_finite", std::to_string(not_finite_)},
                             {"left_out", std::to_string(left_out_)},
                             {"holdouts_since_best", std::to_string(holdouts_since_best_)},
                             {"smooth_loss", Exact(smooth_loss_)}};
  if (planned_ && options_.minutes > 0) metadata["minutes"] = Exact(options_.minutes);
  if (best_score_) {
    tensors.push_back({"best", best_});
    metadata["best_score"] = Exact(*best_score_);
    metadata["best_step"] = std::to_string(best_step_);
  }
  std::vector<TensorView> views;
  for (NamedTensor& tensor : tensors) {
    tensor.tensor = tensor.tensor.cpu();
    views.push_back(nn::ViewOf(tensor.name, tensor.tensor));
  }
  WriteTensorFile(folder_ / kFile, views, metadata);
  std::error_code ignored;
  std::filesystem::remove(Unsaved(), ignored);
}

}  // namespace evac::train
