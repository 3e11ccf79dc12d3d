#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fstream>
#include <nlohmann/json.hpp>

#include "apps/commands.h"
#include "tests/apps/printed.h"
#include "tests/support/temp_folder.h"

namespace evac {
namespace {

using testing::HasSubstr;

class CorrelateOptions : public testing::Test {
 protected:
  CorrelateOptions() {
    std::ofstream(folder_ / "rates.csv") << "group,task,policy,real_sr,sim_sr\n"
                                            ",t,a,0.2,0.5\n,t,b,0.6,0.5\n,t,c,0.8,0.9\n,t,d,0.7,0.95\n";
  }

  std::string Correlate(std::vector<std::string> words) const {
    words.insert(words.begin(), "correlate");
    return Printed(AddCorrelate, words);
  }

  nlohmann::json Group(std::vector<std::string> options) const {
    options.insert(options.begin(), {"--pairs", Csv(), "--json"});
    return nlohmann::json::parse(Correlate(options)).at("groups").at(0);
  }

  std::string Csv() const { return (folder_ / "rates.csv").string(); }

  TempFolder folder_;
};

TEST_F(CorrelateOptions, TheDefaultsAreTheRealGapAndSimplersCode) {
  const auto defaults = Group({});
  EXPECT_EQ(defaults.at("mmrv_convention"), "real_gap,code");
  EXPECT_EQ(defaults, Group({"--mmrv", "real_gap", "--ties", "code"}));
}

TEST_F(CorrelateOptions, EachConventionGivesItsOwnNumber) {
  EXPECT_NEAR(Group({}).at("mmrv").get<double>(), (0.4 + 0.1 + 0.1) / 4, 1e-12);
  EXPECT_NEAR(Group({"--ties", "sign"}).at("mmrv").get<double>(), (0.1 + 0.1) / 4, 1e-12);
  EXPECT_NEAR(Group({"--ties", "leq"}).at("mmrv").get<double>(), (0.4 + 0.1 + 0.1) / 4, 1e-12);
  EXPECT_NEAR(Group({"--mmrv", "sim_gap"}).at("mmrv").get<double>(), (0.05 + 0.05) / 4, 1e-12);
}

TEST_F(CorrelateOptions, WithoutJsonATableIsPrinted) {
  EXPECT_THAT(Correlate({"--pairs", Csv()}), HasSubstr("Pearson"));
}

TEST_F(CorrelateOptions, WrongWordsAndFilesThatAreNotThereAreRefused) {
  EXPECT_THROW(Group({"--ties", "strict"}), Error);
  EXPECT_THROW(Group({"--mmrv", "gap"}), Error);
  EXPECT_THROW(Correlate({}), Error);
  EXPECT_THROW(Correlate({"some/run", "--pairs", Csv()}), Error);
  EXPECT_THROW(Correlate({"--pairs", (folder_ / "missing.csv").string()}), Error);
  EXPECT_THROW(Correlate({(folder_ / "no_run").string()}), Error);
}

}  // namespace
}  // namespace evac
