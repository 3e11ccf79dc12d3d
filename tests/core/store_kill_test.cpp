#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/ptrace.h>
#include <sys/wait.h>

#include <chrono>
#include <csignal>
#include <set>
#include <sstream>
#include <thread>

#include "core/error.h"
#include "core/file.h"
#include "core/hash.h"
#include "tests/core/store_writing.h"
#include "tests/support/command.h"
#include "tests/support/small_disk.h"
#include "tests/support/temp_folder.h"

/// What is left when the process that writes is killed, and when the disk is full.
namespace evac {
namespace {

using namespace samples;
using testing::AnyOf;
using testing::HasSubstr;

/// Starts tests/core/store_child.cpp.
pid_t Child(const std::vector<std::string>& words, const std::filesystem::path& log) {
  std::vector<std::string> command = {Binary("store_child")};
  command.insert(command.end(), words.begin(), words.end());
  return StartCommand(command, log);
}

std::vector<std::string> VideoHashes(const Store& store) {
  std::vector<std::string> hashes;
  for (const Episode& episode : store.Episodes()) hashes.push_back(episode.key.Id() + " " + episode.video_sha256);
  return hashes;
}

std::set<std::string> FilesBelow(const std::filesystem::path& folder) {
  std::set<std::string> names;
  for (const auto& entry : std::filesystem::recursive_directory_iterator(folder)) {
    if (entry.is_regular_file()) names.insert(entry.path().lexically_relative(folder).string());
  }
  return names;
}

void ExpectWhole(const std::filesystem::path& run) {
  const Store store = Store::Open(run, Store::Mode::kReadOnly);
  for (Episode& episode : store.Episodes()) {
    EXPECT_EQ(Sha256HexOfFile(run / episode.video), episode.video_sha256);
    EXPECT_EQ(ReadFile(run / episode.thumbnail), "jpeg of " + episode.key.Id());
    store.LoadSteps(episode);
    EXPECT_EQ(episode.observations.size(), 5u);
    EXPECT_EQ(store.LoadPrivileged(episode.key.Id()).size(), 5u);
  }
}

/// Of the thumbnails that are there whole, while another process writes more.
std::size_t Thumbnails(const std::filesystem::path& run) {
  using Files = std::filesystem::recursive_directory_iterator;
  std::size_t count = 0;
  std::error_code error;
  for (Files file(run / "thumbs", error); !error && file != Files(); file.increment(error))
    count += file->path().extension() == ".jpg";
  return count;
}

TEST(StoreKill, AnEpisodeIsThereWithItsVideoOrNotAtAll) {
  const TempFolder folder;
  const std::filesystem::path run = folder / "run";
  SplitMix64 random(20);
  for (int kills = 0; kills < 12; ++kills) {
    const bool is_adding = kills % 2 == 1;  // or wherever it is by then, on its way there too
    const std::size_t before = Thumbnails(run);
    const pid_t child = Child({"add", run.string(), "1000000"}, folder / "log");
    for (int looks = 0; is_adding && looks < 60'000 && Thumbnails(run) < before + 3; ++looks)
      std::this_thread::sleep_for(std::chrono::milliseconds(1));
    std::this_thread::sleep_for(std::chrono::microseconds(random.Below(is_adding ? 20'000 : 200'000)));
    ::kill(child, SIGKILL);
    int status = 0;
    ::waitpid(child, &status, 0);
    ASSERT_TRUE(WIFSIGNALED(status)) << "the child ended by itself";
    if (std::filesystem::exists(run)) {
      Store::CreateOrContinue(run, SomeRun());  // recovers, whatever there is
      ExpectWhole(run);
    }
  }
  const auto stored = static_cast<int>(Store::CreateOrContinue(run, SomeRun()).Episodes().size());
  EXPECT_GE(stored, 12) << "six were killed between two episodes at least, which is what this looks at";
  const int count = 3 + stored;
  AddMissing(run, count);
  AddMissing(folder / "uninterrupted", count);
  ExpectWhole(run);
  EXPECT_EQ(VideoHashes(Store::Open(run, Store::Mode::kReadOnly)),
            VideoHashes(Store::Open(folder / "uninterrupted", Store::Mode::kReadOnly)));
  EXPECT_EQ(FilesBelow(run / "videos"), FilesBelow(folder / "uninterrupted/videos"));
  EXPECT_EQ(FilesBelow(run / "thumbs"), FilesBelow(folder / "uninterrupted/thumbs"));
}

constexpr int kNotTraced = 98;

/// Lets `child`, which stops itself under PTRACE_TRACEME, run up to the n-th system call after that, and kills it
/// there.
/// @returns false if it ended before, with `status` as of waitpid.
bool KilledAtSystemCall(pid_t child, int n, int& status) {
  ::waitpid(child, &status, 0);
  for (int stops = 0; stops < 2 * n && WIFSTOPPED(status); ++stops) {  // each call stops as it begins and as it ends
    ::ptrace(PTRACE_SYSCALL, child, nullptr, nullptr);
    ::waitpid(child, &status, 0);
  }
  if (!WIFSTOPPED(status)) return false;
  ::kill(child, SIGKILL);
  ::waitpid(child, &status, 0);
  return true;
}

TEST(StoreKill, AtWhicheverSystemCallOfAnAddTheEpisodeIsThereWholeOrNotAtAll) {
  const TempFolder folder;
  const std::filesystem::path run = folder / "run";
  AddMissing(run, 1);
  int n = 1;
  for (bool killed = true; killed; n += 3) {
    const pid_t child = Child({"add_traced", run.string()}, folder / "log");
    int status = 0;
    killed = KilledAtSystemCall(child, n, status);
    if (WIFEXITED(status) && WEXITSTATUS(status) == kNotTraced) GTEST_SKIP() << "this machine lets nobody trace";
    ASSERT_TRUE(killed || status == 0);
    ExpectWhole(run);
  }
  EXPECT_TRUE(Store::Open(run, Store::Mode::kReadOnly).Has(Key(1)));
  EXPECT_GT(n, 50) << "to write a video and a row takes more calls than that";
}

TEST(StoreKill, TheLockGoesWithTheKilledProcess) {
  const TempFolder folder;
  const std::filesystem::path run = folder / "run";
  const pid_t child = Child({"hold", run.string()}, folder / "log");
  const auto holds = [&] {
    return std::filesystem::exists(folder / "log") && ReadFile(folder / "log").find("held") != std::string::npos;
  };
  while (!holds() && ::waitpid(child, nullptr, WNOHANG) == 0)
    std::this_thread::sleep_for(std::chrono::milliseconds(5));
  try {
    Store::CreateOrContinue(run, SomeRun());
    ADD_FAILURE() << "a second process was let in";
  } catch (const Error& error) {
    EXPECT_THAT(error.what(), HasSubstr("process " + std::to_string(child)));
  }
  ::kill(child, SIGKILL);
  ::waitpid(child, nullptr, 0);
  EXPECT_NO_THROW(Store::CreateOrContinue(run, SomeRun()));
}

TEST(StoreFull, OnAFullDiskTheStoreStaysIntactAndSaysSoOnce) {
  const TempFolder folder;
  const std::filesystem::path mount = folder / "disk";
  SmallDisk disk(mount, "size=1m");
  if (!disk.is_there()) GTEST_SKIP() << "mounting a small disk needs root";
  const auto [added, message] = AddUntilFull(mount / "run", 1000);
  EXPECT_GT(added, 3);
  EXPECT_THAT(message, AnyOf(HasSubstr("full"), HasSubstr("No space left")));
  EXPECT_THAT(message, HasSubstr(mount.string()));
  ExpectWhole(mount / "run");
  EXPECT_EQ(Store::Open(mount / "run", Store::Mode::kReadOnly).Episodes().size(), static_cast<std::size_t>(added));

  ASSERT_TRUE(disk.Remount(0, "size=8m"));  // room again: it goes on
  AddMissing(mount / "run", added + 5);
  EXPECT_EQ(Store::Open(mount / "run", Store::Mode::kReadOnly).Episodes().size(), static_cast<std::size_t>(added + 5));
}

TEST(StoreFull, AtTheLimitOfAFilesSizeTheStoreStaysIntact) {
  const TempFolder folder;
  const std::filesystem::path run = folder / "run";
  const CommandResult said = RunCommand({Binary("store_child"), "fill", run.string()});
  ASSERT_EQ(said.exit_code, 0) << said.err;
  std::size_t added = 0;
  std::string message;
  std::istringstream words(said.out);
  words >> added;
  std::getline(words, message);
  EXPECT_GT(added, 3u);
  EXPECT_THAT(message, HasSubstr("evac.sqlite"));
  ExpectWhole(run);
  EXPECT_EQ(Store::Open(run, Store::Mode::kReadOnly).Episodes().size(), added);
}

}  // namespace
}  // namespace evac
