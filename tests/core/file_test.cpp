#include "core/file.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

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

TEST(File, FoldersAreMadeAsFarAsTheyAreMissing) {
  const TempFolder folder;
  for (int twice = 0; twice < 2; ++twice) {
    MakeFolders(folder / "a/b/c/");
    EXPECT_TRUE(fs::is_directory(folder / "a/b/c"));
  }
  WriteFileAtomically(folder / "f", "no folder");
  EXPECT_THAT(MessageOf([&] { MakeFolders(folder / "f/g"); }), HasSubstr((folder / "f").string()));
}

}  // namespace
}  // namespace evac
