#include "core/file.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/stat.h>
#include <unistd.h>

#include <chrono>
#include <fstream>
#include <future>

#include "core/error.h"
#include "tests/support/temp_folder.h"

namespace evac {
namespace {

namespace fs = std::filesystem;
using testing::AllOf;
using testing::HasSubstr;

template <typename Call>
std::string MessageOf(const Call& call) {
  try {
    call();
  } catch (const Error& error) {
    return error.what();
  }
  return "no error";
}

TEST(File, BytesComeBackAndNothingElseIsLeft) {
  const TempFolder folder;
  const std::string bytes("a\0b\r\n\xff", 6);
  WriteFileAtomically(folder / "f", "something longer that was there before");
  WriteFileAtomically(folder / "f", bytes);
  EXPECT_EQ(ReadFile(folder / "f"), bytes);
  EXPECT_EQ(std::distance(fs::directory_iterator(folder.path()), {}), 1);
}

TEST(File, AnEmptyFileIsEmpty) {
  const TempFolder folder;
  WriteFileAtomically(folder / "f", "");
  EXPECT_EQ(ReadFile(folder / "f"), "");
}

TEST(File, WhatCannotBeReadIsNamedWithTheReason) {
  const TempFolder folder;
  EXPECT_THAT(MessageOf([&] { ReadFile(folder / "missing"); }),
              AllOf(HasSubstr((folder / "missing").string()), HasSubstr("No such file")));
  EXPECT_THAT(MessageOf([&] { ReadFile(folder.path()); }),
              AllOf(HasSubstr(folder.path().string()), HasSubstr("Is a directory")));
}

/// A part of a file must not pass for the whole.
TEST(File, WhatBreaksOffWhileItIsReadIsNoFile) {
  EXPECT_THAT(MessageOf([] { ReadFile("/proc/self/mem"); }),
              AllOf(HasSubstr("/proc/self/mem"), HasSubstr("cannot be read to its end")));
}

TEST(File, WhatCannotBeWrittenIsNamedAndTheOldFileStays) {
  const TempFolder folder;
  EXPECT_THAT(MessageOf([&] { WriteFileAtomically(folder / "missing/f", "x"); }),
              HasSubstr((folder / "missing/f").string()));
  WriteFileAtomically(folder / "f", "old");
  if (!fs::exists("/dev/full")) GTEST_SKIP() << "there is no /dev/full here";
  fs::create_symlink("/dev/full", folder / "f.tmp");
  EXPECT_THAT(MessageOf([&] { WriteFileAtomically(folder / "f", "new"); }), HasSubstr("No space left"));
  EXPECT_EQ(ReadFile(folder / "f"), "old");
  EXPECT_FALSE(fs::is_symlink(folder / "f.tmp"));
}

/// A file took the link's place, and what it led to stayed as it was.
TEST(File, ALinkStaysOneAndTheFileThatItLeadsToIsWritten) {
  const TempFolder folder;
  MakeFolders(folder / "below");
  fs::create_symlink("../f", folder / "below/link");
  fs::create_symlink("below/link", folder / "to_link");
  for (const char* bytes : {"a link to nothing yet", "to a file"}) {
    WriteFileAtomically(folder / "to_link", bytes);
    EXPECT_EQ(ReadFile(folder / "f"), bytes);
    EXPECT_FALSE(fs::is_symlink(folder / "f"));
    EXPECT_TRUE(fs::is_symlink(folder / "to_link") && fs::is_symlink(folder / "below/link"));
  }
  fs::create_symlink("loop", folder / "loop");
  EXPECT_THAT(MessageOf([&] { WriteFileAtomically(folder / "loop", "x"); }), HasSubstr("Too many levels of symbolic links"));
}

/// `evac gate pin RUN --out /dev/null` put a file in the device's place.
TEST(File, WhatIsNoRegularFileIsRefusedAndStays) {
  const TempFolder folder;
  ASSERT_EQ(::mkfifo((folder / "pipe").c_str(), 0600), 0);
  fs::create_symlink("pipe", folder / "to_pipe");
  for (const char* name : {"pipe", "to_pipe"}) {
    for (const bool writes : {false, true}) {
      try {
        writes ? WriteFileAtomically(folder / name, "x") : RefuseFolder(folder / name);
        ADD_FAILURE() << name;
      } catch (const Error& error) {
        EXPECT_EQ(error.exit_code(), ExitCode::kInvalidInput);
        EXPECT_THAT(error.what(), HasSubstr((folder / name).string() + ": is no regular file"));
      }
    }
  }
  EXPECT_TRUE(fs::is_fifo(folder / "pipe"));
  EXPECT_TRUE(fs::is_symlink(folder / "to_pipe"));
}

TEST(File, TwoThatWriteTheSameFileLeaveOneOfThemWhole) {
  const TempFolder folder;
  const std::string a(300'000, 'a'), b(900'000, 'b');
  const auto write = [&](const std::string& bytes) {
    return std::async(std::launch::async, [&] {
      for (int i = 0; i < 20; ++i) WriteFileAtomically(folder / "f", bytes);
    });
  };
  WriteFileAtomically(folder / "f", a);
  std::future<void> first = write(a), second = write(b);
  while (first.wait_for(std::chrono::seconds(0)) != std::future_status::ready) {
    const std::string found = ReadFile(folder / "f");
    ASSERT_TRUE(found == a || found == b) << found.size();
  }
  EXPECT_NO_THROW(first.get());
  EXPECT_NO_THROW(second.get());
  EXPECT_FALSE(fs::exists(folder / "f.tmp"));
}

TEST(File, AnotherNameIsALinkWhereTheDiskHasThem) {
  const TempFolder folder;
  WriteFileAtomically(folder / "f", "x");
  LinkOrCopy(folder / "f", folder / "g");
  EXPECT_TRUE(fs::equivalent(folder / "f", folder / "g"));
}

TEST(File, AFileOfAnotherDiskIsCopiedWholeOrNotAtAll) {
  if (!fs::exists("/dev/shm")) GTEST_SKIP() << "there is no /dev/shm here";
  const TempFolder folder, there("/dev/shm");
  const fs::path from = there / "whole";
  std::ofstream(from) << "whole";
  std::error_code refused;
  fs::create_hard_link(from, folder / "link", refused);
  if (!refused) GTEST_SKIP() << "/dev/shm is no other disk here";
  std::ofstream(folder / "f.tmp") << "half, of a process that was killed";
  LinkOrCopy(from, folder / "f");
  EXPECT_EQ(ReadFile(folder / "f"), "whole");
  EXPECT_FALSE(fs::exists(folder / "f.tmp"));
  MakeFolders(folder / "g.tmp/in_the_way");
  EXPECT_THAT(MessageOf([&] { LinkOrCopy(from, folder / "g"); }), HasSubstr((folder / "g").string()));
  EXPECT_FALSE(fs::exists(folder / "g"));
}

TEST(File, FoldersAreMadeAsFarAsTheyAreMissing) {
  const TempFolder folder;
  for (int twice = 0; twice < 2; ++twice) {
    MakeFolders(folder / "a/b/c/");
    EXPECT_TRUE(fs::is_directory(folder / "a/b/c"));
  }
  WriteFileAtomically(folder / "f", "no folder");
  EXPECT_THAT(MessageOf([&] { MakeFolders(folder / "f/g"); }), HasSubstr((folder / "f").string()));
}

/// It ended commands with 4, as if the machine had refused.
TEST(File, AFolderWhereAFileIsWantedIsTheUsersToMove) {
  const TempFolder folder;
  EXPECT_NO_THROW(RefuseFolder(folder / "new"));
  EXPECT_NO_THROW(RefuseFolder(folder / "missing/new"));
  for (const fs::path& wrong : {folder.path(), folder / "new/"})
    EXPECT_THAT(MessageOf([&] { RefuseFolder(wrong); }), HasSubstr(wrong.string() + ": is a folder, wanted a file"));
}

TEST(File, WhatIsNoFolderWhereOneIsWantedIsTheUsersToMove) {
  const TempFolder folder;
  WriteFileAtomically(folder / "f", "no folder");
  for (const fs::path& wanted : {folder / "f", folder / "f/g/h"}) {
    try {
      MakeFolders(wanted);
      ADD_FAILURE() << wanted;
    } catch (const Error& error) {
      EXPECT_EQ(error.exit_code(), ExitCode::kInvalidInput);
      EXPECT_THAT(error.what(), HasSubstr((folder / "f").string() + ":"));
    }
  }
}

/// Commands ended with 4 and "internal error: filesystem error".
TEST(File, APathThatNobodyCanLookAtIsTheUsersToMend) {
  const TempFolder folder;
  fs::create_symlink("loop", folder / "loop");
  const std::pair<fs::path, const char*> paths[] = {{folder / "loop/below", "Too many levels of symbolic links"},
                                                    {folder / "loop", "Too many levels of symbolic links"},
                                                    {folder / std::string(300, 'n'), "File name too long"}};
  for (const auto& [path, reason] : paths) {
    for (const bool makes : {false, true}) {
      try {
        makes ? MakeFolders(path) : static_cast<void>(StatusOf(path));
        ADD_FAILURE() << path;
      } catch (const Error& error) {
        EXPECT_EQ(error.exit_code(), ExitCode::kInvalidInput);
        EXPECT_THAT(error.what(), AllOf(HasSubstr(path.string() + ": cannot be looked at: "), HasSubstr(reason)));
      }
    }
  }
  EXPECT_EQ(StatusOf(folder / "missing/f").type(), fs::file_type::not_found);
  EXPECT_TRUE(fs::is_directory(StatusOf(folder.path())));
}

}  // namespace
}  // namespace evac
