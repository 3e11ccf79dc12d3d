#include <cstdio>

#include "core/file.h"
#include "core/npy.h"
#include "tests/support/synthetic_recording.h"

namespace {

namespace fs = std::filesystem;

/// CORPUS/npy_fuzz: one array per type. CORPUS/recording_fuzz: a camera's pages, each after the letter that says which
/// it is. CORPUS/proprio_fuzz and CORPUS/video_fuzz: a track and a video of four steps.
void MakeCorpus(const fs::path& corpus) {
  for (const std::string dtype : {"<f8", "<f4", "<i8", "<i4", "|u1"}) {
    evac::WriteText(corpus / "npy_fuzz" / dtype.substr(1), evac::NpyBytes({dtype, {2, 3}, {1, 2, 3, 4, 5, 6}}));
  }
  const fs::path clip = corpus / "clip";
  evac::SyntheticClip(4).Write(evac::OneFolder(clip));
  const auto seed = [&](const char* kind, const char* file) {
    evac::WriteText(corpus / "recording_fuzz" / file, kind + evac::ReadFile(clip / file));
  };
  seed("i", "head_intrinsic_params.json");
  seed("e", "head_extrinsic_params_aligned.json");
  for (const char* target : {"proprio_fuzz", "video_fuzz"}) fs::create_directories(corpus / target);
  fs::rename(clip / "proprio_stats.h5", corpus / "proprio_fuzz" / "four_steps.h5");
  fs::rename(clip / "head_color.mp4", corpus / "video_fuzz" / "four_frames.mp4");
  fs::remove_all(clip);
}

}  // namespace

int main(int argc, char** argv) {
  if (argc != 2) {
    std::fputs("usage: make_corpus FOLDER\n", stderr);
    return 2;
  }
  MakeCorpus(argv[1]);
}
