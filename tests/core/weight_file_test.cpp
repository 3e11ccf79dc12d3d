#include "core/weight_file.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <array>
#include <fstream>
#include <limits>

#include "core/error.h"
#include "tests/support/temp_folder.h"

namespace evac {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;
using testing::ThrowsMessage;

class WeightFileTest : public testing::Test {
 protected:
  std::filesystem::path Written(const TensorMetadata& card, const std::array<float, 2>& numbers = {1.5F, -2}) const {
    TensorView view{{"out.bias", TensorType::kF32, {2}}, std::as_bytes(std::span(numbers))};
    WriteTensorFile(folder_ / "w.safetensors", {&view, 1}, card);
    return folder_ / "w.safetensors";
  }
  const TempFolder folder_;
};

TEST_F(WeightFileTest, GivesWhatTheCardAndTheTensorsSay) {
  WeightFile file(Written({{"format", "evac-x 1"}, {"tasks", "a,b"}, {"threshold", "0.25"}, {"frames", "8"}}),
                  "evac-x 1");
  EXPECT_THAT(file.Names("tasks"), ElementsAre("a", "b"));
  EXPECT_EQ(file.Number("threshold"), 0.25);
  EXPECT_EQ(file.Whole("frames", 1, 8), 8);
  EXPECT_EQ(reinterpret_cast<const float*>(file.Take("out.bias", {2}).bytes.data())[1], -2);
  EXPECT_NO_THROW(file.RequireAllTaken());
}

TEST_F(WeightFileTest, WeightsOfSomethingElseAreRefusedWithWhatTheyAre) {
  EXPECT_THAT(
      [&] {
        WeightFile(Written({{"format", "evac-y 1"}}), "evac-x 1");
      },
      ThrowsMessage<Error>(HasSubstr("w.safetensors: the weights are of format 'evac-y 1', wanted 'evac-x 1'")));
  EXPECT_THAT([&] { WeightFile(Written({}), "evac-x 1"); },
              ThrowsMessage<Error>(HasSubstr("nothing that says what it is")));
  EXPECT_THROW(WeightFile(folder_ / "none.safetensors", "evac-x 1"), Error);
}

TEST_F(WeightFileTest, AFileThatIsNoneIsTheUsersErrorAndNamed) {
  std::ofstream(folder_ / "text.safetensors") << "hello";
  EXPECT_THAT([&] { WeightFile(folder_ / "text.safetensors", "evac-x 1"); },
              ThrowsMessage<Error>(HasSubstr("text.safetensors")));
}

TEST_F(WeightFileTest, TensorsThatAreMissingMisshapenOrUnreadAreRefused) {
  WeightFile file(Written({{"format", "evac-x 1"}}), "evac-x 1");
  EXPECT_THAT([&] { file.Take("in.bias", {2}); }, ThrowsMessage<Error>(HasSubstr("there is no tensor 'in.bias'")));
  EXPECT_THAT(
      [&] {
        file.Take("out.bias", {3, 1});
      },
      ThrowsMessage<Error>(HasSubstr("out.bias is F32 [2], wanted F32 [3, 1]")));
  EXPECT_THAT([&] { file.RequireAllTaken(); }, ThrowsMessage<Error>(HasSubstr("nothing reads tensor 'out.bias'")));
}

TEST_F(WeightFileTest, NumbersThatAreNotFiniteAreRefusedWithTheTensorAndThePlace) {
  const auto taking = [&](float second) {
    WeightFile(Written({{"format", "evac-x 1"}}, {1.5F, second}), "evac-x 1").Take("out.bias", {2});
  };
  EXPECT_THAT([&] { taking(std::numeric_limits<float>::quiet_NaN()); },
              ThrowsMessage<Error>(HasSubstr("w.safetensors: out.bias: number 1 is nan, wanted a finite one")));
  EXPECT_THAT([&] { taking(-std::numeric_limits<float>::infinity()); },
              ThrowsMessage<Error>(HasSubstr("out.bias: number 1 is -inf")));
  EXPECT_NO_THROW(taking(std::numeric_limits<float>::max()));
}

TEST_F(WeightFileTest, CardFieldsAreCheckedByName) {
  const WeightFile file(
      Written({{"format", "evac-x 1"}, {"tasks", "a,,b"}, {"twice", "a,a"}, {"threshold", "half"}, {"frames", "2.5"}}),
      "evac-x 1");
  EXPECT_THAT([&] { file.Text("seed"); }, ThrowsMessage<Error>(HasSubstr("the card has no field 'seed'")));
  EXPECT_THAT([&] { file.Names("tasks"); }, ThrowsMessage<Error>(HasSubstr("card field 'tasks': found 'a,,b'")));
  EXPECT_THROW(file.Names("twice"), Error);
  EXPECT_THAT([&] { file.Number("threshold"); }, ThrowsMessage<Error>(HasSubstr("found 'half', wanted a number")));
  EXPECT_THAT([&] { file.Whole("frames", 1, 8); }, ThrowsMessage<Error>(HasSubstr("wanted a whole number in 1 … 8")));
}

}  // namespace
}  // namespace evac
