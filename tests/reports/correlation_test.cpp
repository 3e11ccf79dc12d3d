#include "reports/correlation.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "core/error.h"
#include "core/seed.h"
#include "reports/correlation_output.h"
#include "reports/pairs_csv.h"
#include "reports/run_correlation.h"
#include "tests/support/temp_folder.h"

namespace evac {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::SizeIs;

const std::string kHeader = "group,task,policy,real_sr,sim_sr\n";

std::string MessageOf(const std::string& csv) {
  try {
    ReadPairsCsv(csv, "rates.csv");
  } catch (const Error& error) {
    EXPECT_EQ(error.exit_code(), ExitCode::kInvalidInput);
    return error.what();
  }
  return "accepted";
}

std::vector<CorrelationGroup> GroupsOf(const std::string& rows) {
  return CorrelatePoints(ReadPairsCsv(kHeader + rows, "rates.csv").points);
}

// --- the file --------------------------------------------------------------------------------------------------------

TEST(PairsCsv, ReadsColumnsInAnyOrderAndKeepsRepeatedKeys) {
  const PairsCsv csv = ReadPairsCsv("sim_sr,policy,real_sr,task,group\n.5,a,0.25,t,g\n.5,a,0.25,t,g\n", "rates.csv");
  ASSERT_THAT(csv.points, SizeIs(2));
  EXPECT_EQ(csv.points[0].group, "g");
  EXPECT_EQ(csv.points[0].task, "t");
  EXPECT_EQ(csv.points[0].policy, "a");
  EXPECT_EQ(csv.points[0].real_sr, 0.25);
  EXPECT_EQ(csv.points[1].sim_sr, 0.5);
  EXPECT_THAT(csv.warnings, IsEmpty());
}

TEST(PairsCsv, UnderstandsWhatSpreadsheetsWrite) {
  const PairsCsv csv = ReadPairsCsv(
      "\xEF\xBB\xBFgroup, task ,policy,real_sr,sim_sr\r\n"
      "\"a, b\",\"say \"\"go\"\"\",\"two\nlines\", 1e-1 ,+0.5\r\n\r\n,t,p,1,0",
      "rates.csv");
  ASSERT_THAT(csv.points, SizeIs(2));
  EXPECT_EQ(csv.points[0].group, "a, b");
  EXPECT_EQ(csv.points[0].task, "say \"go\"");
  EXPECT_EQ(csv.points[0].policy, "two\nlines");
  EXPECT_EQ(csv.points[0].real_sr, 0.1);
  EXPECT_EQ(csv.points[0].sim_sr, 0.5);
  EXPECT_EQ(csv.points[1].group, "all");
}

TEST(PairsCsv, TakesAnyFiniteNumberAndWarnsOutsideZeroToOne) {
  const PairsCsv csv = ReadPairsCsv(kHeader + "g,t,a,85,0.5\ng,t,b,-0.1,1e-400\n", "rates.csv");
  EXPECT_EQ(csv.points[0].real_sr, 85);
  EXPECT_EQ(csv.points[1].real_sr, -0.1);
  EXPECT_EQ(csv.points[1].sim_sr, 0);
  EXPECT_THAT(csv.warnings, ElementsAre("rates.csv:2: column real_sr is 85, a rate is in [0, 1]; used as it is",
                                        "rates.csv:3: column real_sr is -0.1, a rate is in [0, 1]; used as it is"));
}

TEST(PairsCsv, NamesColumnsNobodyReads) {
  const PairsCsv csv = ReadPairsCsv("group,task,policy,real_sr,sim_sr,real_n\ng,t,p,0,1,25\n", "rates.csv");
  EXPECT_THAT(csv.warnings, ElementsAre("rates.csv:1: column \"real_n\" is not read"));
}

TEST(PairsCsv, ABadCellIsNamedByFileLineAndColumnWithWhatWasFoundAndWanted) {
  EXPECT_EQ(MessageOf(kHeader + "g,t,a,0.5,0.5\ng,t,b,0.5,high\n"),
            "rates.csv:3: column sim_sr: found \"high\", wanted a finite number such as 0.85");
  EXPECT_EQ(MessageOf(kHeader + "\"a\nb\",t,a,0.5,0.5\ng,t,b,,1\n"),
            "rates.csv:4: column real_sr: found \"\", wanted a finite number such as 0.85");
  for (const char* no_number : {"nan", "inf", "-inf", "1e999", "0x1p3", "0.5 0.6", "85%", "0,5\"", "+-1", "--1", "."}) {
    EXPECT_THAT(MessageOf(kHeader + "g,t,a,\"" + no_number + "\",0.5\n"), HasSubstr("rates.csv:2: column "))
        << no_number;
  }
}

TEST(PairsCsv, ABadShapeIsNamedToo) {
  EXPECT_EQ(MessageOf(""), "rates.csv:1: found an empty file, wanted a header: group,task,policy,real_sr,sim_sr");
  EXPECT_EQ(MessageOf("group;task\n"),
            "rates.csv:1: column group: found it not in the header \"group;task\", wanted once: "
            "group,task,policy,real_sr,sim_sr");
  EXPECT_THAT(MessageOf("group,group,task,policy,real_sr,sim_sr\n"),
              HasSubstr("column group: found it more than once"));
  EXPECT_EQ(MessageOf(kHeader), "rates.csv:1: found no row after the header, wanted at least one point");
  EXPECT_EQ(MessageOf(kHeader + "g,t,p,0.5\n"),
            "rates.csv:2: column sim_sr: found 4 cells, wanted 5, as in the header");
  EXPECT_EQ(MessageOf(kHeader + "g,t,p,0,5,0,6\n"), "rates.csv:2: column 6: found 7 cells, wanted 5, as in the header");
  EXPECT_EQ(MessageOf(kHeader + "g,\"t,p,0,1\n"),
            "rates.csv:2: column 2: found a quote that is never closed, wanted a closing \"");
  EXPECT_EQ(MessageOf(kHeader + "g,\"t\"x,p,0,1\n"),
            "rates.csv:2: column 2: found \"x\" after the closing quote, wanted a comma or the end of the line");
}

// --- points of which only the rates are known ------------------------------------------------------------------------

TEST(Correlation, KeepsGroupsApartInTheOrderInWhichTheyAppear) {
  const auto groups = GroupsOf("b,t,1,0,0\na,t,1,0,1\nb,t,2,.5,.5\na,t,2,.5,.5\nb,t,3,1,1\na,t,3,1,0\n");
  ASSERT_THAT(groups, SizeIs(2));
  EXPECT_EQ(groups[0].group, "b");
  EXPECT_EQ(*groups[0].pearson.value, 1);
  EXPECT_EQ(*groups[1].pearson.value, -1);
  EXPECT_EQ(*groups[0].mmrv.value, 0);
  EXPECT_NEAR(*groups[1].mmrv.value, (1 + 0.5 + 1) / 3, 1e-12);
}

TEST(Correlation, WhatIsUndefinedHasAReasonAndIsNeverZeroOrOne) {
  EXPECT_EQ(GroupsOf("g,t,1,.5,.1\n")[0].pearson.value.reason(), "1 point, wanted at least 3");
  EXPECT_EQ(GroupsOf("g,t,1,.5,.1\n")[0].mmrv.value.reason(), "1 point, wanted at least 2");
  EXPECT_EQ(GroupsOf("g,t,1,.5,.1\n")[0].ranks.over_range.reason(), "1 point, wanted at least 2");
  const auto two = GroupsOf("g,t,1,.5,.1\ng,t,2,.6,.3\n");
  EXPECT_EQ(two[0].pearson.value.reason(), "2 points, wanted at least 3");
  EXPECT_EQ(two[0].spearman.interval.reason(), "2 points, wanted at least 3");
  EXPECT_EQ(*two[0].mmrv.value, 0);  // two policies can be ranked rightly or wrongly
  const auto constant = GroupsOf("g,t,1,.1,.1\ng,t,2,.1,.2\ng,t,3,.1,.3\n");
  EXPECT_EQ(constant[0].pearson.value.reason(), "all real rates are equal (0.1)");
  EXPECT_EQ(constant[0].kendall_tau_b.reason(), "all real rates are equal (0.1)");
  EXPECT_EQ(constant[0].ranks.over_range.reason(), "all real rates are equal");
  EXPECT_EQ(GroupsOf("g,t,1,0,.5\ng,t,2,1,.5\ng,t,3,1,.5\n")[0].spearman.value.reason(),
            "all sim rates are equal (0.5)");
}

TEST(CorrelationJson, WritesNullBesideTheReasonAndNamesTheConvention) {
  const auto json = nlohmann::json::parse(CorrelationJson(GroupsOf("g,t,1,.1,.1\ng,t,2,.1,.2\ng,t,3,.1,.3\n")));
  const auto& group = json.at("groups").at(0);
  EXPECT_EQ(group.at("group"), "g");
  EXPECT_EQ(group.at("n"), 3);
  EXPECT_TRUE(group.at("pearson").is_null());
  EXPECT_EQ(group.at("pearson_reason"), "all real rates are equal (0.1)");
  EXPECT_TRUE(group.at("pearson_ci95").is_null());
  EXPECT_EQ(group.at("mmrv"), 0);
  EXPECT_FALSE(group.contains("mmrv_reason"));
  EXPECT_EQ(group.at("mmrv_convention"), "real_gap,code");
  EXPECT_EQ(group.at("ties"), 3);
  EXPECT_EQ(group.at("points").size(), 3u);
}

TEST(CorrelationJson, SurvivesNamesThatAreNotUtf8) {
  EXPECT_NO_THROW(nlohmann::json::parse(CorrelationJson(GroupsOf("\xFF\xFE,t,1,.1,.1\n"))));
}

TEST(CorrelationText, ShowsIntervalsTheirMethodAndTheReasonsForWhatIsMissing) {
  const std::string text =
      CorrelationText(GroupsOf("good,t,1,.1,.1\ngood,t,2,.2,.3\ngood,t,3,.4,.3\ngood,t,4,.9,.8\nlone,t,1,0,1\n"));
  EXPECT_THAT(text, HasSubstr("Fisher z"));
  EXPECT_THAT(text, HasSubstr("real_gap, ties code; 1 pair of points tied"));
  EXPECT_THAT(text, HasSubstr("Pearson is undefined: 1 point, wanted at least 3 (lone)"));
}

// --- a run
// -------------------------------------------------------------------------------------------------------------

/// A run of three policies on two tasks in a real world, "sim" and "copy" (which repeats the real outcomes).
class RunCorrelation : public testing::Test {
 protected:
  RunCorrelation() : store_(Store::InMemory(folder_.path(), {"suite: test", "hash", "", "test"})) {
    for (const char* task : kTasks) {
      Task declared;
      declared.id = task;
      store_.AddTask(declared);
    }
    store_.AddWorld({"real", "mujoco", true, ""});
    store_.AddWorld({"sim", "mujoco", false, ""});
    store_.AddWorld({"copy", "mujoco", false, ""});
    for (const char* checkpoint : kCheckpoints) store_.AddPolicy({"pick", checkpoint, "{}"});
  }

