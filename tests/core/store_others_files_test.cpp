#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/error.h"
#include "core/file.h"
#include "core/store_calls.h"
#include "core/store_lock.h"
#include "tests/core/store_samples.h"
#include "tests/support/temp_folder.h"

/// What is in the folder of a run and not evac's stays, whatever a run is begun there.
namespace evac {
namespace {

namespace fs = std::filesystem;
using namespace samples;
using testing::HasSubstr;

class OthersFiles : public testing::Test {
 protected:
  fs::path Own(const std::string& name) const {
    const fs::path file = folder_ / name;
    MakeFolders(file.parent_path());
    WriteFileAtomically(file, "mine");
    return file;
  }

  template <typename Call>
  static void ExpectRefused(const Call& call, const fs::path& name) {
    try {
      call();
      ADD_FAILURE() << name << " was not refused";
    } catch (const Error& error) {
      EXPECT_EQ(error.exit_code(), ExitCode::kInvalidInput) << error.what();
      EXPECT_THAT(error.what(), HasSubstr(name.string() + ":"));
    }
  }
  void ExpectNoRunBegins(const fs::path& name) const {
    ExpectRefused([&] { Store::CreateOrContinue(folder_ / "run", SomeRun()).RemoveOrphans(); }, name);
  }

  const TempFolder folder_;
};

/// They ended with 4, "internal error: filesystem error", as if the machine had refused.
TEST_F(OthersFiles, APathThatNobodyCanLookAtIsRefusedByNameWhateverIsAskedOfIt) {
  fs::create_symlink("loop", folder_ / "loop");
  const fs::path long_name = folder_ / std::string(300, 'n'), below = folder_ / "loop/run";
  for (const fs::path& path : {below, long_name}) {
    ExpectRefused([&] { Store::CreateOrContinue(path, SomeRun()); }, path);
    ExpectRefused([&] { Store::Open(path, Store::Mode::kReadOnly); }, path / "evac.sqlite");
    ExpectRefused([&] { Store::Open(path, Store::Mode::kReadWrite); }, path / "evac.sqlite");
    ExpectRefused([&] { TotalsOfCalls(path); }, path / CallCache::kFile);
  }
}

/// All that was below them went without a word.
TEST_F(OthersFiles, InVideosOrThumbsRefuseANewRunAndStay) {
  for (const char* part : {"videos", "thumbs"}) {
    const fs::path file = Own(std::string("run/") + part + "/2024/own.mp4");
    ExpectNoRunBegins(folder_ / "run" / part);
    EXPECT_EQ(ReadFile(file), "mine");
    EXPECT_FALSE(fs::exists(folder_ / "run/lock")) << "nothing is written into somebody's folder";
    fs::remove_all(folder_ / "run" / part);
  }
}

TEST_F(OthersFiles, BehindALinkRefuseANewRunAndStay) {
  const fs::path file = Own("elsewhere/own.mp4");
  fs::create_directory(folder_ / "run");
  fs::create_directory_symlink(folder_ / "elsewhere", folder_ / "run/videos");
  ExpectNoRunBegins(folder_ / "run/videos");
  EXPECT_EQ(ReadFile(file), "mine");
}

TEST_F(OthersFiles, BehindALinkStayWhenARunGoesOn) {
  const fs::path file = Own("elsewhere/own.jpg");
  Store store = Store::CreateOrContinue(folder_ / "run", SomeRun());
  fs::create_directory_symlink(folder_ / "elsewhere", folder_ / "run/thumbs");
  store.RemoveOrphans();
  EXPECT_EQ(ReadFile(file), "mine");
}

TEST_F(OthersFiles, EmptyFoldersOfThoseNamesAreInNobodysWay) {
  MakeFolders(folder_ / "run/videos");
  MakeFolders(folder_ / "run/thumbs");
  EXPECT_NO_THROW(Store::CreateOrContinue(folder_ / "run", SomeRun()));
}

/// It was cut to the number of the process that locked it.
TEST_F(OthersFiles, CalledAsALockAreRefusedAndStay) {
  const fs::path file = Own("run/lock");
  ExpectNoRunBegins(file);
  EXPECT_EQ(ReadFile(file), "mine");
  WriteFileAtomically(file, std::string(17, '1'));
  ExpectRefused([&] { RunLock lock(file); }, file);
  EXPECT_EQ(ReadFile(file), std::string(17, '1')) << "no number of a process is so long";
  fs::remove(file);
  fs::create_directory(file);
  ExpectRefused([&] { RunLock lock(file); }, file);
}

TEST_F(OthersFiles, AreNotLockedThroughALink) {
  const fs::path file = Own("elsewhere/notes.txt"), link = folder_ / "lock";
  WriteFileAtomically(file, "4711\n");
  fs::create_symlink(file, link);
  ExpectRefused([&] { RunLock lock(link); }, link);
  EXPECT_EQ(ReadFile(file), "4711\n");
}

TEST_F(OthersFiles, ALockThatAKilledProcessLeftIsTakenAgain) {
  WriteFileAtomically(folder_ / "lock", "4711\n");
  EXPECT_NO_THROW(RunLock(folder_ / "lock"));
  WriteFileAtomically(folder_ / "lock", "");
  EXPECT_NO_THROW(RunLock(folder_ / "lock"));
}

}  // namespace
}  // namespace evac
