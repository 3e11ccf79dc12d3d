#include "core/hash.h"

#include <gtest/gtest.h>

#include "core/error.h"
#include "core/file.h"
#include "tests/support/temp_folder.h"

namespace evac {
namespace {

TEST(Sha256, IsTheStandards) {  // FIPS 180-4 examples
  EXPECT_EQ(Sha256Hex(""), "e3b0c44298fc1c149afbf4c8996fb92427ae41e4649b934ca495991b7852b855");
  EXPECT_EQ(Sha256Hex("abc"), "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad");
  EXPECT_EQ(Sha256Hex("abcdbcdecdefdefgefghfghighijhijkijkljklmklmnlmnomnopnopq"),
            "248d6a61d20638b8e5c026930c3e6039a33ce45964ff2167f6ecedd419db06c1");
}

TEST(Sha256, OfAFileIsThatOfItsBytesWhateverTheirNumber) {
  const TempFolder folder;
  for (const std::size_t size : {0u, 1u, 65535u, 65536u, 65537u, 200000u}) {
    const std::string bytes(size, '\x9c');
    WriteFileAtomically(folder / "f", bytes);
    EXPECT_EQ(Sha256HexOfFile(folder / "f"), Sha256Hex(bytes)) << size;
  }
}

TEST(Sha256, WhatCannotBeReadHasNone) {
  const TempFolder folder;
  EXPECT_THROW(Sha256HexOfFile(folder / "missing"), Error);
  EXPECT_THROW(Sha256HexOfFile(folder.path()), Error);
  EXPECT_THROW(Sha256HexOfFile("/proc/self/mem"), Error) << "opens, and fails when it is read";
}

}  // namespace
}  // namespace evac
