#include "judges/judge_calibration.h"

#include <gmock/gmock.h>

#include "tests/support/temp_folder.h"

namespace evac {
namespace {

using testing::HasSubstr;
using testing::Not;

/// A run of two tasks in two worlds with verdicts of an oracle and of a judge, one letter an episode: s, f, ?, i.
class Judged {
 public:
  Judged(const std::string& world, const std::string& truth, const std::string& judge, std::size_t states = 1000) {
    Add(world, truth, judge, states);
  }

  /// @param states  of which there are so many, again and again
  Judged& Add(const std::string& world, const std::string& truth, const std::string& judge, std::size_t states = 1000,
              const std::string& task = "take") {
    store_.AddWorld({world, "mujoco", world == "real", ""});
    for (std::size_t i = 0; i < truth.size(); ++i) {
      EpisodeRecord record;
      record.episode.key = {{task, std::to_string(i % states), "policy", "v1", 1 + i / states}, world};
      record.episode.stop = StopReason::kStill;
      store_.Add(record);
      Say("oracle", record.episode.key, truth[i]);
      Say("vlm:x", record.episode.key, judge.at(i));
    }
    return *this;
  }

  Judged& Say(const std::string& judge, const EpisodeKey& key, char letter) {
    const std::map<char, Label> labels = {
        {'s', Label::kSuccess}, {'f', Label::kFailure}, {'?', Label::kCannotTell}, {'i', Label::kInvalid}};
    Verdict verdict;
    verdict.episode_id = key.Id();
    verdict.judge = judge;
    verdict.label = labels.at(letter);
    verdict.probability = letter == 's' ? 0.9 : 0.2;
    store_.AddVerdict(verdict);
    return *this;
  }

  const Store& store() const { return store_; }

 private:
  static Store Made(const std::filesystem::path& folder) {
    Store store = Store::InMemory(
        folder, {.suite_text = "suite: x", .suite_hash = "0", .suite_path = "x.yaml", .evac_version = "0"});
    for (const char* id : {"take", "place"}) {
      Task task;
      task.id = id;
      store.AddTask(task);
    }
    store.AddPolicy({"policy", "v1", "{}"});
    return store;
  }

