#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fstream>
#include <nlohmann/json.hpp>

#include "core/file.h"
#include "core/store.h"
#include "tests/core/store_samples.h"
#include "tests/support/temp_folder.h"
#include "tests/system/run_support.h"

/// A repository with a gate, as CI would run it: the real program on runs on disk.
namespace evac::system_test {
namespace {

using testing::AllOf;
using testing::HasSubstr;
using Json = nlohmann::json;

const std::string kRules =
    "name: nightly\n"
    "gates:\n"
    "  - {name: bottle.sim, test: paired_mcnemar, task: take_bottle, world: sim, margin: 0.1, max_error_share: 0.02}\n"
    "  - {name: errors, test: error_share, world: sim, at_most: 0.02}\n";

class GateCommand : public testing::Test {
 protected:
  GateCommand() {
    WriteFileAtomically(folder_ / "gate.yaml", kRules);
    WriteRun("main", 60, 0);
    Pin("main");
  }

  /// A run of one policy in sim: states succeed but for the first `failures`.
  void WriteRun(const std::string& name, int states, int failures) const {
    Store store = Store::CreateOrContinue(folder_ / name, samples::SomeRun());
    samples::Declare(store);
    std::vector<EpisodeRecord> records;
    std::vector<Verdict> verdicts;
    for (int state = 0; state < states; ++state) {
      EpisodeRecord& record = records.emplace_back(EpisodeRecord{});
      record.episode.key = samples::Key(1, "sim");
      record.episode.key.pair.initial_state = fmt::format("41-{:04d}", state);
      record.episode.stop = StopReason::kStill;
      Verdict& verdict = verdicts.emplace_back();
      verdict.episode_id = record.episode.key.Id();
      verdict.judge = "oracle";
      verdict.label = state < failures ? Label::kFailure : Label::kSuccess;
    }
    store.AddAll(records);
    store.AddVerdicts(verdicts);
  }

  /// A run of four policies in real and sim, on ten states: each succeeds in two more than the one before.
  void WriteTwoWorlds(const std::string& name) const {
    Store store = Store::CreateOrContinue(folder_ / name, samples::SomeRun());
    samples::Declare(store);
    std::vector<EpisodeRecord> records;
    std::vector<Verdict> verdicts;
    for (int i = 0; i < 2 * 4 * 10; ++i) {
      const int policy = i / 10 % 4, state = i % 10;
      EpisodeRecord& record = records.emplace_back(EpisodeRecord{});
      record.episode.key = samples::Key(1, i < 40 ? "real" : "sim");
      record.episode.key.pair.initial_state = fmt::format("41-{:04d}", state);
      record.episode.key.pair.checkpoint = fmt::format("step_{}", policy);
      record.episode.stop = StopReason::kStill;
      if (i < 40 && state == 0) store.AddPolicy({"visual_pick", record.episode.key.pair.checkpoint, "{}"});
      Verdict& verdict = verdicts.emplace_back();
      verdict.episode_id = record.episode.key.Id();
      verdict.judge = "oracle";
      verdict.label = state <= 2 * policy ? Label::kSuccess : Label::kFailure;
    }
    store.AddAll(records);
    store.AddVerdicts(verdicts);
  }

  CommandResult Evac(std::vector<std::string> words) const {
    words.insert(words.begin(), Binary("evac"));
    return RunCommand(words);
  }
  void Pin(const std::string& run) const {
    const CommandResult result = Evac({"gate", "pin", Path(run), "--out", Path("baseline.json")});
    EXPECT_EQ(result.exit_code, 0) << result.err;
  }
  CommandResult Gate(const std::string& run, const std::vector<std::string>& options = {}) const {
    std::vector<std::string> words = {"gate", Path("gate.yaml"), Path(run), "--baseline", Path("baseline.json")};
    words.insert(words.end(), options.begin(), options.end());
    return Evac(words);
  }
  std::string Path(const std::string& name) const { return (folder_ / name).string(); }

