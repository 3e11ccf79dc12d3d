#include "core/in_child.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <csignal>
#include <cstdlib>
#include <filesystem>
#include <stdexcept>

#include "core/error.h"
#include "core/recording_parts.h"

namespace evac {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;

std::string Refusal(const std::function<std::string()>& work) {
  try {
    InChild("a.h5", work);
  } catch (const Error& error) {
    EXPECT_EQ(error.exit_code(), ExitCode::kInvalidInput);
    return error.what();
  }
  return "";
}

TEST(InChild, ReturnsWhatWasReturnedAndChangesNothingElse) {
  int seen = 0;
  const std::string bytes = InChild("a.h5", [&] {
    seen = 1;
    std::string all(3'000'000, '\0');
    all.append("end");
    return all;
  });
  EXPECT_EQ(bytes.size(), 3'000'003U);
  EXPECT_TRUE(bytes.ends_with("end"));
  EXPECT_EQ(seen, 0);
  EXPECT_EQ(InChild("a.h5", [] { return std::string(); }), "");
}

TEST(InChild, SaysWhatWasThrown) {
  EXPECT_EQ(Refusal([]() -> std::string { throw InvalidInput("a.h5: no steps"); }), "a.h5: no steps");
  EXPECT_EQ(Refusal([]() -> std::string { throw std::runtime_error("other"); }), "other");
}

TEST(InChild, AnErrorKeepsItsKindAndItsExitCode) {
  try {
    InChild("a.h5", []() -> std::string { throw InternalError("disk full").Called("no_space"); });
    FAIL();
  } catch (const Error& error) {
    EXPECT_EQ(error.exit_code(), ExitCode::kInternal);
    EXPECT_STREQ(error.kind(), "no_space");
    EXPECT_STREQ(error.what(), "disk full");
  }
}

TEST(InChild, BeingStoppedFromOutsideIsNoFaultOfTheFile) {
  try {
    InChild("a.h5", [] {
      std::raise(SIGKILL);
      return std::string();
    });
    FAIL();
  } catch (const Error& error) {
    EXPECT_EQ(error.exit_code(), ExitCode::kInternal);
    EXPECT_THAT(error.what(), HasSubstr("stopped from outside"));
  }
}

TEST(InChild, ACrashIsARefusal) {
  EXPECT_THAT(Refusal([] {
                std::raise(SIGSEGV);
                return std::string();
              }),
              AllOf(HasSubstr("a.h5: a broken file"), HasSubstr("signal 11")));
  EXPECT_THAT(Refusal([]() -> std::string { std::abort(); }), HasSubstr("signal 6"));
  EXPECT_THAT(Refusal([]() -> std::string { ::_exit(3); }), HasSubstr("a.h5: a broken file"));
}

/// A heap said to lie beyond all memory: HDF5 1.10 copies to nowhere. Found by fuzzing.
TEST(Proprio, AFileThatMakesTheLibraryCrashIsRefused) {
  const std::filesystem::path file =
      std::filesystem::path(EVAC_SOURCE_DIR) / "tests/fuzz/corpus/proprio_fuzz/heap_beyond_memory";
  ASSERT_TRUE(std::filesystem::exists(file));
  try {
    ReadProprio(file);
    FAIL() << "it was read";
  } catch (const Error& error) {
    EXPECT_EQ(error.exit_code(), ExitCode::kInvalidInput);
    EXPECT_THAT(error.what(), HasSubstr("heap_beyond_memory"));
  }
}

}  // namespace
}  // namespace evac
