#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fstream>
#include <nlohmann/json.hpp>

#include "apps/commands.h"
#include "core/file.h"
#include "core/store.h"
#include "tests/core/store_samples.h"
#include "tests/apps/printed.h"
#include "tests/support/temp_folder.h"

namespace evac {
namespace {

using namespace samples;
using testing::HasSubstr;

/// A run with two checkpoints in two worlds: "good" always succeeds, "poor" never, and sim agrees with real.
class Deciding : public testing::Test {
 protected:
  Deciding() {
    Store store = Store::CreateOrContinue(Run(), SomeRun());
    Declare(store);
    store.AddPolicy({"visual_pick", "poor", "{}"});
    for (int state = 0; state < 10; ++state) {
      for (const char* checkpoint : {"good", "poor"}) {
        for (const char* world : {"real", "sim"}) Add(store, state, checkpoint, world);
      }
    }
  }

  static void Add(Store& store, int state, const std::string& checkpoint, const std::string& world) {
    EpisodeKey key = Key(1, world);
    key.pair.initial_state = "41-000" + std::to_string(state);
    key.pair.checkpoint = checkpoint;
    EpisodeRecord record;
    record.episode.key = key;
    record.episode.stop = StopReason::kStill;
    store.Add(record);
    Verdict verdict;
    verdict.episode_id = key.Id();
    verdict.judge = "oracle";
    verdict.label = checkpoint == "good" ? Label::kSuccess : Label::kFailure;
    store.AddVerdict(verdict);
  }

  std::string Run() const { return (folder_ / "run").string(); }

  std::string Compare(std::vector<std::string> options) const {
    options.insert(options.begin(), {"compare", "visual_pick@good", "visual_pick@poor", "--run", Run()});
    return Printed(AddCompare, options);
  }

  std::string Csv(const std::string& rows) const {
    const std::filesystem::path file = folder_ / "trials.csv";
    std::ofstream(file) << "task,initial_state,policy,checkpoint,outcome,video\n" << rows;
    return file.string();
  }

