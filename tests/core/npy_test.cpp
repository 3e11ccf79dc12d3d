#include "core/npy.h"

#include <gmock/gmock.h>

#include "core/error.h"
#include "core/file.h"
#include "tests/support/temp_folder.h"

namespace evac {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;

/// A file with a header of the test's own.
std::string WithHeader(const std::string& header, const std::string& data, int version = 1) {
  std::string bytes = "\x93NUMPY";
  bytes += {static_cast<char>(version), '\0', static_cast<char>(header.size() & 0xff),
            static_cast<char>(header.size() >> 8)};
  if (version > 1) bytes += std::string(2, '\0');
  return bytes + header + data;
}

std::string ErrorOf(const std::string& bytes) {
  try {
    ParseNpy(bytes, "bad.npy");
  } catch (const Error& error) {
    EXPECT_EQ(error.exit_code(), ExitCode::kInvalidInput);
    EXPECT_THAT(error.what(), HasSubstr("bad.npy"));
    return error.what();
  }
  return "it was read";
}

TEST(Npy, WhatIsWrittenIsReadInEveryType) {
  const TempFolder folder;
  for (const std::string dtype : {"<f8", "<f4", "<i8", "<i4", "|u1"}) {
    const NpyArray written{dtype, {2, 3}, {0, 1, 2, 3, 100, 255}};
    WriteNpy(folder / "a.npy", written);
    const NpyArray read = ReadNpy(folder / "a.npy");
    EXPECT_EQ(read.dtype, dtype);
    EXPECT_EQ(read.shape, written.shape);
    EXPECT_EQ(read.values, written.values);
    EXPECT_EQ(read.At(1, 2), 255);
  }
}

TEST(Npy, TheFileIsByteForByteWhatNumpyWrites) {
  const std::string bytes = NpyBytes({"<f8", {3}, {1, 2, 3}});
  EXPECT_EQ(bytes.size(), 128u + 24);
  EXPECT_EQ(bytes.substr(10, 60), "{'descr': '<f8', 'fortran_order': False, 'shape': (3,), }   ");
  EXPECT_EQ(bytes[127], '\n');
}

TEST(Npy, ASingleNumberAndAnEmptyArrayAreArrays) {
  EXPECT_THAT(ParseNpy(NpyBytes({"<f8", {}, {7}}), "one").values, ElementsAre(7));
  EXPECT_TRUE(ParseNpy(NpyBytes({"<f8", {0, 16}, {}}), "none").values.empty());
}

TEST(Npy, FortranOrderIsReadAsTheSameMatrix) {
  const std::string data({0, 3, 1, 4, 2, 5});
  const NpyArray read = ParseNpy(WithHeader("{'descr': '|u1', 'fortran_order': True, 'shape': (2, 3), }\n", data), "f");
  EXPECT_THAT(read.values, ElementsAre(0, 1, 2, 3, 4, 5));
}

TEST(Npy, HeadersOfAllThreeFormatsAreRead) {
  for (const int version : {1, 2, 3}) {
    EXPECT_THAT(
        ParseNpy(WithHeader("{'shape': (2,), 'fortran_order': False, 'descr': '|u1'}", "\x01\x02", version), "v")
            .values,
        ElementsAre(1, 2));
  }
}

TEST(Npy, AFileCutOffAnywhereIsRefused) {
  const std::string whole = NpyBytes({"<f4", {2, 2}, {1, 2, 3, 4}});
  for (std::size_t length = 0; length < whole.size(); ++length)
    EXPECT_NE(ErrorOf(whole.substr(0, length)), "it was read") << length;
}

TEST(Npy, AShapeThatLiesIsRefusedBeforeAnythingIsAllocated) {
  for (const std::string shape :
       {"(3,)", "(1, 1)", "(4611686018427387904, 4)", "(18446744073709551615, 18446744073709551615)",
        "(99999999999999999999,)", "(-1,)", "(2305843009213693952, 1)", "(1, 1, 1, 1, 1, 1, 1, 1, 2)"}) {
    EXPECT_NE(ErrorOf(WithHeader("{'descr': '<f8', 'fortran_order': False, 'shape': " + shape + ", }",
                                 std::string(16, '\0'))),
              "it was read")
        << shape;
  }
}

TEST(Npy, OtherTypesAndBrokenHeadersAreRefusedByName) {
  const auto with = [](const std::string& header) { return ErrorOf(WithHeader(header, std::string(8, '\0'))); };
  EXPECT_THAT(with("{'descr': '>f8', 'fortran_order': False, 'shape': (1,), }"), HasSubstr("'>f8', wanted one of"));
  EXPECT_THAT(with("{'descr': '|O', 'fortran_order': False, 'shape': (1,), }"), HasSubstr("'|O'"));
  EXPECT_THAT(with("{'descr': '<f8', 'shape': (1,), }"), HasSubstr("header is broken"));
  EXPECT_THAT(with("{'descr': '<f8', 'fortran_order': False, 'shape': (1,), } os.system()"),
              HasSubstr("header is broken"));
  EXPECT_THAT(ErrorOf("PNG no numpy"), HasSubstr("no .npy file"));
  EXPECT_THAT(ErrorOf(WithHeader("{}", "", 9)), HasSubstr("format 9"));
}

TEST(Npy, AValueThatDoesNotFitItsTypeIsNotWritten) {
  EXPECT_THROW(NpyBytes({"|u1", {1}, {256}}), Error);
  EXPECT_THROW(NpyBytes({"<i4", {1}, {std::nan("")}}), Error);
  EXPECT_THROW(NpyBytes({"<f4", {1}, {1e39}}), Error) << "no infinity instead of it";
  EXPECT_NO_THROW(NpyBytes({"<f4", {2}, {-3.4e38, std::nan("")}}));
  EXPECT_THROW(NpyBytes({"<f8", {2}, {1}}), Error);
}

}  // namespace
}  // namespace evac