  static Episode AnEpisode(const PairKey& pair, const std::string& world) {
    Episode episode;
    episode.key = {pair, world};
    episode.observations.resize(2);
    for (Observation& observation : episode.observations) observation.arms.resize(1);
    episode.commands.assign(1, Arms(1));
    episode.chunks = 1;
    episode.stop = StopReason::kMaxChunks;
    return episode;
  }

  static Verdict AVerdict(const Episode& episode, const std::string& judge, Label label) {
    Verdict verdict;
    verdict.episode_id = episode.key.Id();
    verdict.judge = judge;
    verdict.label = label;
    return verdict;
  }

  void Add(const PairKey& pair, const std::string& world, Label label, const std::string& judge = "oracle") {
    const Episode episode = AnEpisode(pair, world);
    if (!store_.Has(episode.key)) store_.Add({episode, {}, {}, {}});
    store_.AddVerdict(AVerdict(episode, judge, label));
  }

  void AddAll() {
    SplitMix64 random(11);
    for (const char* task : kTasks) {
      for (int state = 0; state < 12; ++state) {
        for (int policy = 0; policy < 3; ++policy) {
          const PairKey pair{task, "7-" + std::to_string(state), "pick", kCheckpoints[policy], 0};
          const Label real = Draw(random, policy), sim = Draw(random, policy);
          Add(pair, "real", real);
          Add(pair, "copy", real);
          Add(pair, "sim", sim);
        }
      }
    }
  }