  const TempFolder folder_;
};

TEST_F(Deciding, CompareNamesTheBetterPolicyInEveryWorld) {
  const std::string text = Compare({});
  EXPECT_THAT(text, HasSubstr("World real, judge oracle. visual_pick@good is better"));
  EXPECT_THAT(text, HasSubstr("World sim, judge oracle. visual_pick@good is better"));
  const auto json = nlohmann::json::parse(Compare({"--world", "sim", "--json"}));
  ASSERT_EQ(json.at("worlds").size(), 1u);
  EXPECT_EQ(json.at("worlds").at(0).at("winner"), "first");
}

TEST_F(Deciding, ComparedRunsMayBeFoldersOfTheirOwn) {
  const std::string a = Run() + ":visual_pick@good", b = Run() + ":visual_pick@poor";
  EXPECT_THAT(Printed(AddCompare, {"compare", a, b, "--world", "sim"}), HasSubstr("visual_pick@good is better"));
  EXPECT_THROW(Printed(AddCompare, {"compare", a, a}), Error) << "against itself";
  EXPECT_THROW(Printed(AddCompare, {"compare", Run(), b}), Error) << "a run with several policies";
  EXPECT_THROW(Printed(AddCompare, {"compare", "visual_pick@good", b}), Error) << "no folder";
  EXPECT_THROW(Printed(AddCompare, {"compare", a, b, "--run", "elsewhere"}), Error) << "nobody is looked for there";
  EXPECT_NO_THROW(Printed(AddCompare, {"compare", a, "visual_pick@poor", "--run", Run()}));
  EXPECT_THROW(Compare({"--world", "moon"}), Error);
  EXPECT_THROW(Compare({"--judge", "nobody"}), Error);
}

TEST_F(Deciding, WhereTheJudgeToldNothingThoseWhoDidAreNamed) {
  {
    Store store = Store::Open(Run(), Store::Mode::kReadWrite);
    store.AddWorld({"dream", "evac", false, "d4e"});
    for (const char* checkpoint : {"good", "poor"}) {
      EpisodeRecord record;
      record.episode.key = Key(1, "dream");
      record.episode.key.pair.checkpoint = checkpoint;
      record.episode.stop = StopReason::kStill;
      store.Add(record);
      for (const char* judge : {"oracle", "classifier:abc", "human:study:r1"}) {
        Verdict verdict;
        verdict.episode_id = record.episode.key.Id();
        verdict.judge = judge;
        verdict.label = judge == std::string("oracle") ? Label::kCannotTell : Label::kSuccess;
        store.AddVerdict(verdict);
      }
    }
  }
  EXPECT_THAT(Compare({"--world", "dream"}),
              HasSubstr("Judge oracle told no outcome in dream; --judge classifier:abc did.\n"));
  EXPECT_THAT(Compare({"--world", "sim"}), testing::Not(HasSubstr("told no outcome")));
  const auto json = nlohmann::json::parse(Compare({"--world", "dream", "--json"}));
  EXPECT_EQ(json.at("worlds").at(0).at("other_judges"), nlohmann::json({"classifier:abc"}));
}

TEST_F(Deciding, SequentialLooksAreKeptAndTheSameDataAreNoNewLook) {
  Compare({"--world", "sim", "--sequential"});
  const auto again = nlohmann::json::parse(Compare({"--world", "sim", "--sequential", "--json"}));
  const auto bet = again.at("worlds").at(0).at("sequential").at(0);
  EXPECT_EQ(bet.at("looks"), 1);
  EXPECT_GT(bet.at("e_value").get<double>(), 20);
  EXPECT_EQ(Store::Open(Run(), Store::Mode::kReadOnly).Looks().size(), 1u);
}

TEST_F(Deciding, ImportedTrialsAreWhatAWorldIsHeldAgainst) {
  EXPECT_THAT(Printed(AddTrust, {"trust", Run()}), HasSubstr("Held against the world real"));
  std::ofstream(folder_ / "clip.mp4") << "video";
  const std::string csv =
      Csv("take_bottle,41-0000,visual_pick,good,success,clip.mp4\n"
          "take_bottle,41-0001,visual_pick,good,failure,\n");
  EXPECT_THAT(Printed(AddImportReal, {"import-real", csv, "--run", Run()}), HasSubstr("2 real trials imported"));
  EXPECT_THAT(Printed(AddImportReal, {"import-real", csv, "--run", Run()}), HasSubstr("2 there already"));
  const Store store = Store::Open(Run(), Store::Mode::kReadOnly);
  ASSERT_EQ(store.RealTrials().size(), 2u);
  EXPECT_TRUE(std::filesystem::is_regular_file(store.folder() / store.RealTrials()[0].video));
  const auto task =
      nlohmann::json::parse(Printed(AddTrust, {"trust", Run(), "--json"})).at("worlds").at(0).at("tasks").at(0);
  EXPECT_EQ(task.at("n"), 2);
  EXPECT_EQ(task.at("pairs").at("model_only"), 1);
  EXPECT_EQ(task.at("policies").at(0).at("further_imagined").at("trials"), 8);
}

/// By its name alone tuesday's file was monday's: repeats that ended alike were "there already".
TEST_F(Deciding, TwoDaysTablesOfOneNameAreTwoFiles) {
  const std::string header = "task,initial_state,policy,checkpoint,outcome\n",
                    row = "take_bottle,41-0000,visual_pick,good,success\n";
  for (const char* day : {"mon", "tue"}) {
    std::filesystem::create_directory(folder_ / day);
    std::ofstream(folder_ / day / "trials.csv") << header << row;
  }
  const auto brought = [&](const std::filesystem::path& file) {
    return Printed(AddImportReal, {"import-real", file.string(), "--run", Run()});
  };
  EXPECT_THAT(brought(folder_ / "mon/trials.csv"), HasSubstr("1 real trial imported"));
  EXPECT_THAT([&] { brought(folder_ / "tue/trials.csv"); },
              testing::ThrowsMessage<Error>(testing::AllOf(HasSubstr("tue/trials.csv:2: found no number of the trial"),
                                                           HasSubstr("mon/trials.csv:2"))));
  std::ofstream(folder_ / "mon/trials.csv", std::ios::app) << "take_bottle,41-0001,visual_pick,good,failure\n";
  const std::filesystem::path by_another_way = folder_ / "tue/../mon/trials.csv";
  EXPECT_THAT(brought(by_another_way), HasSubstr("1 real trial imported, on 1 initial state; 1 there already"));
  EXPECT_THAT(brought(std::filesystem::relative(folder_ / "mon/trials.csv")), HasSubstr("2 there already"));
  std::ofstream(folder_ / "tue/trials.csv") << "task,initial_state,policy,checkpoint,outcome,trial\n"
                                            << "take_bottle,41-0000,visual_pick,good,success,2\n";
  EXPECT_THAT(brought(folder_ / "tue/trials.csv"), HasSubstr("1 real trial imported"));
}

/// Those that nobody could tell the outcome of were counted among what a world was held against.
TEST_F(Deciding, ImportedTrialsWithoutAnOutcomeAreNotAmongThoseThatAWorldIsHeldAgainst) {
  Printed(AddImportReal, {"import-real",
                          Csv("take_bottle,41-0000,visual_pick,good,success,\n"
                              "take_bottle,41-0001,visual_pick,good,cannot_tell,\n"
                              "take_bottle,41-0002,visual_pick,good,invalid,\n"),
                          "--run", Run()});
  EXPECT_THAT(Printed(AddTrust, {"trust", Run()}),
              HasSubstr("Held against 1 imported real trial (2 more without an outcome); judge oracle."));
}

/// "No imagined episode is judged", whoever had judged them.
TEST_F(Deciding, AJudgeThatTheRunHasNotIsRefusedWithThoseThatItHas) {
  try {
    Printed(AddTrust, {"trust", Run(), "--judge", "orakel"});
    ADD_FAILURE() << "it was taken";
  } catch (const Error& error) {
    EXPECT_EQ(error.exit_code(), ExitCode::kInvalidInput);
    EXPECT_THAT(error.what(), HasSubstr("--judge: found 'orakel', wanted one who has judged " + Run() + ": oracle"));
  }
}

/// "No verdict of judge 'oracle', found: " with nothing behind it; "no real trial is a success or a failure".
TEST_F(Deciding, OfARunThatNobodyJudgedItIsSaidWhoDoes) {
  const std::string run = (folder_ / "unjudged").string();
  {
    Store store = Store::CreateOrContinue(run, SomeRun());
    Declare(store);
    EpisodeRecord record;
    record.episode.key = Key(1, "sim");
    record.episode.stop = StopReason::kStill;
    store.Add(record);
  }
  const auto message = testing::ThrowsMessage<Error>(
      HasSubstr(run + ": judge oracle: found no verdicts at all, wanted those that `evac judge` gives"));
  EXPECT_THAT([&] { Printed(AddTrust, {"trust", run}); }, message);
  EXPECT_THAT([&] { Printed(AddCompare, {"compare", "visual_pick@good", "visual_pick@poor", "--run", run}); }, message);
}

TEST_F(Deciding, AWorldThatNobodyJudgedIsNamedAndTakesNoTrustFromTheOthers) {
  Store::Open(Run(), Store::Mode::kReadWrite).AddWorld({"dream", "evac", false, "d4e"});
  const std::string text = Printed(AddTrust, {"trust", Run()});
  EXPECT_THAT(text, HasSubstr("May sim be trusted? Held against the world real"));
  EXPECT_THAT(text, HasSubstr("May dream be trusted? Nothing can be said: no imagined episode is judged"));
  const auto json = nlohmann::json::parse(Printed(AddTrust, {"trust", Run(), "--json"}));
  ASSERT_EQ(json.at("worlds").size(), 1u);
  EXPECT_EQ(json.at("unsaid").at(0).at("world"), "dream");
  EXPECT_THROW(Printed(AddTrust, {"trust", Run(), "--world", "dream"}), Error) << "nothing is left to say";
}

TEST_F(Deciding, AWrongFileImportsNothing) {
  EXPECT_THROW(Printed(AddImportReal, {"import-real", Csv("take_bottle,41-0000,visual_pick,good,success,missing.mp4\n"),
                                     "--run", Run()}),
               Error);
  EXPECT_THROW(Printed(AddImportReal, {"import-real",
                                     Csv("take_bottle,41-0000,visual_pick,good,success,\n"
                                         "take_bottle,41-0000,visual_pick,good,perhaps,\n"),
                                     "--run", Run()}),
               Error);
  EXPECT_TRUE(Store::Open(Run(), Store::Mode::kReadOnly).RealTrials().empty());
}

TEST_F(Deciding, AJudgeIsHeldAgainstAnotherAndBothHaveJudged) {
  for (const auto& [judge, truth, words] : {std::tuple("oracle", "oracle", "'oracle' against itself"),
                                            {"orakel", "oracle", "--judge: found 'orakel', wanted one who has judged"},
                                            {"oracle", "human", "--against: found 'human', wanted one who has judged"}}) {
    try {
      Printed(AddJudge, {"judge", "calibrate", Run(), "--judge", judge, "--against", truth});
      ADD_FAILURE() << "wanted an error for " << judge << " against " << truth;
    } catch (const Error& error) {
      EXPECT_EQ(error.exit_code(), ExitCode::kInvalidInput);
      EXPECT_THAT(error.what(), HasSubstr(words));
    }
  }
}

TEST_F(Deciding, ADashboardOfAJudgeWhoJudgedNoRunIsRefused) {
  const std::string soon = (folder_ / "soon").string();
  EXPECT_THAT([&] { Printed(AddDashboard, {"dashboard", Run(), soon, "--judge", "orakel", "--port", "0"}); },
              testing::ThrowsMessage<Error>(
                  HasSubstr("--judge: found 'orakel', wanted one who has judged any of the runs: oracle")));
}

TEST_F(Deciding, APlanNeedsNoRun) {
  EXPECT_THAT(Printed(AddPlan, {"plan", "--rate", "0.28", "--difference", "0.08"}), HasSubstr("533 episodes of each"));
  EXPECT_EQ(nlohmann::json::parse(Printed(AddPlan, {"plan", "--json"})).at("options").at("trials"), 40);
  EXPECT_THROW(Printed(AddPlan, {"plan", "--rate", "2"}), Error);
}

TEST_F(Deciding, AReportLeavesNoChartOfAnEarlierOneAndEveryFileOfOthers) {
  Printed(AddReport, {"report", Run()});
  const std::filesystem::path charts = folder_ / "run/report/charts";
  const std::string chart = ReadFile(charts / "rates-take_bottle.svg");
  EXPECT_THAT(chart, HasSubstr(">judge oracle</text>"));
  WriteFileAtomically(charts / "stages-take_bottle-gone.svg", chart);
  WriteFileAtomically(charts / "stages-take_bottle-gone.png", "png");
  WriteFileAtomically(charts / "rates-mine.svg", "<svg xmlns=\"http://www.w3.org/2000/svg\"/>");
  WriteFileAtomically(charts / "rates-mine.png", "png");
  WriteFileAtomically(charts / "for the paper.svg", chart);
  Printed(AddReport, {"report", Run()});
  for (const char* gone : {"stages-take_bottle-gone.svg", "stages-take_bottle-gone.png"})
    EXPECT_FALSE(std::filesystem::exists(charts / gone)) << gone;
  for (const char* there : {"rates-mine.svg", "rates-mine.png", "for the paper.svg", "rates-take_bottle.svg",
                            "rates-take_bottle.png"})
    EXPECT_TRUE(std::filesystem::exists(charts / there)) << there;
}

}  // namespace
}  // namespace evac
