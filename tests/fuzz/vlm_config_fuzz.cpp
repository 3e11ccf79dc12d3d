#include <cstdint>
#include <cstdlib>
#include <string>

#include "core/error.h"
#include "judges/vlm_config.h"
#include "tests/fuzz/scratch.h"

/// Any text is a model server's page whose numbers are in their ranges, or an InvalidInput. (Its key is not read: the
/// page may name any file.)
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  static const Scratch scratch;
  scratch.Write("server.yaml", data, size);
  try {
    const evac::VlmConfig config = evac::VlmConfig::FromFile(scratch.folder() / "server.yaml");
    if (!config.JudgeName().starts_with("vlm:" + config.name + "-")) std::abort();
    if (!(config.probe_share >= 0 && config.probe_share <= 1)) std::abort();
    if (config.clip.frames < 2 || config.clip.frames > 256 || !(config.limits.total_s > 0)) std::abort();
  } catch (const evac::Error& error) {
    if (error.exit_code() != evac::ExitCode::kInvalidInput) std::abort();
  }
  return 0;
}
