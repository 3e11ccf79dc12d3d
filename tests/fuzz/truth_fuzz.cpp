#include <cstdint>
#include <cstdlib>
#include <vector>

#include "core/collection.h"
#include "core/error.h"
#include "tests/fuzz/scratch.h"

/// Any bytes are what is known of an episode's frames, as many as were asked for, or an InvalidInput.
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  static const Scratch scratch;
  constexpr std::size_t kFrames = 3;
  std::vector<evac::Camera> cameras(1);
  cameras[0].name = "head";
  scratch.Write("truth.safetensors", data, size);
  try {
    const evac::EpisodeTruth truth = evac::ReadTruth(scratch.folder() / "truth.safetensors", kFrames, cameras);
    if (truth.contact.size() != kFrames || truth.object_px.size() != 2 * kFrames) std::abort();
  } catch (const evac::Error& error) {
    if (error.exit_code() != evac::ExitCode::kInvalidInput) std::abort();
  }
  return 0;
}
