#include <fmt/format.h>
#include <mujoco/mujoco.h>
#include <sys/resource.h>
#include <unistd.h>

#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <functional>
#include <opencv2/core/utility.hpp>
#include <opencv2/imgcodecs.hpp>
#include <optional>
#include <thread>

#include "apps/commands.h"
#include "core/store.h"
#include "core/version.h"
#include "core/video.h"
#include "policies/lcm_link.h"
#include "worldmodel/sim/renderer.h"

namespace evac {
namespace {

namespace fs = std::filesystem;

class ScratchFolder {
 public:
  ScratchFolder() : path_(fs::temp_directory_path() / fmt::format("evac-doctor-{}", ::getpid())) {
    fs::create_directories(path_);
  }
  ~ScratchFolder() {
    std::error_code ignored;
    fs::remove_all(path_, ignored);
  }
  const fs::path& path() const { return path_; }

 private:
  fs::path path_;
};

/// What a check found. Advice: it works, but not as well as it could.
struct Finding {
  enum class Kind { kGood, kAdvice, kBroken };
  Kind kind = Kind::kGood;
  std::string sentence;
};

Finding Good(const std::string& sentence) { return {Finding::Kind::kGood, sentence}; }
Finding Advice(const std::string& sentence) { return {Finding::Kind::kAdvice, sentence}; }
Finding Broken(const std::string& sentence) { return {Finding::Kind::kBroken, sentence}; }

Finding Video(const fs::path& folder) {
  VideoWriter writer(folder / "video.mp4", {});
  writer.Append(cv::Mat(64, 96, CV_8UC3, cv::Scalar(200, 40, 40)));
  writer.Finish();
  const cv::Mat frame = VideoReader(folder / "video.mp4").Next();
  if (frame.empty())
    return Broken("a video that was just written cannot be read: apt-get install libavcodec59 with libx264");
  return Good("H.264 is encoded and decoded");
}

Finding Images() {
  std::vector<unsigned char> bytes;
  const cv::Mat image(8, 8, CV_8UC3, cv::Scalar(10, 120, 200));
  for (const char* format : {".png", ".jpg"}) {
    if (!cv::imencode(format, image, bytes) || cv::imdecode(bytes, cv::IMREAD_COLOR).empty())
      return Broken(fmt::format("OpenCV cannot write and read {}: apt-get install libopencv-imgcodecs406", format));
  }
  return Good("PNG and JPEG are encoded and decoded");
}

Finding StoreWorks(const fs::path& folder) {
  Store::CreateOrContinue(
      folder / "run",
      {.suite_text = "suite: doctor", .suite_hash = "doctor", .suite_path = "", .evac_version = EVAC_VERSION});
  if (Store::Open(folder / "run", Store::Mode::kReadOnly).run().suite_hash != "doctor")
    return Broken("what was written to SQLite is not what is read");
  return Good("SQLite writes and reads a run");
}

/// Where runs would go: here, and where temporary files go.
Finding DiskSpace(const fs::path& scratch) {
  constexpr std::uintmax_t kEnough = 2'000'000'000, kLeast = 200'000'000;
  Finding finding = Good(fmt::format("{} GB free here", fs::space(".").available / 1'000'000'000));
  for (const fs::path& folder : {fs::current_path(), scratch.parent_path()}) {
    const std::uintmax_t free_bytes = fs::space(folder).available;
    const std::string sentence = fmt::format("{} MB free in {}; a thousand episodes take about a gigabyte",
                                             free_bytes / 1'000'000, folder.string());
    if (free_bytes < kLeast) return Broken(sentence + ": make room, or give --out a folder on another disk");
    if (free_bytes < kEnough) finding = Advice(sentence);
  }
  return finding;
}

Finding Multicast() {
  if (const auto wrong = WhatIsWrongWithLcm()) return Broken(*wrong);
  return Good("a message over multicast comes back");
}

/// Of the 4 MiB that every link asks for.
Finding LcmBuffers() {
  constexpr long kWanted = 4 << 20;
  long limit = 0;
  std::ifstream("/proc/sys/net/core/rmem_max") >> limit;
  if (limit >= kWanted) return Good(fmt::format("receive buffers of up to {} kB", limit / 1024));
  return Advice(
      fmt::format("receive buffers are limited to {} kB: large images get lost and are sent again, which costs time; "
                  "messages larger than that (raw images) may never arrive, and fail their episodes. "
                  "sysctl -w net.core.rmem_max={}",
                  limit / 1024, kWanted));
}

Finding Rendering() {
  const sim::Renderer renderer;  // throws, naming the step that fails
  const char* display = std::getenv("DISPLAY");
  return Good(
      fmt::format("MuJoCo draws without a display{}", display && *display ? " (DISPLAY is set and not needed)" : ""));
}

Finding Threads() {
  const unsigned cores = std::thread::hardware_concurrency();
  rlimit files{};
  ::getrlimit(RLIMIT_NOFILE, &files);
  if (files.rlim_cur < 256)
    return Advice(fmt::format("only {} open files are allowed: ulimit -n 1024", files.rlim_cur));
  const char* omp = std::getenv("OMP_NUM_THREADS");
  const std::string limited = omp && *omp ? fmt::format("; OMP_NUM_THREADS={} limits networks, not physics", omp) : "";
  if (cores < 2) return Advice("one core: worlds and policies take turns" + limited);
  return Good(fmt::format("{} cores: `threads: 0` uses all of them{}", cores, limited));
}

/// What the program was built with and what it runs with.
Finding Versions() {
  const std::string all = fmt::format("{}, {}, OpenCV {}, MuJoCo {}", Store::Engine(), VideoLibrary(),
                                      cv::getVersionString(), mj_versionString());
  if (mj_version() != mjVERSION_HEADER)
    return Broken(fmt::format("{}; built with MuJoCo {}: build again", all, mjVERSION_HEADER));
  return Good(all);
}

bool Passes(const char* what, const std::function<Finding()>& check) {
  Finding finding;
  try {
    finding = check();
  } catch (const std::exception& error) {
    finding = Broken(error.what());
  }
  const char* word = finding.kind == Finding::Kind::kGood     ? "ok  "
                     : finding.kind == Finding::Kind::kAdvice ? "note"
                                                              : "FAIL";
  fmt::print("{} {:<10} {}\n", word, what, finding.sentence);
  return finding.kind != Finding::Kind::kBroken;
}

/// What needs a place for temporary files, of which there may be none.
bool FilesPass() {
  std::optional<ScratchFolder> scratch;
  const auto find_room = [&]() -> Finding {
    try {
      scratch.emplace();
    } catch (const fs::filesystem_error& error) {
      return Broken(fmt::format("{}: set TMPDIR to a folder that can be written", error.what()));
    }
    return DiskSpace(scratch->path());
  };
  const bool has_room = Passes("disk", find_room);
  if (!scratch) return false;
  const bool stores = Passes("store", [&] { return StoreWorks(scratch->path()); });
  return Passes("video", [&] { return Video(scratch->path()); }) && stores && has_room;
}

ExitCode Doctor() {
  fmt::print("evac {}\n", EVAC_VERSION);
  bool healthy = Passes("versions", Versions);
  healthy &= Passes("threads", Threads);
  healthy &= FilesPass();
  healthy &= Passes("images", Images);
  healthy &= Passes("multicast", Multicast);
  healthy &= Passes("buffers", LcmBuffers);
  healthy &= Passes("rendering", Rendering);
  return healthy ? ExitCode::kOk : ExitCode::kNo;
}

}  // namespace

void AddDoctor(CLI::App& app, ExitCode& exit_code) {
  CLI::App* command = app.add_subcommand("doctor", "Check that this machine can run evaluations");
  command->footer(
      "Example:\n  evac doctor\nExit code 1 if anything fails; the line says what to do; a note works, but could be "
      "better.");
  command->callback([&exit_code] { exit_code = Doctor(); });
}

}  // namespace evac
