#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/mount.h>

#include <fstream>

#include "core/file.h"
#include "core/store.h"
#include "core/store_sqlite.h"
#include "tests/support/small_disk.h"
#include "tests/support/synthetic_recording.h"
#include "tests/support/temp_folder.h"
#include "tests/system/process_support.h"
#include "tests/system/run_support.h"

namespace evac {
namespace {

namespace fs = std::filesystem;
using system_test::kFaults;
using system_test::List;
using system_test::RunWords;
using system_test::WaitUntil;
using testing::AllOf;
using testing::AnyOf;
using testing::HasSubstr;

int Lines(const std::string& text, const std::string& with) {
  std::istringstream lines(text);
  int count = 0;
  for (std::string line; std::getline(lines, line);) count += line.find(with) != std::string::npos;
  return count;
}

TEST(Storage, AFullDiskEndsTheRunWithOneMessageAndNoEpisodeIsBlamedForIt) {
  const TempFolder folder;
  SmallDisk disk(folder / "disk", "size=1m");
  if (!disk.is_there()) GTEST_SKIP() << "mounting a small disk needs root";
  const fs::path run = folder / "disk/run";
  const CommandResult full = RunCommand(RunWords(kFaults, run, {"initial_states.count=200", "lanes=2"}));
  EXPECT_EQ(full.exit_code, 4);
  EXPECT_THAT(full.err, AnyOf(HasSubstr("full"), HasSubstr("No space left")));
  EXPECT_EQ(Lines(full.err, "evac: "), 1) << full.err;
  EXPECT_THAT(full.err, HasSubstr("evac resume " + run.string()));
  const std::vector<Episode> stored = Store::Open(run, Store::Mode::kReadOnly).Episodes();
  EXPECT_GT(stored.size(), 1u);
  for (const Episode& episode : stored) {
    EXPECT_FALSE(IsFailure(episode.stop)) << episode.failure;
    EXPECT_TRUE(fs::exists(run / episode.video));
  }
  ASSERT_TRUE(disk.Remount(0, "size=64m"));  // room again
  const pid_t goes_on = StartCommand(RunWords(kFaults, run, {"initial_states.count=200", "lanes=2"}), folder / "log");
  EXPECT_TRUE(
      WaitUntil([&] { return Store::Open(run, Store::Mode::kReadOnly).Episodes().size() > stored.size() + 2; }));
  ::kill(goes_on, SIGTERM);
  ::waitpid(goes_on, nullptr, 0);
}

/// The lock was opened as standard error: progress went into it, and nobody took it for a lock any more.
TEST(Storage, WithStandardErrorClosedNothingThatIsPrintedGoesIntoAFileOfTheRun) {
  const TempFolder folder;
  const fs::path run = folder / "run";
  const auto closed = [&](const std::string& streams) {
    return RunCommand({"/bin/sh", "-c", fmt::format("exec '{}' run '{}' --out '{}' --set initial_states.count=1 {}",
                                                    Binary("evac"), kFaults, run.string(), streams)});
  };
  EXPECT_EQ(closed("2>&-").exit_code, 0);
  EXPECT_EQ(closed("<&- 2>&-").exit_code, 0);
  EXPECT_THAT(ReadFile(run / "lock"), testing::MatchesRegex("[0-9]*\n?"));
  const CommandResult resumed = RunCommand({Binary("evac"), "resume", run});
  EXPECT_EQ(resumed.exit_code, 0) << resumed.err;
  EXPECT_EQ(Store::Open(run, Store::Mode::kReadOnly).Episodes().size(), 1u);
}

TEST(Storage, AnOutputThatCannotBeWrittenIsOneMessage) {
  const TempFolder folder;
  SmallDisk disk(folder / "disk", "size=1m");
  if (!disk.is_there() || !disk.Remount(MS_RDONLY, "")) GTEST_SKIP() << "mounting a read-only disk needs root";
  const CommandResult result = RunCommand(RunWords(kFaults, folder / "disk/run"));
  EXPECT_EQ(result.exit_code, 4);
  EXPECT_THAT(result.err, AllOf(HasSubstr((folder / "disk/run").string()), HasSubstr("Read-only")));
  EXPECT_EQ(Lines(result.err, ""), 1) << result.err;
}

TEST(Storage, ResultsThatAFullDiskDidNotTakeAreNoSuccess) {
  for (const char* command : {"plan", "plan --json"}) {
    const std::string words = "exec \"$0\" " + std::string(command) + " >/dev/full";
    const CommandResult result = RunCommand({"/bin/sh", "-c", words, Binary("evac")});
    EXPECT_EQ(result.exit_code, 4) << command;
    EXPECT_THAT(result.err, HasSubstr("No space left"));
    EXPECT_EQ(Lines(result.err, "evac: "), 1) << result.err;
  }
}

TEST(Storage, ARunThatAnotherProcessWritesIsRefusedWithItsNumberAndGoesOnUnharmed) {
  const TempFolder folder;
  const pid_t first = StartCommand(RunWords(kFaults, folder / "run"), folder / "log");
  ASSERT_TRUE(WaitUntil([&] { return fs::exists(folder / "run/videos"); }));
  for (const std::vector<std::string>& words :
       {RunWords(kFaults, folder / "run"), {Binary("evac"), "resume", (folder / "run").string(), "--retry-failed"}}) {
    const CommandResult second = RunCommand(words);
    EXPECT_EQ(second.exit_code, 2);
    EXPECT_THAT(second.err, HasSubstr(fmt::format("process {} is writing here", first)));
  }
  int status = -1;
  ::waitpid(first, &status, 0);
  EXPECT_EQ(status, 0);
}

TEST(Storage, AStoreOfANewerVersionIsRefusedByEveryCommandAndLeftAsItIs) {
  const TempFolder folder;
  ASSERT_EQ(RunCommand(RunWords(kFaults, folder / "run", {"initial_states.count=1"})).exit_code, 0);
  const fs::path file = folder / "run/evac.sqlite";
  sqlite::Connection::OpenReadWrite(file).Run("PRAGMA user_version = 99");
  const std::string before = ReadFile(file);
  for (const char* command : {"ls", "resume", "report", "judge", "run"}) {
    std::vector<std::string> words = {Binary("evac"), command, (folder / "run").string()};
    if (command == std::string("run")) words = RunWords(kFaults, folder / "run", {"initial_states.count=1"});
    const CommandResult result = RunCommand(words);
    EXPECT_EQ(result.exit_code, 2) << command;
    EXPECT_THAT(result.err, HasSubstr("schema version 99")) << command;
  }
  EXPECT_EQ(ReadFile(file), before);
}

/// A recording made to be spoiled, and what the run says then.
struct Spoiled {
  std::string name, file, wanted;
  std::function<std::string(std::string)> spoil;
};

void PrintTo(const Spoiled& spoiled, std::ostream* out) { *out << spoiled.name; }

class SpoiledRecording : public testing::TestWithParam<Spoiled> {};

std::string Half(const std::string& bytes) { return bytes.substr(0, bytes.size() / 2); }

/// The clip layout for h5, mp4 and extrinsics; the example layout of docs/formats/recording.md for PNG and npy.
fs::path MakeRecording(const fs::path& folder, const std::string& file) {
  const bool is_example = file.ends_with(".png") || file.ends_with(".npy");
  if (!is_example) {
    SyntheticClip(10).Write(OneFolder(folder));
    return folder;
  }
  const fs::path shared = fs::path(EVAC_SHARED_DIR) / "data/agibot_examples/example0";
  if (!fs::exists(shared)) return {};
  fs::copy(shared, folder, fs::copy_options::recursive);
  return folder;
}

TEST_P(SpoiledRecording, EndsTheRunWithOneMessageThatNamesTheFile) {
  const TempFolder folder;
  const fs::path recording = MakeRecording(folder / "recording", GetParam().file);
  if (recording.empty()) GTEST_SKIP() << "the AgiBot examples are not here";
  const fs::path file = recording / GetParam().file;
  WriteText(file, GetParam().spoil(ReadFile(file)));
  const CommandResult result = RunCommand(RunWords(EVAC_SOURCE_DIR "/apps/configs/agibot_replay.yaml", folder / "run",
                                                   {"recording=" + recording.string()}));
  EXPECT_EQ(result.exit_code, 2) << result.err;
  EXPECT_THAT(result.err, AllOf(HasSubstr(GetParam().file), HasSubstr(GetParam().wanted)));
  EXPECT_EQ(Lines(result.err, "evac: "), 1) << result.err;
  EXPECT_EQ(fs::exists(folder / "run") ? List(folder / "run") : "[]\n", "[]\n");
}

INSTANTIATE_TEST_SUITE_P(Each, SpoiledRecording,
                         testing::Values(Spoiled{"TruncatedPng", "frame.png", "", Half},
                                         Spoiled{"TruncatedNpy", "action.npy", "", Half},
                                         Spoiled{"TruncatedH5", "proprio_stats.h5", "", Half},
                                         Spoiled{"TruncatedMp4", "head_color.mp4", "", Half},
                                         Spoiled{"WrongExtrinsics", "head_extrinsic_params_aligned.json", "rotation",
                                                 [](std::string page) {
                                                   const std::size_t at = page.find("rotation_matrix");
                                                   const std::size_t number = page.find_first_of("-0123456789", at);
                                                   return page.replace(
                                                       number, page.find_first_of(",]", number) - number, "7.5");
                                                 }}),
                         [](const testing::TestParamInfo<Spoiled>& info) { return info.param.name; });

}  // namespace
}  // namespace evac
