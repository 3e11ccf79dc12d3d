#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstdlib>
#include <string>
#include <vector>

#include "core/error.h"
#include "core/weight_file.h"
#include "policies/learned_input.h"
#include "tests/fuzz/scratch.h"

namespace {

void Require(bool holds) {
  if (!holds) std::abort();
}

template <typename Function>
void ReadOrRefuse(Function read) {
  try {
    read();
  } catch (const evac::Error& error) {
    Require(error.exit_code() == evac::ExitCode::kInvalidInput);
  }
}

}  // namespace

/// Any bytes are weights whose card says what is asked, in its range, and whose tensor is that of the shape asked for,
/// or an InvalidInput.
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  static const Scratch scratch;
  scratch.Write("w.safetensors", data, size);
  ReadOrRefuse([&] {
    evac::WeightFile file(scratch.folder() / "w.safetensors", "fuzz 1");
    for (const auto& entry : file.card()) {
      const std::string& field = entry.first;
      ReadOrRefuse([&] { Require(std::isfinite(file.Number(field))); });
      ReadOrRefuse([&] { Require(std::abs(file.Whole(field, -5, 5)) <= 5); });
      ReadOrRefuse([&] { Require(!file.Names(field).empty()); });
    }
    ReadOrRefuse([&] {
      const evac::Camera camera = evac::CameraOfCard(file, "head");
      Require(camera.fx_px > 0 && camera.fy_px > 0 && std::isfinite(camera.fx_px) && std::isfinite(camera.cy_px));
      Require(camera.mount_from_camera.matrix().allFinite());
    });
    Require(file.Take("out.bias", {2}).bytes.size() == 2 * sizeof(float));
    file.RequireAllTaken();
  });
  return 0;
}
