#include <cstdint>
#include <cstdlib>
#include <filesystem>

#include "core/error.h"
#include "core/scene_files.h"
#include "tests/fuzz/scratch.h"

/// Any bytes are a scene, and what it is made of are files that are there, whatever it includes, itself too.
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  static const Scratch scratch;
  scratch.Write("scene.xml", data, size);
  try {
    for (const std::filesystem::path& file : evac::FilesOfScene(scratch.folder() / "scene.xml")) {
      if (!std::filesystem::is_regular_file(file)) std::abort();
    }
  } catch (const evac::Error& error) {
    if (error.exit_code() != evac::ExitCode::kInvalidInput) std::abort();
  }
  return 0;
}
