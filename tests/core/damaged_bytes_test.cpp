// What the fuzzer found in parsers of outside bytes (docs/fuzzing.md), each as a test.
#include <gmock/gmock.h>

#include <filesystem>

#include "core/error.h"
#include "core/recording_parts.h"
#include "core/store_codec.h"

namespace evac {
namespace {

using testing::HasSubstr;

const std::filesystem::path kCorpus = std::filesystem::path(EVAC_SOURCE_DIR) / "tests/fuzz/corpus";

template <typename Action>
std::string MessageOf(Action action) {
  try {
    action();
  } catch (const Error& error) {
    return error.what();
  }
  return "no error";
}

TEST(DamagedBytes, ADataSetThatHoldsLessThanItDeclaresIsRefusedBeforeItIsRead) {
  EXPECT_THAT(MessageOf([] { ReadProprio(kCorpus / "proprio_fuzz/less_than_declared"); }), HasSubstr("holds fewer"));
}

TEST(DamagedBytes, ACountBeyondAnIntegerIsDamageAndNoNumber) {
  std::string text = codec::EncodeTask({});
  const std::string before = "\"max_chunks\":";
  const std::size_t at = text.find(before) + before.size();
  text.replace(at, text.find(',', at) - at, "8.1e87");
  EXPECT_THAT(MessageOf([&] { codec::DecodeTask(text); }), HasSubstr("8.1e+87 is no count"));
}

/// The message showed all of it, and what writes JSON calls itself at every bracket: the process crashed.
TEST(DamagedBytes, AMillionBracketsWhereACountShouldBeAreDamageToo) {
  std::string text = codec::EncodeTask({});
  const std::string before = "\"max_chunks\":";
  const std::size_t at = text.find(before) + before.size();
  text.replace(at, text.find(',', at) - at, std::string(1'000'000, '[') + std::string(1'000'000, ']'));
  EXPECT_THAT(MessageOf([&] { codec::DecodeTask(text); }), HasSubstr("more than 32 deep"));
}

}  // namespace
}  // namespace evac