  static Label Draw(SplitMix64& random, int policy) {
    return random.Uniform() < 0.2 + 0.3 * policy ? Label::kSuccess : Label::kFailure;
  }

  std::string MessageOf(const RunCorrelationOptions& options) const {
    try {
      CorrelateRun(store_, options);
    } catch (const Error& error) {
      EXPECT_EQ(error.exit_code(), ExitCode::kInvalidInput);
      return error.what();
    }
    return "accepted";
  }

  static constexpr const char* kTasks[] = {"bottle", "toast"};
  static constexpr const char* kCheckpoints[] = {"bad", "fair", "good"};
  TempFolder folder_;
  Store store_;
};

TEST_F(RunCorrelation, ComparesTheRealWorldWithEachOtherInAllAndTaskByTask) {
  AddAll();
  const auto groups = CorrelateRun(store_);
  std::vector<std::string> names;
  for (const CorrelationGroup& group : groups) names.push_back(group.group);
  EXPECT_THAT(names,
              testing::UnorderedElementsAre("sim", "sim/bottle", "sim/toast", "copy", "copy/bottle", "copy/toast"));
  for (const CorrelationGroup& group : groups) {
    EXPECT_EQ(group.points.size(), group.group.find('/') == std::string::npos ? 6u : 3u);
    EXPECT_EQ(group.points[0].policy, "pick@bad");
    EXPECT_EQ(group.points[0].real->trials, 12);
    if (group.group != "copy") continue;
    EXPECT_EQ(*group.pearson.value, 1);
    EXPECT_EQ(*group.mmrv.value, 0);
    EXPECT_EQ(group.pearson.method, "paired state bootstrap, percentile, B=2000, seed 0");
    EXPECT_EQ(group.pearson.interval->low, 1);
  }
}

/// It said 9 pairs of these 7: the one within each task was counted with its world's and again with its task's.
TEST_F(RunCorrelation, APairOfTiedPointsIsCountedOnceThoughItsTaskHasAGroupOfItsOwn) {
  const char* real[] = {"ssff", "ssff", "sssf"};
  const char* sim[][3] = {{"ffff", "sfff", "ssff"}, {"sssf", "ssss", "ssff"}};  // by task
  for (int task = 0; task < 2; ++task) {
    for (int policy = 0; policy < 3; ++policy) {
      for (std::size_t state = 0; state < 4; ++state) {
        const PairKey pair{kTasks[task], "7-" + std::to_string(state), "pick", kCheckpoints[policy], 0};
        Add(pair, "real", real[policy][state] == 's' ? Label::kSuccess : Label::kFailure);
        Add(pair, "sim", sim[task][policy][state] == 's' ? Label::kSuccess : Label::kFailure);
      }
    }
  }
  const auto groups = CorrelateRun(store_, {.correlation = {}, .judge = "oracle", .world = "sim"});
  ASSERT_THAT(groups, SizeIs(3));
  EXPECT_EQ(groups[1].ranks.ties, 1);
  EXPECT_EQ(groups[2].ranks.ties, 1);
  EXPECT_EQ(groups[0].ranks.ties, 7);
  EXPECT_THAT(CorrelationText(groups), HasSubstr("; 7 pairs of points tied\n"));
}

TEST_F(RunCorrelation, AWorldCanBeChosenAndAWrongNameIsNamed) {
  AddAll();
  RunCorrelationOptions options;
  options.world = "sim";
  EXPECT_THAT(CorrelateRun(store_, options), SizeIs(3));
  options.world = "smi";
  EXPECT_THAT(MessageOf(options), HasSubstr("wanted one of these"));
  options = {.correlation = {}, .judge = "orcale", .world = ""};
  EXPECT_THAT(MessageOf(options), HasSubstr("judge orcale: found verdicts of oracle"));
}

TEST_F(RunCorrelation, ARunThatNobodyJudgedYetIsRefusedWithWhatToDo) {
  store_.Add({AnEpisode({"bottle", "7-0", "pick", "good", 0}, "real"), {}, {}, {}});
  EXPECT_THAT(MessageOf({}), HasSubstr("judge oracle: found no verdicts at all, wanted those that `evac judge` gives"));
}

TEST_F(RunCorrelation, CountsOnlyPairsThatSucceededOrFailedInBothWorlds) {
  const auto pair = [](const char* state) { return PairKey{"bottle", state, "pick", "good", 0}; };
  Add(pair("7-0"), "real", Label::kSuccess), Add(pair("7-0"), "sim", Label::kFailure);
  Add(pair("7-1"), "real", Label::kSuccess), Add(pair("7-1"), "sim", Label::kCannotTell);
  Add(pair("7-2"), "real", Label::kInvalid), Add(pair("7-2"), "sim", Label::kSuccess);
  Add(pair("7-3"), "real", Label::kSuccess);
  Add(pair("7-4"), "real", Label::kSuccess), Add(pair("7-4"), "sim", Label::kFailure, "human");
  Add(pair("7-5"), "real", Label::kFailure), Add(pair("7-5"), "sim", Label::kSuccess);
  Episode crashed = AnEpisode(pair("7-6"), "real");
  crashed.stop = StopReason::kPolicyError;
  crashed.failure = "the policy died";
  store_.Add({crashed, {}, {}, {}});
  store_.AddVerdict(AVerdict(crashed, "oracle", Label::kSuccess));
  Add(pair("7-6"), "sim", Label::kSuccess);

  RunCorrelationOptions options;
  options.world = "sim";
  const CorrelationGroup group = CorrelateRun(store_, options)[0];
  ASSERT_THAT(group.points, SizeIs(1));
  EXPECT_EQ(group.points[0].real->trials, 2);
  EXPECT_EQ(group.points[0].real->successes, 1);
  EXPECT_EQ(group.points[0].sim->successes, 1);
  EXPECT_EQ(group.pearson.value.reason(), "1 point, wanted at least 3");
}

/// "Pearson is undefined in 503 of 2000 replicates, which are dropped" was said where two points have none in any.
TEST_F(RunCorrelation, WherePearsonIsUndefinedNoReplicateIsSaidToBeDropped) {
  const std::string_view outcomes[] = {"ssff", "sfff"};
  for (int policy = 0; policy < 2; ++policy) {
    for (std::size_t state = 0; state < 4; ++state) {
      const PairKey pair{"bottle", "7-" + std::to_string(state), "pick", kCheckpoints[policy], 0};
      for (const char* world : {"real", "sim"})
        Add(pair, world, outcomes[policy][state] == 's' ? Label::kSuccess : Label::kFailure);
    }
  }
  RunCorrelationOptions options;
  options.world = "sim";
  const auto groups = CorrelateRun(store_, options);
  EXPECT_EQ(groups[0].pearson.value.reason(), "2 points, wanted at least 3");
  EXPECT_EQ(groups[0].undefined_replicates, 0);
  EXPECT_THAT(CorrelationText(groups), testing::Not(HasSubstr("dropped")));
}

TEST_F(RunCorrelation, TheNewestVerdictOfTheJudgeIsTheOneThatCounts) {
  AddAll();
  const auto before = CorrelateRun(store_)[0];
  for (const char* task : kTasks) Add({task, "7-0", "pick", "bad", 0}, "real", Label::kSuccess);
  for (const char* task : kTasks) Add({task, "7-0", "pick", "bad", 0}, "real", Label::kCannotTell);
  const auto after = CorrelateRun(store_)[0];
  EXPECT_EQ(after.points[0].real->trials, before.points[0].real->trials - 1);
}

TEST_F(RunCorrelation, APolicyWithoutAPairIsNamedAndNotAPoint) {
  AddAll();
  store_.AddPolicy({"hold", "", "{}"});
  Add({"bottle", "7-0", "hold", "", 0}, "real", Label::kFailure);
  const auto group = CorrelateRun(store_)[0];
  EXPECT_THAT(group.points, SizeIs(6));
  EXPECT_THAT(group.left_out, ElementsAre("bottle, hold: no pair of episodes has a success or failure in both worlds"));
  EXPECT_THAT(CorrelationText({group}), HasSubstr("left out: bottle, hold"));
}

}  // namespace
}  // namespace evac
