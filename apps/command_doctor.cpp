#include <fmt/format.h>

#include <unistd.h>

#include <filesystem>
#include <functional>
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
using Complaint = std::optional<std::string>;

class ScratchFolder {
 public:
  ScratchFolder() : path_(fs::temp_directory_path() / fmt::format("evac-doctor-{}", ::getpid())) { fs::create_directories(path_); }
  ~ScratchFolder() {
    std::error_code ignored;
    fs::remove_all(path_, ignored);
  }
  const fs::path& path() const { return path_; }

 private:
  fs::path path_;
};

Complaint Video(const fs::path& folder) {
  VideoWriter writer(folder / "video.mp4", {});
  writer.Append(cv::Mat(64, 96, CV_8UC3, cv::Scalar(200, 40, 40)));
  writer.Finish();
  const cv::Mat frame = VideoReader(folder / "video.mp4").Next();
  if (frame.empty()) return "a video that was just written cannot be read";
  return std::nullopt;
}

Complaint StoreWorks(const fs::path& folder) {
  Store::CreateOrContinue(folder / "run", {.suite_text = "suite: doctor", .suite_hash = "doctor", .suite_path = "", .evac_version = EVAC_VERSION});
  if (Store::Open(folder / "run", Store::Mode::kReadOnly).run().suite_hash != "doctor") return "what was written to SQLite is not what is read";
  return std::nullopt;
}

Complaint DiskSpace(const fs::path& folder) {
  const auto free_bytes = fs::space(folder).available;
  if (free_bytes < 200'000'000) return fmt::format("{} MB free in {}, wanted 200 MB", free_bytes / 1'000'000, folder.string());
  return std::nullopt;
}

Complaint Rendering() {
  const sim::Renderer renderer;  // throws, naming the step that fails
  return std::nullopt;
}

bool Passes(const char* what, const char* why, const std::function<Complaint()>& check) {
  Complaint complaint;
  try {
    complaint = check();
  } catch (const std::exception& error) {
    complaint = error.what();
  }
  fmt::print("{} {:<12} {}\n", complaint ? "FAIL" : "ok  ", what, complaint ? *complaint : why);
  return !complaint;
}

ExitCode Doctor() {
  const ScratchFolder scratch;
  fmt::print("evac {}, {} cores\n", EVAC_VERSION, std::thread::hardware_concurrency());
  bool healthy = Passes("disk", "there is room for a run", [&] { return DiskSpace(scratch.path()); });
  healthy &= Passes("store", "SQLite writes and reads a run", [&] { return StoreWorks(scratch.path()); });
  healthy &= Passes("video", "H.264 is encoded and decoded", [&] { return Video(scratch.path()); });
  healthy &= Passes("lcm", "a message over multicast comes back", [] { return WhatIsWrongWithLcm(); });
  healthy &= Passes("rendering", "MuJoCo draws without a display", Rendering);
  return healthy ? ExitCode::kOk : ExitCode::kNo;
}

}  // namespace

void AddDoctor(CLI::App& app, ExitCode& exit_code) {
  CLI::App* command = app.add_subcommand("doctor", "Check that this machine can run evaluations");
  command->footer("Example:\n  evac doctor\nExit code 1 if anything fails; each line says what to do.");
  command->callback([&exit_code] { exit_code = Doctor(); });
}

}  // namespace evac
