#include <unistd.h>

#include <cstdint>
#include <cstdlib>
#include <filesystem>
#include <string>
#include <vector>

#include "core/error.h"
#include "core/recording_parts.h"

namespace {

/// A file for one input, gone with it. (A memfd will not do: HDF5 resolves the link in /proc to a name that is none.)
class TempFile {
 public:
  TempFile(const std::uint8_t* data, std::size_t size) : descriptor_(::mkstemp(path_.data())) {
    if (descriptor_ < 0 || ::write(descriptor_, data, size) != static_cast<ssize_t>(size)) std::abort();
  }
  ~TempFile() {
    ::close(descriptor_);
    ::unlink(path_.c_str());
  }
  TempFile(const TempFile&) = delete;
  TempFile& operator=(const TempFile&) = delete;

  const std::string& path() const { return path_; }

 private:
  std::string path_ = (std::filesystem::temp_directory_path() / "proprio_fuzz_XXXXXX").string();
  int descriptor_;
};

using Track = std::vector<evac::Arms>(const std::filesystem::path& path);

void ReadOrRefuse(Track* read, const std::string& path) {
  try {
    for (const evac::Arms& arms : read(path)) {
      if (arms.size() != 2) std::abort();
      for (const evac::ArmState& arm : arms) {
        if (!(arm.closure >= 0 && arm.closure <= 1)) std::abort();
      }
    }
  } catch (const evac::Error& error) {
    if (error.exit_code() != evac::ExitCode::kInvalidInput) std::abort();
  }
}

}  // namespace

/// Any bytes are an arms' track whose closures lie in [0, 1], measured and told, or an InvalidInput.
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const TempFile file(data, size);
  ReadOrRefuse(evac::ReadProprio, file.path());
  ReadOrRefuse(evac::ReadTold, file.path());
  return 0;
}