  TempFolder folder_;
  Store store_ = Made(folder_.path());
};

std::string Times(int times, const std::string& letters) {
  std::string text;
  for (int i = 0; i < times; ++i) text += letters;
  return text;
}

TEST(JudgeCalibration, CountsWhoSaidWhatAndLeavesOutWhatEitherDidNotDecide) {
  const Judged run("real", "sssff?s", "ssfsfsi");
  const JudgeCalibrationReport report = CalibrateJudge(run.store(), "vlm:x", "oracle");
  const JudgeQualityRow& all = report.rows.front();
  EXPECT_EQ(all.confusion.both_success, 2);
  EXPECT_EQ(all.confusion.only_human_success, 1);
  EXPECT_EQ(all.confusion.only_judge_success, 1);
  EXPECT_EQ(all.confusion.both_failure, 1);
  EXPECT_EQ(all.errors, 1);
  EXPECT_EQ(all.cannot_tell, 0);
  EXPECT_NEAR(*all.statistics.sensitivity.value, 2.0 / 3, 1e-12);
  EXPECT_NEAR(*all.calibration.brier.value, (2 * 0.01 + 0.64 + 0.81 + 0.04) / 5, 1e-12);
  std::vector<std::string> groups;
  for (const JudgeQualityRow& row : report.rows) groups.push_back(row.group);
  EXPECT_EQ(groups, (std::vector<std::string>{"all", "task take", "world real", "policy policy@v1"}));
}

TEST(JudgeCalibration, AGoodJudgeIsAccepted) {
  Judged run("real", Times(20, "sf"), Times(20, "sf"));
  run.Add("sim", Times(20, "sf") + "sf", Times(20, "sf") + "fs");
  const JudgeCalibrationReport report = CalibrateJudge(run.store(), "vlm:x", "oracle");
  EXPECT_THAT(report.missing, testing::IsEmpty());
  EXPECT_THAT(report.refusals, testing::IsEmpty());
  EXPECT_THAT(Text(report), HasSubstr("a gate may count this judge"));
}

TEST(JudgeCalibration, ManyClipsOfFewStatesAreNotManyClips) {
  const std::string truth = Times(50, "sf"), judge = Times(45, "sf") + Times(5, "fs");
  const auto low = [&](std::size_t states) {
    return CalibrateJudge(Judged("real", truth, judge, states).store(), "vlm:x", "oracle").rows.front().statistics.kappa;
  };
  EXPECT_EQ(*low(100).value, *low(20).value);
  EXPECT_LT(low(2).interval->low, low(100).interval->low - 0.2) << "Student's t of one degree";
  const JudgeCalibrationReport one = CalibrateJudge(Judged("real", truth, judge, 1).store(), "vlm:x", "oracle");
  EXPECT_THAT(one.missing, testing::ElementsAre(
                               HasSubstr("how far kappa can be believed: all items are of one initial state")));
}

TEST(JudgeCalibration, NeverWrongInOneSceneIsNotNeverWrong) {
  const std::string truth = Times(30, "sf");
  const JudgeCalibrationReport one = CalibrateJudge(Judged("real", truth, truth, 1).store(), "vlm:x", "oracle");
  EXPECT_EQ(*one.rows.front().statistics.kappa.value, 1);
  EXPECT_THAT(one.missing, testing::ElementsAre("how far kappa can be believed: never wrong, but in 1 initial state "
                                                "only, wanted 11"));
  EXPECT_THAT(Text(one), Not(HasSubstr("a gate may count this judge")));
  EXPECT_THAT(CalibrateJudge(Judged("real", truth, truth, 10).store(), "vlm:x", "oracle").missing, testing::SizeIs(1));
  EXPECT_THAT(CalibrateJudge(Judged("real", truth, truth, 12).store(), "vlm:x", "oracle").missing, testing::IsEmpty());
}

TEST(JudgeCalibration, AJudgeThatOnlyReadsTheWorldIsNotAccepted) {
  Judged run("real", Times(30, "s"), Times(30, "s"));
  run.Add("sim", Times(30, "f"), Times(30, "f"));
  const JudgeCalibrationReport report = CalibrateJudge(run.store(), "vlm:x", "oracle");
  EXPECT_EQ(*report.rows.front().statistics.kappa.value, 1);
  EXPECT_THAT(report.missing, testing::ElementsAre(HasSubstr("real clips: no failure among 30, wanted both outcomes"),
                                                   HasSubstr("other clips: no success among 30")));
  EXPECT_THAT(Text(report), Not(HasSubstr("a gate may count this judge")));
}

TEST(JudgeCalibration, AJudgeThatIsKinderToOneWorldIsRefusedThoughItsKappaIsGood) {
  Judged run("real", Times(50, "sf"), Times(50, "sf"));
  run.Add("sim", Times(50, "sf"), Times(40, "sf") + Times(10, "ss"));
  const JudgeCalibrationReport report = CalibrateJudge(run.store(), "vlm:x", "oracle");
  EXPECT_GT(*report.rows.front().statistics.kappa.value, 0.8);
  EXPECT_THAT(report.refusals, testing::ElementsAre(HasSubstr("on other clips its success rate is +10.0 points off"),
                                                    HasSubstr("specificity differs by 20.0 points")));
}

TEST(JudgeCalibration, ErrorsAndChanceAgreementAreRefused) {
  const Judged run("real", Times(50, "sf"), Times(24, "sf") + "ii" + Times(12, "sf") + Times(13, "fs"));
  EXPECT_THAT(CalibrateJudge(run.store(), "vlm:x", "oracle").refusals,
              testing::IsSupersetOf({HasSubstr("kappa is 0.47, wanted at least 0.6")}));
  const Judged errors("real", Times(50, "sf"), Times(48, "sf") + "iiii");
  EXPECT_THAT(CalibrateJudge(errors.store(), "vlm:x", "oracle").refusals,
              testing::ElementsAre(HasSubstr("4 of 100 verdicts are errors")));
}

TEST(JudgeCalibration, TooFewOfOneKindIsNoAnswer) {
  const Judged run("real", Times(70, "s") + Times(5, "f"), Times(70, "s") + Times(5, "f"));
  const JudgeCalibrationReport report = CalibrateJudge(run.store(), "vlm:x", "oracle");
  EXPECT_THAT(report.missing, testing::ElementsAre(HasSubstr("task take: 70 successes and 5 failures")));
  EXPECT_FALSE(CalibrateJudge(run.store(), "vlm:nobody", "oracle").missing.empty());
}

TEST(JudgeCalibration, AJudgeOfClipsOfWhichNobodyKnowsTheOutcomeIsNotAccepted) {
  Judged run("real", Times(50, "sf"), Times(50, "sf"));
  run.Add("dream", Times(20, "??"), Times(20, "sf"));  // the oracle reads no physics there
  const JudgeCalibrationReport report = CalibrateJudge(run.store(), "vlm:x", "oracle");
  EXPECT_THAT(report.missing, testing::ElementsAre(HasSubstr("world dream: the truth tells success or failure of none "
                                                             "of the 40 episodes where the judge does")));
  EXPECT_THAT(Text(report), Not(HasSubstr("a gate may count this judge")));
  Judged silent("real", Times(50, "sf"), Times(50, "sf"));
  silent.Add("dream", "ssff", "????");
  EXPECT_THAT(CalibrateJudge(silent.store(), "vlm:x", "oracle").missing, testing::IsEmpty())
      << "a gate counts nothing of it there";
}

TEST(JudgeCalibration, AWorldThatTheTruthWasNeverAskedAboutIsMissingToo) {
  Judged run("real", Times(50, "sf"), Times(50, "sf"));
  run.Add("sim", Times(20, "sf"), Times(20, "sf"));
  for (int i = 0; i < 100; ++i)
    run.Say("human", {{"take", std::to_string(i), "policy", "v1", 1}, "real"}, "sf"[i % 2]);
  EXPECT_THAT(CalibrateJudge(run.store(), "vlm:x", "human").missing, testing::ElementsAre(HasSubstr("world sim: ")));
}

/// It was accepted for all tasks of a world by what was known of one of them.
TEST(JudgeCalibration, ATaskThatTheTruthWasNeverAskedAboutIsMissingToo) {
  Judged run("real", Times(50, "sf"), Times(50, "sf"));
  run.Add("real", Times(20, "??"), Times(20, "sf"), 1000, "place");
  for (int i = 0; i < 100; ++i)
    run.Say("human", {{"take", std::to_string(i), "policy", "v1", 1}, "real"}, "sf"[i % 2]);
  const JudgeCalibrationReport report = CalibrateJudge(run.store(), "vlm:x", "human");
  EXPECT_THAT(report.missing, testing::ElementsAre("task place: 0 successes and 0 failures, wanted 60 items with 15 of "
                                                   "each"));
  EXPECT_THAT(Text(report), Not(HasSubstr("a gate may count this judge")));
  Judged silent("real", Times(50, "sf"), Times(50, "sf"));
  silent.Add("sim", "ss", "s?").Add("sim", "s", "?", 1000, "place");
  silent.Say("human", {{"take", "0", "policy", "v1", 1}, "sim"}, 's');
  for (int i = 0; i < 100; ++i)
    silent.Say("human", {{"take", std::to_string(i), "policy", "v1", 1}, "real"}, "sf"[i % 2]);
  for (const std::string& sentence : CalibrateJudge(silent.store(), "vlm:x", "human").missing)
    EXPECT_THAT(sentence, Not(HasSubstr("task place"))) << "a gate counts nothing of it there";
}

TEST(JudgeCalibration, ProbesOfAJudgeThatWasShownFewerImagesAreFound) {
  Judged run("real", "ssff", "ssff");
  for (int i = 0; i < 4; ++i) {
    const EpisodeKey key = {{"take", std::to_string(i), "policy", "v1", 1}, "real"};
    run.Say("vlm:x:small", key, "ssff"[i]).Say("vlm:x:flip:small", key, "sfff"[i]);
    run.Say("vlm:x:flip", key, 's').Say("vlm:x:retest:small", key, "ssff"[i]);
  }
  const auto probes = CalibrateJudge(run.store(), "vlm:x:small", "oracle").probes;
  ASSERT_EQ(probes.size(), 2u);
  EXPECT_EQ(probes.at("flip").same.successes, 3) << "not the probe of the judge that was shown more";
  EXPECT_EQ(probes.at("flip").same.trials, 4);
  EXPECT_EQ(probes.at("retest").same.successes, 4);
}

TEST(JudgeCalibration, ProbesAreComparedWithTheJudgeItself) {
  Judged run("real", "ssff", "ssff");
  for (int i = 0; i < 4; ++i)
    run.Say("vlm:x:flip", {{"take", std::to_string(i), "policy", "v1", 1}, "real"}, "ss?s"[i]);
  const auto probes = CalibrateJudge(run.store(), "vlm:x", "oracle").probes;
  EXPECT_EQ(probes.size(), 1u);
  EXPECT_EQ(probes.at("flip").same.successes, 2);
  EXPECT_EQ(probes.at("flip").same.trials, 3);
}

TEST(JudgeCalibration, ProbesOfManyClipsOfFewStatesKnowFewStates) {
  Judged run("real", Times(40, "s"), Times(40, "s"), 4);
  for (const Episode& episode : run.store().Episodes()) {
    const bool is_odd_scene = episode.key.pair.initial_state == "0";
    run.Say("vlm:x:retest", episode.key, is_odd_scene ? 'f' : 's');
  }
  const ProbeAgreement retest = CalibrateJudge(run.store(), "vlm:x", "oracle").probes.at("retest");
  EXPECT_EQ(retest.same.trials, 40);
  EXPECT_NEAR(*retest.share.value, 0.75, 1e-12);
  EXPECT_LT(retest.share.interval->low, WilsonInterval(3, 4).interval->low + 0.05) << "four scenes, one of them odd";
}

}  // namespace
}  // namespace evac