  const TempFolder folder_;
};

TEST_F(GateCommand, APlantedRegressionFailsTheSamePassesAndFewAreInconclusive) {
  WriteRun("worse", 60, 15);
  const CommandResult worse = Gate("worse");
  EXPECT_EQ(worse.exit_code, 1) << worse.err;
  EXPECT_THAT(worse.out,
              AllOf(HasSubstr("FAIL          bottle.sim: visual_pick@good 75 %"),
                    HasSubstr("60 pairs, 0 better / 15 worse, p < 0.001 (exact McNemar)"),
                    HasSubstr("take_bottle 41-0000"), HasSubstr("and 5 more"), HasSubstr("Gate nightly: fail.")));

  WriteRun("same", 60, 0);
  const CommandResult same = Gate("same");
  EXPECT_EQ(same.exit_code, 0) << same.out << same.err;
  EXPECT_THAT(same.out, HasSubstr("PASS          bottle.sim"));

  WriteRun("small-main", 8, 0);
  WriteRun("small", 8, 1);
  Pin("small-main");
  const CommandResult small = Gate("small");
  EXPECT_EQ(small.exit_code, 3) << small.out << small.err;
  EXPECT_THAT(small.out,
              AllOf(HasSubstr("INCONCLUSIVE"), HasSubstr("more pairs to show"), HasSubstr("take_bottle 41-0000")));
}

TEST_F(GateCommand, OtherStatesAndAHandMadeBaselineAreRefused) {
  WriteRun("fewer", 50, 0);
  const CommandResult fewer = Gate("fewer");
  EXPECT_EQ(fewer.exit_code, 2);
  EXPECT_THAT(
      fewer.err,
      HasSubstr(
          "initial states: found another list than the baseline's: none only here, 10 (such as take_bottle 41-0050"));

  std::string pinned = ReadFile(folder_ / "baseline.json");
  pinned.replace(pinned.find("\"success\""), 9, "\"failure\"");
  WriteFileAtomically(folder_ / "baseline.json", pinned);
  const CommandResult changed = Gate("fewer");
  EXPECT_EQ(changed.exit_code, 2);
  EXPECT_THAT(changed.err, HasSubstr("baseline.json: field sha256: found"));

  WriteFileAtomically(folder_ / "gate.yaml", "gates: [{name: r, test: t}]");
  EXPECT_THAT(Gate("fewer").err, HasSubstr("gate.yaml:1: field gates.0.test: found 't', wanted paired_mcnemar"));
}

TEST_F(GateCommand, TheSameDataGetTheStoredDecisionAndTheReportShowsIt) {
  WriteRun("worse", 60, 15);
  const CommandResult first = Gate("worse", {"--json", "--out", Path("files")});
  EXPECT_EQ(Gate("worse", {"--json"}).out, first.out);
  const auto records = Store::Open(folder_ / "worse", Store::Mode::kReadOnly).GateRecords();
  ASSERT_EQ(records.size(), 1u) << "asked twice, decided once";
  EXPECT_EQ(records[0].outcome, "fail");
  EXPECT_THAT(ReadFile(folder_ / "files/junit.xml"), HasSubstr("failures=\"1\""));

  EXPECT_EQ(Evac({"report", Path("worse")}).exit_code, 0);
  const Json report = Json::parse(ReadFile(folder_ / "worse/report/report.json"));
  EXPECT_EQ(report.at("gates").at(0).at("outcome"), "fail");
  EXPECT_EQ(report.at("gates").at(0).at("current"), true);
  EXPECT_THAT(ReadFile(folder_ / "worse/report/summary.md"), HasSubstr("## Gate nightly: fail"));
  EXPECT_THAT(ReadFile(folder_ / "worse/report/badge.svg"), HasSubstr("#cf222e"));

  Verdict other;  // new data: the decision is of older ones, and is taken anew
  other.episode_id = Store::Open(folder_ / "worse", Store::Mode::kReadOnly).Episodes().at(0).key.Id();
  other.judge = "oracle";
  other.label = Label::kSuccess;
  Store::Open(folder_ / "worse", Store::Mode::kReadWrite).AddVerdict(other);
  EXPECT_EQ(Evac({"report", Path("worse")}).exit_code, 0);
  EXPECT_THAT(ReadFile(folder_ / "worse/report/junit.xml"), HasSubstr("Of older data"));
  EXPECT_THAT(Gate("worse").out, HasSubstr("0 better / 14 worse"));
}

/// Without a rule that is a correlation its findings of worlds rested on a single draw, and said "yes" by it.
TEST_F(GateCommand, ItsSummaryIsTheReportsWhateverItsRulesAskFor) {
  WriteFileAtomically(folder_ / "gate.yaml", "gates: [{name: e, test: error_share, world: sim, at_most: 0}]");
  WriteTwoWorlds("run");
  EXPECT_EQ(Gate("run", {"--out", Path("files")}).exit_code, 0);
  EXPECT_EQ(Evac({"report", Path("run")}).exit_code, 0);
  const std::string summary = ReadFile(folder_ / "files/summary.md");
  EXPECT_THAT(summary, AllOf(HasSubstr("## Gate gate: pass"), HasSubstr("bootstrap B = 2000")));
  EXPECT_EQ(summary, ReadFile(folder_ / "run/report/summary.md"));
}

TEST_F(GateCommand, SequentialBetsAreKeptInTheRunOnceForEachDataSet) {
  WriteFileAtomically(folder_ / "gate.yaml", "gates: [{name: bet, test: savi, world: sim}]");
  WriteRun("part", 9, 9);  // in progress: a part of the baseline's states
  EXPECT_EQ(Gate("part").exit_code, 1);
  EXPECT_EQ(Gate("part").exit_code, 1);
  const auto looks = Store::Open(folder_ / "part", Store::Mode::kReadOnly).Looks();
  ASSERT_EQ(looks.size(), 1u);
  EXPECT_EQ(looks[0].only_second, 9);
  EXPECT_GT(looks[0].e_value, 20);
}

/// It said "Gate gate: fail", and no decision was kept as release's.
TEST_F(GateCommand, ACopyOfTheRulesUnderAnotherNameHasItsOwnDecisionAndLooks) {
  for (const char* file : {"gate.yaml", "release.yaml"})
    WriteFileAtomically(folder_ / file, "gates: [{name: bet, test: savi, world: sim}]");
  WriteRun("part", 9, 9);
  EXPECT_THAT(Gate("part").out, HasSubstr("Gate gate: fail."));
  for (int asked = 0; asked < 2; ++asked) {
    const CommandResult release =
        Evac({"gate", Path("release.yaml"), Path("part"), "--baseline", Path("baseline.json")});
    EXPECT_THAT(release.out, HasSubstr("Gate release: fail.")) << release.err;
  }
  const Store store = Store::Open(folder_ / "part", Store::Mode::kReadOnly);
  ASSERT_EQ(store.GateRecords().size(), 2u);
  EXPECT_EQ(store.GateRecords()[1].gate, "release");
  ASSERT_EQ(store.Looks().size(), 2u) << "one of each gate";
  EXPECT_THAT(store.Looks()[1].comparison, HasSubstr("gate release, rule bet"));
}

TEST_F(GateCommand, ARunThatTheJudgeHasNotJudgedIsNoBaseline) {
  const CommandResult nobody = Evac({"gate", "pin", Path("main"), "--judge", "orakel", "--out", Path("nobody.json")});
  EXPECT_EQ(nobody.exit_code, 2) << nobody.out;
  EXPECT_THAT(nobody.err, HasSubstr("judge orakel: found no episode that succeeded or failed, wanted a judge of this run "
                                    "(evac ls) as --judge"));
  EXPECT_FALSE(std::filesystem::exists(folder_ / "nobody.json"));
}

TEST_F(GateCommand, APinnedFileIsWrittenWithTheFoldersAboveIt) {
  const CommandResult pinned = Evac({"gate", "pin", Path("main"), "--out", Path("new/folder/baseline.json")});
  EXPECT_EQ(pinned.exit_code, 0) << pinned.err;
  EXPECT_EQ(ReadFile(Path("new/folder/baseline.json")), ReadFile(Path("baseline.json")));
  const CommandResult in_a_file = Evac({"gate", "pin", Path("main"), "--out", Path("gate.yaml/baseline.json")});
  EXPECT_EQ(in_a_file.exit_code, 2) << in_a_file.err;
  EXPECT_THAT(in_a_file.err, HasSubstr(Path("gate.yaml") + ":"));
  const CommandResult over_a_folder = Evac({"gate", "pin", Path("main"), "--out", Path("new/folder")});
  EXPECT_EQ(over_a_folder.exit_code, 2) << over_a_folder.err;
  EXPECT_THAT(over_a_folder.err, HasSubstr(Path("new/folder") + ": is a folder, wanted a file"));
}

TEST_F(GateCommand, AJudgeWhoGaveNoVerdictIsInvalidAndNotInconclusive) {
  WriteFileAtomically(folder_ / "gate.yaml", "judge: orakel\ngates: [{name: r, test: ci_lower, world: sim, at_least: 0.5}]");
  const CommandResult unknown = Gate("main");
  EXPECT_EQ(unknown.exit_code, 2) << unknown.out;
  EXPECT_THAT(unknown.err, HasSubstr("field judge: found 'orakel', wanted one who has judged " + Path("main") + ": oracle"));
  WriteFileAtomically(folder_ / "gate.yaml", "judge: orakel\ngates: [{name: e, test: error_share, world: sim, at_most: 0}]");
  EXPECT_EQ(Gate("main").exit_code, 0) << "errors need no judge";
  const CommandResult report = Evac({"report", Path("main"), "--judge", "orakel"});
  EXPECT_EQ(report.exit_code, 2) << report.out;
  EXPECT_THAT(report.err, HasSubstr("--judge: found 'orakel', wanted one who has judged"));
  EXPECT_FALSE(std::filesystem::exists(folder_ / "main/report"));
}

TEST_F(GateCommand, ASeedIsRefusedWhereNoRuleDraws) {
  const CommandResult seeded = Gate("main", {"--seed", "3"});
  EXPECT_EQ(seeded.exit_code, 2) << seeded.out;
  EXPECT_THAT(seeded.err, HasSubstr("--seed: no rule of " + Path("gate.yaml") + " is a correlation"));
}

TEST_F(GateCommand, WithoutARunItSaysHowManyEpisodesTheRulesTake) {
  const CommandResult result = Evac({"gate", Path("gate.yaml"), "--baseline", Path("baseline.json")});
  EXPECT_EQ(result.exit_code, 0) << result.err;
  EXPECT_THAT(result.out, HasSubstr("124 pairs if 20 % of the states flip"));
  EXPECT_EQ(Evac({"gate"}).exit_code, 2);
}

TEST_F(GateCommand, GatesARealRun) {
  const CommandResult run = RunCommand(RunWords(kSmall, folder_ / "run"));
  ASSERT_EQ(run.exit_code, 0) << run.err;
  Pin("run");
  WriteFileAtomically(folder_ / "gate.yaml",
                      "gates:\n"
                      "  - {name: toast, test: paired_mcnemar, world: sim, policy: visual_pick@good}\n"
                      "  - {name: errors, test: error_share, world: real, at_most: 0}\n");
  const CommandResult itself = Gate("run");
  EXPECT_EQ(itself.exit_code, 3) << "4 pairs show nothing" << itself.out << itself.err;
  EXPECT_THAT(itself.out, AllOf(HasSubstr("4 pairs, 0 better / 0 worse"), HasSubstr("PASS          errors")));
  WriteFileAtomically(folder_ / "gate.yaml", "gates: [{name: r, test: correlation, world: sim, at_least: 0.7}]");
  const CommandResult first = Gate("run", {"--seed", "3"}), second = Gate("run", {"--seed", "4"});
  EXPECT_EQ(second.out, first.out);
  EXPECT_EQ(first.err, "");
  EXPECT_THAT(second.err, HasSubstr("--seed: this was decided before"));
}

TEST_F(GateCommand, ADecisionTakenAgainIsTheLastOneOfItsGate) {
  WriteRun("worse", 60, 15);
  EXPECT_EQ(Gate("worse").exit_code, 1);
  WriteFileAtomically(folder_ / "gate.yaml",
                      "name: nightly\ngates: [{name: r, test: noninferiority, world: sim, margin: 0.6}]\n");
  const CommandResult lenient = Gate("worse");
  EXPECT_EQ(lenient.exit_code, 0) << lenient.out << lenient.err;
  WriteFileAtomically(folder_ / "gate.yaml", kRules);
  EXPECT_EQ(Gate("worse").exit_code, 1);
  EXPECT_EQ(Store::Open(folder_ / "worse", Store::Mode::kReadOnly).GateRecords().size(), 2u);
  EXPECT_EQ(Evac({"report", Path("worse")}).exit_code, 0);
  const Json report = Json::parse(ReadFile(folder_ / "worse/report/report.json"));
  ASSERT_EQ(report.at("gates").size(), 1u);
  EXPECT_EQ(report.at("gates").at(0).at("outcome"), "fail");
  EXPECT_EQ(report.at("gates").at(0).at("current"), true);
  EXPECT_THAT(ReadFile(folder_ / "worse/report/badge.svg"), testing::Not(HasSubstr("#1a7f37")));
}

TEST_F(GateCommand, AFolderThatTheJudgeHasNotJudgedIsNoBaselineEither) {
  WriteRun("other", 60, 0);
  WriteFileAtomically(folder_ / "gate.yaml", "judge: human\ngates: [{name: r, test: paired_mcnemar, world: sim}]");
  Store other = Store::Open(folder_ / "other", Store::Mode::kReadWrite);
  Verdict verdict;
  verdict.episode_id = other.Episodes().at(0).key.Id();
  verdict.judge = "human";
  verdict.label = Label::kSuccess;
  other.AddVerdict(verdict);
  const CommandResult result = Evac({"gate", Path("gate.yaml"), Path("other"), "--baseline", Path("main")});
  EXPECT_EQ(result.exit_code, 2) << result.out;
  EXPECT_THAT(result.err, HasSubstr(Path("main") + ": judge human: found no episode that succeeded or failed"));
  EXPECT_THAT(result.err, HasSubstr("as the field judge of " + Path("gate.yaml")));
  const CommandResult pinned = Evac({"gate", Path("gate.yaml"), Path("other"), "--baseline", Path("baseline.json")});
  EXPECT_EQ(pinned.exit_code, 2) << pinned.out;
  EXPECT_THAT(pinned.err, HasSubstr("judge: found human, wanted the baseline's, oracle: `evac gate pin --judge`"));
}

/// A run that was killed on its way was pinned, and passed, as if it were whole.
TEST_F(GateCommand, APartOfARunIsPinnedWithAWarningAndPassesNothing) {
  Store::Open(folder_ / "main", Store::Mode::kReadWrite).AddPlan({{"take_bottle", "sim", "visual_pick", "good", 80}});
  const CommandResult pinned = Evac({"gate", "pin", Path("main"), "--out", Path("part.json")});
  EXPECT_EQ(pinned.exit_code, 0) << pinned.err;
  EXPECT_THAT(pinned.err, HasSubstr("60 of 80 episodes are there"));
  const CommandResult gate = Gate("main");
  EXPECT_EQ(gate.exit_code, 3) << gate.out << gate.err;
  EXPECT_THAT(gate.out, AllOf(HasSubstr("60 of 80 episodes are there"), HasSubstr("evac resume")));
}

}  // namespace
}  // namespace evac::system_test
