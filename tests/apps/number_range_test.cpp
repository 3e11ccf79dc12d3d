#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "apps/command_rate.h"
#include "apps/number_range.h"
#include "tests/apps/printed.h"
#include "tests/support/temp_folder.h"

namespace evac {
namespace {

using testing::HasSubstr;
using Words = std::vector<std::string>;

TEST(Within, TakesTheNumbersFromTheFirstToTheLastAndNothingElse) {
  const CLI::Validator share = Within(0, 1);
  for (const char* word : {"0", "1", "0.5", ".5", "1e-3"}) EXPECT_EQ(share(std::string(word)), "") << word;
  for (const char* word : {"nan", "NAN", "-nan", "inf", "-inf", "2", "-0.1", "", "half", "0.5x"})
    EXPECT_NE(share(std::string(word)), "") << word;
  EXPECT_EQ(share.get_description(), "FLOAT in [0 - 1]");
}

/// It passed every range, being neither below nor above anything.
TEST(Within, WhatIsNoNumberIsRefusedByTheNameOfTheOption) {
  const TempFolder folder;
  const Words pack = {"pack", "nosuch", "--config", "nosuch.yaml", "--out", "nosuch"};
  const Words imagine = {"imagine", "--out", "nosuch"};
  const std::tuple<void (*)(CLI::App&, ExitCode&), Words, const char*> options[] = {
      {AddRate, {"rate", "serve", "nostudy"}, "--cover"},
      {AddPack, pack, "--period-s"},
      {AddPack, pack, "--holdout"},
      {AddPack, pack, "--shard-mb"},
      {AddImagine, imagine, "--eta"},
      {AddImagine, imagine, "--cfg"},
      {AddImagine, imagine, "--cfg-rescale"},
      {AddTrain, {"train", "codec", folder.path().string(), "--config", EVAC_SOURCE_DIR "/apps/configs/desk_model.yaml",
                  "--out", "nosuch"}, "--minutes"}};
  for (const auto& [add, words, option] : options) {
    for (const char* found : {"nan", "inf", "-1"}) {
      Words all = words;
      all.push_back(std::string(option) + "=" + found);
      try {
        Printed(add, all);
        ADD_FAILURE() << option << " " << found;
      } catch (const CLI::ParseError& error) {  // main ends with 2 then
        EXPECT_NE(error.get_exit_code(), 0);
        EXPECT_THAT(error.what(), HasSubstr(std::string(option) + ":"));
      }
    }
  }
}

}  // namespace
}  // namespace evac
