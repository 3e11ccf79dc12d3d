#include <cstdint>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <string>

#include "tests/fuzz/mutate_tensor_file.h"
#include "tests/fuzz/scratch.h"
#include "worldmodel/train/trainer.h"

namespace {

using evac::train::Tensor;
using evac::train::Trainer;
using evac::train::TrainerSummary;

constexpr const char* kCheckpoint = "training.safetensors";

void Require(bool holds) {
  if (!holds) std::abort();
}

evac::train::TrainerOptions OptionsOf(double minutes) {
  evac::train::TrainerOptions options;
  options.steps = 1'000'000;
  options.minutes = minutes;
  options.average_decay = 0.5;
  return options;
}

/// Of a training of six numbers, where no time goes by.
struct Process {
  Process(const std::filesystem::path& folder, double minutes)
      : trainer({{"weight", weight}}, OptionsOf(minutes), folder) {}

  TrainerSummary Do(std::int64_t steps) {
    const std::int64_t until = trainer.step() + steps;
    return trainer.Run({.loss = [this](const evac::train::StepPlace&) { return weight.square().sum(); },
                        .interrupted = [this, until] { return trainer.step() >= until; },
                        .clock_s = [] { return 0.0; }});
  }

  Tensor weight = at::zeros({2, 3});
  Trainer trainer;
};

/// What that training writes into its own checkpoint.
const evac::TensorMetadata& OwnMetadata() {
  static const evac::TensorMetadata metadata = [] {
    const Scratch scratch;
    Process(scratch.folder(), 0).Do(1);
    return evac::TensorFile::Open(scratch.folder() / kCheckpoint).metadata();
  }();
  return metadata;
}

/// As the bytes are, and, if they are tensors, with the words by which a training knows its own: no change of bytes
/// finds those.
void WriteCheckpoint(const Scratch& scratch, const std::string& bytes) {
  for (const char* table : {"metrics.csv", "holdout.csv"}) std::filesystem::remove(scratch.folder() / table);
  scratch.Write(kCheckpoint, reinterpret_cast<const std::uint8_t*>(bytes.data()), bytes.size());
  try {
    const evac::TensorFile file = evac::TensorFile::Parse(bytes, "fuzz");
    evac::TensorMetadata metadata = file.metadata();
    for (const char* word : {"format", "layout", "identity"}) {
      if (metadata.contains(word)) metadata[word] = OwnMetadata().at(word);
    }
    evac::WriteTensorFile(scratch.folder() / kCheckpoint, file.tensors(), metadata);
  } catch (const evac::TensorError&) {
  }
}

/// From what is accepted a training goes on, and the next process finds what this one knew.
void GoOn(const Scratch& scratch, double minutes) {
  TrainerSummary done;
  try {
    Process process(scratch.folder(), minutes);
    Require(process.trainer.step() >= 0);
    process.trainer.WithBest([] {});
    done = process.Do(1);
  } catch (const evac::TensorError&) {
    return;
  }
  Process next(scratch.folder(), minutes);
  next.trainer.WithBest([] {});
  const TrainerSummary kept = next.Do(0);
  Require(kept.steps_now == 0 && kept.step == done.step && kept.steps == done.steps);
  Require(kept.best == done.best && kept.best_step == done.best_step);
  Require(kept.left_out == done.left_out && kept.holdouts_since_best == done.holdouts_since_best);
}

}  // namespace

extern "C" std::size_t LLVMFuzzerMutate(std::uint8_t* data, std::size_t size, std::size_t max_size);

/// Nearly always a file of tensors that is one still.
extern "C" std::size_t LLVMFuzzerCustomMutator(std::uint8_t* data, std::size_t size, std::size_t max_size,
                                               unsigned seed) {
  if (seed % 8 != 0) {
    const std::string mutated =
        MutatedTensorFile(std::string(reinterpret_cast<const char*>(data), size), seed, max_size);
    if (!mutated.empty()) {
      std::memcpy(data, mutated.data(), mutated.size());
      return mutated.size();
    }
  }
  return LLVMFuzzerMutate(data, size, max_size);
}

/// Any bytes are the checkpoint of a training, of steps or of minutes, that can go on, or a TensorError.
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  static const Scratch scratch;
  const std::string bytes(reinterpret_cast<const char*>(data), size);
  for (const double minutes : {0.0, 1.0}) {
    WriteCheckpoint(scratch, bytes);
    GoOn(scratch, minutes);
  }
  return 0;
}
