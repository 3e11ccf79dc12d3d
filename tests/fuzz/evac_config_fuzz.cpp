#include <cstdint>
#include <cstdlib>
#include <string>

#include "core/error.h"
#include "core/tensor_file.h"
#include "tests/fuzz/scratch.h"
#include "worldmodel/evac_config.h"
#include "worldmodel/nn/model_sizes.h"

/// Any text is sizes that make a network and that say the same when they are written and read again, or an
/// InvalidInput.
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  static const Scratch scratch;
  scratch.Write("sizes.yaml", data, size);
  try {
    evac::nn::ModelConfig read = evac::ReadEvacConfig(scratch.folder() / "sizes.yaml"), again;
    const auto sizes = evac::nn::SizesOf(read), copies = evac::nn::SizesOf(again);
    for (std::size_t i = 0; i < sizes.size(); ++i) {
      if (!evac::nn::SetFromText(copies[i], evac::nn::TextOf(sizes[i]))) std::abort();
      if (evac::nn::TextOf(copies[i]) != evac::nn::TextOf(sizes[i])) std::abort();
    }
    again.Check();
  } catch (const evac::TensorError&) {
    std::abort();
  } catch (const evac::Error& error) {
    if (error.exit_code() != evac::ExitCode::kInvalidInput) std::abort();
  }
  return 0;
}
