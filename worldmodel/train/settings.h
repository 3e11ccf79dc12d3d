#pragma once

#include <cstdint>
#include <string>
#include <variant>
#include <vector>

#include "worldmodel/train/codec_training.h"
#include "worldmodel/train/forecast_training.h"
#include "worldmodel/train/trainer.h"
#include "worldmodel/train/world_training.h"

/// Every option of a training by name, whatever the page or line that it is read from.
namespace evac::train {

/// A field of somebody's options.
struct Setting {
  std::string name;
  std::variant<std::int64_t*, std::uint64_t*, double*, bool*, std::string*> field;
};
using Settings = std::vector<Setting>;

/// What the trainings of codec and world share beside the trainer.
struct JobOptions {
  TrainerOptions trainer;
  bool bf16 = false;               ///< products of matrices and convolutions; weights and sums stay floats
  std::int64_t holdout_size = 64;  ///< pictures or windows
};

struct CodecOptions {
  JobOptions job;
  CodecTrainingOptions codec;
};

struct ForecastOptions {
  JobOptions job;  ///< of it the trainer's alone: floats, and all of the hold-out is measured
  ForecastTrainingOptions forecast;
};

struct WorldOptions {
  JobOptions job;
  WorldTrainingOptions world;
  std::string memory_noise_kind = "published";  ///< or "uniform"
  std::string step_weight = "velocity";         ///< or "min_snr", "clean"
  std::string view_weights;                     ///< "1,0.25": numbers above 0, one per view; empty: alike
  std::int64_t strip_steps = 6;                 ///< of the sampler that draws strips

  /// The words above as what they mean. @throws TensorError for a word that is none of them, a number that is none
  void Resolve();
};

/// What a setting says: "16", "0.001" with all its digits, "true"; words as they are.
std::string TextOf(const Setting& setting);
/// The other way round. @returns false, with the field as it was, if the text says no such thing
bool SetFromText(const Setting& setting, const std::string& text);

/// What every training has.
Settings SettingsOf(TrainerOptions& options);
Settings SettingsOf(CodecOptions& options);
Settings SettingsOf(ForecastOptions& options);
Settings SettingsOf(WorldOptions& options);

/// "batch 16\nlearning_rate 0.001\n…": the same text for the same numbers. Lengths and looks are left out: what
/// decides the numbers of each step.
std::string IdentityOf(const Settings& settings);

}  // namespace evac::train
