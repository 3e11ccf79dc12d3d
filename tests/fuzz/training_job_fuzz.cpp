#include <cstdint>
#include <cstdlib>
#include <string>

#include "worldmodel/train/training_job.h"

/// Whatever a job's file says: it is refused, or read again it says the same.
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  try {
    const evac::train::TrainingJob job =
        evac::train::ParseTrainingJob(std::string(reinterpret_cast<const char*>(data), size), "job");
    const std::string text = evac::train::TextOf(job);
    if (evac::train::TextOf(evac::train::ParseTrainingJob(text, "again")) != text) std::abort();
  } catch (const evac::TensorError&) {
  }
  return 0;
}
