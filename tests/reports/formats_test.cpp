#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fstream>
#include <nlohmann/json.hpp>

#include "core/file.h"
#include "reports/badge.h"
#include "reports/csv.h"
#include "reports/gate_output.h"
#include "reports/junit.h"
#include "reports/report_files.h"
#include "reports/summary_md.h"
#include "reports/xml.h"
#include "tests/reports/sample_run.h"
#include "tests/support/command.h"

/// Every file beside the page, read by what reads it: names and texts come back as they were.
namespace evac {
namespace {

using Json = nlohmann::json;
using testing::AllOf;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::Not;

const std::string kHostilePolicy = "pick \"it\", <b>&amp;</b>\n| `x` ' ünïcode 手";
const std::string kHostileTask = "take, \"the\" <bottle>\t&";

std::map<std::string, std::string> FilesOf(const RunSummary& summary) {
  std::map<std::string, std::string> files;
  for (const ReportFile& file : ReportFiles(ReportDataOf(summary), {"..", "evac test"})) files[file.name] = file.bytes;
  return files;
}

RunSummary HostileRun() {
  return SampleRun({{kHostileTask, kHostilePolicy, "1", "sf?", "sse"}, {"b", kHostilePolicy, "1", "uu", "ff"}})
      .Summary();
}

std::vector<CsvRow> Rows(const std::string& csv) {
  const std::string file = "t.csv";
  CsvReader reader(csv, file);
  std::vector<CsvRow> rows;
  while (auto row = reader.Next()) rows.push_back(*row);
  return rows;
}

/// The cell of a row by its column's name.
std::string Cell(const std::vector<CsvRow>& rows, std::size_t row, const std::string& column) {
  const auto& header = rows.at(0).cells;
  return rows.at(row).cells.at(static_cast<std::size_t>(std::ranges::find(header, column) - header.begin()));
}

bool CanRun(const std::vector<std::string>& words) { return RunCommand(words).exit_code == 0; }

class XmlOfReports : public testing::Test {
 protected:
  void SetUp() override {
    if (!CanRun({"/usr/bin/xmllint", "--version"})) GTEST_SKIP() << "no xmllint (Debian: libxml2-utils)";
  }
  std::string Write(const std::string& xml) const {
    WriteFileAtomically(folder_ / "x.xml", xml);
    return (folder_ / "x.xml").string();
  }
  CommandResult Validate(const std::string& xml) const {
    return RunCommand(
        {"/usr/bin/xmllint", "--noout", "--schema", EVAC_SOURCE_DIR "/docs/formats/junit.xsd", Write(xml)});
  }
  std::string XPath(const std::string& xml, const std::string& path) const {
    const std::string text = RunCommand({"/usr/bin/xmllint", "--xpath", path, Write(xml)}).out;
    return text.substr(0, text.size() - (text.ends_with('\n') ? 1 : 0));  // what xmllint adds
  }
  TempFolder folder_;
};

TEST(CsvLine, TheReaderGivesBackTheSameCells) {
  const std::vector<std::string> cells = {"", " blank ", "a,b", "\"", "two\nlines", "cr\r", "手", "=1+1", "plain"};
  EXPECT_EQ(Rows(CsvLine(cells)).at(0).cells, cells);
  EXPECT_EQ(Rows(CsvLine({""})).at(0).cells, std::vector<std::string>{""}) << "one empty cell is no empty line";
}

TEST(RatesCsv, HasEveryCellOfTheReportAndEmptyCellsWhereUndefined) {
  const RunSummary summary = HostileRun();
  const std::vector<CsvRow> rows = Rows(FilesOf(summary).at("rates.csv"));
  ASSERT_EQ(rows.size(), 1 + summary.rates.size());
  EXPECT_EQ(Cell(rows, 1, "task"), "b");
  EXPECT_EQ(Cell(rows, 1, "unjudged"), "2");
  EXPECT_EQ(Cell(rows, 1, "rate"), "");
  EXPECT_EQ(Cell(rows, 3, "task"), kHostileTask);
  EXPECT_EQ(Cell(rows, 3, "policy"), kHostilePolicy + "@1");
  EXPECT_EQ(Cell(rows, 3, "rate"), "0.5");
  EXPECT_EQ(Cell(rows, 3, "cannot_tell"), "1");
}

TEST(VerdictsCsv, HasEveryVerdictOfEveryJudgeAndTheUnjudged) {
  SampleRun run({{kHostileTask, kHostilePolicy, "1", "su", "-"}});
  Verdict human;
  human.episode_id = run.store().Episodes().at(0).key.Id();
  human.judge = "human:\"Ann, B.\"";
  human.label = Label::kFailure;
  human.probability = 0.25;
  human.reason = "it fell,\nthen \"rolled\"";
  run.store().AddVerdict(human);
  const std::vector<CsvRow> rows = Rows(FilesOf(run.Summary()).at("verdicts.csv"));
  ASSERT_EQ(rows.size(), 4u);  // header, human and oracle on the first, none on the second
  EXPECT_EQ(Cell(rows, 1, "judge"), human.judge);
  EXPECT_EQ(Cell(rows, 1, "reason"), human.reason);
  EXPECT_EQ(Cell(rows, 1, "probability"), "0.25");
  EXPECT_EQ(Cell(rows, 2, "judge"), "oracle");
  EXPECT_EQ(Json::parse(Cell(rows, 2, "stages")).at("grasp"), true);
  EXPECT_EQ(Cell(rows, 3, "judge"), "");
  EXPECT_EQ(Cell(rows, 3, "policy"), kHostilePolicy);
}

/// The fields of the README of github.com/benchmark-action/github-action-benchmark: name, value and unit are asked for,
/// range and extra are optional texts.
TEST(BenchmarkJson, HasTheFieldsOfGithubActionBenchmark) {
  const Json entries = Json::parse(FilesOf(HostileRun()).at("benchmark.json"));
  ASSERT_EQ(entries.size(), 3u) << "a rate that is undefined has no entry";
  for (const Json& entry : entries) {
    EXPECT_TRUE(entry.at("name").is_string() && entry.at("unit").is_string() && entry.at("value").is_number());
    EXPECT_TRUE(entry.at("range").is_string() && entry.at("extra").is_string());
    EXPECT_EQ(entry.size(), 5u);
    EXPECT_THAT(entry.at("range").get<std::string>(), HasSubstr("± "));
  }
  EXPECT_EQ(entries[1].at("name"), kHostileTask + " / " + kHostilePolicy + "@1 / real");
  EXPECT_EQ(entries[1].at("value"), 50);
  EXPECT_EQ(entries[1].at("range"), "± 40.5") << "Wilson 1 of 2: [0.0945, 0.9055]";
}

/// Fields as `eval_policy_all` of LeRobot's lerobot_eval.py returns them.
TEST(EvalInfoJson, HasTheFieldsThatLeRobotWrites) {
  const Json info = Json::parse(FilesOf(HostileRun()).at("eval_info.json"));
  ASSERT_EQ(info.at("per_task").size(), 4u);
  for (const Json& task : info.at("per_task")) {
    EXPECT_TRUE(task.at("task_group").is_string() && task.at("task_id").is_number_integer());
    const Json& metrics = task.at("metrics");
    EXPECT_EQ(metrics.at("sum_rewards").size(), metrics.at("successes").size());
    EXPECT_EQ(metrics.at("max_rewards"), metrics.at("sum_rewards"));
    EXPECT_TRUE(metrics.at("video_paths").is_array());
    for (const Json& success : metrics.at("successes")) EXPECT_TRUE(success.is_boolean());
    for (const Json& reward : metrics.at("sum_rewards")) EXPECT_TRUE(reward.is_number_float());
  }
  Json aggregates = info.at("per_group");
  aggregates["overall"] = info.at("overall");
  for (const auto& [group, aggregate] : aggregates.items()) {
    for (const char* key : {"avg_sum_reward", "avg_max_reward", "pc_success", "n_episodes", "video_paths"})
      EXPECT_TRUE(aggregate.contains(key)) << group << " " << key;
  }
  EXPECT_TRUE(info.at("overall").contains("eval_s") && info.at("overall").contains("eval_ep_s"));
  const Json& real = info.at("per_group").at("real/" + kHostilePolicy + "@1");
  EXPECT_EQ(real.at("pc_success"), 50) << "percent, as LeRobot has it";
  EXPECT_EQ(real.at("n_episodes"), 2);
  EXPECT_EQ(real.at("n_apart"), 3);
}

TEST_F(XmlOfReports, JunitFitsItsSchemaAndNamesSurvive) {
  const std::string xml = FilesOf(HostileRun()).at("junit.xml");
  const CommandResult valid = Validate(xml);
  EXPECT_EQ(valid.exit_code, 0) << valid.err << xml;
  EXPECT_EQ(XPath(xml, "string(//testsuite[2]/@name)"), kHostileTask);
  EXPECT_EQ(XPath(xml, "string(//testsuite[2]/testcase[1]/@name)"), kHostilePolicy + "@1");
  EXPECT_EQ(XPath(xml, "count(//testcase)"), "4");
  EXPECT_EQ(XPath(xml, "string(//testsuite[2]/testcase[2]/error/@message)"), "1 episode could not go on: in no rate");
  EXPECT_EQ(XPath(xml, "string(//testsuite[1]/testcase[1]/skipped/@message)"),
            "no episode has a verdict of success or failure");
  EXPECT_EQ(XPath(xml, "string(/testsuites/@errors)"), "1");
}

TEST_F(XmlOfReports, TheSchemaRefusesWhatIsNoJunit) {
  EXPECT_NE(Validate("<testsuites name=\"evac\"/>").exit_code, 0) << "without counts";
  EXPECT_NE(Validate("<report/>").exit_code, 0);
}

TEST_F(XmlOfReports, TheBadgeIsXmlAndSaysTheRateOfTheOnlyPolicy) {
  const std::string badge = FilesOf(SampleRun({{"a", "pick", "1", "ssssf", "f"}}).Summary()).at("badge.svg");
  EXPECT_EQ(RunCommand({"/usr/bin/xmllint", "--noout", Write(badge)}).exit_code, 0);
  EXPECT_THAT(badge, HasSubstr("evac: 80 % [38, 96]"));
  EXPECT_THAT(FilesOf(LargeRun().Summary()).at("badge.svg"), HasSubstr("4 policies, 160 episodes"));
}

TEST(Badge, IsGreenOnlyIfEveryGatePassedOnJustTheseData) {
  const auto shown = [](const char* name, GateOutcome outcome, bool is_current) {
    ShownGate gate;
    gate.decision.name = name;
    gate.decision.outcome = outcome;
    gate.is_current = is_current;
    return gate;
  };
  const RunSummary& summary = LargeRun().Summary();
  const ShownGate passed = shown("a", GateOutcome::kPass, true), stale = shown("b", GateOutcome::kPass, false);
  const ShownGate failed = shown("c", GateOutcome::kFail, true), failed_then = shown("a", GateOutcome::kFail, false);
  EXPECT_THAT(BadgeSvg(summary, {passed}), HasSubstr("#1a7f37"));
  EXPECT_THAT(BadgeSvg(summary, {passed, stale}), AllOf(HasSubstr("pass, of older data"), Not(HasSubstr("#1a7f37"))));
  EXPECT_THAT(BadgeSvg(summary, {failed_then, failed}), HasSubstr("#cf222e")) << "what holds now comes first";
}

/// It said "no verdict", though all were judged: no world was the real one, whose rate it would have been.
TEST(Badge, OfSeveralWorldsWithoutARealOneItCountsAsOfSeveralPolicies) {
  RunData data = ReadRun(SampleRun({{"a", "pick", "1", "ssff", "sfff"}}).store());
  EXPECT_THAT(BadgeSvg(Summarise(data, {}), {}), HasSubstr("evac: 50 % ["));
  for (WorldInfo& world : data.worlds) world.is_real = false;
  EXPECT_THAT(BadgeSvg(Summarise(data, {}), {}),
              AllOf(HasSubstr("evac: 1 policy, 8 episodes"), Not(HasSubstr("no verdict"))));
}

TEST(Xml, WhatXmlCannotHoldIsReplaced) {
  EXPECT_EQ(XmlText("a\x01<\xFF\xEF\xBF\xBF"), "a\xEF\xBF\xBD&lt;\xEF\xBF\xBD\xEF\xBF\xBD");
  EXPECT_EQ(XmlAttribute("a\nb\tc\""), "a&#10;b&#9;c&quot;");
}

/// Columns of a Markdown table's row: its '|' that no '\' stands before.
std::ptrdiff_t ColumnsOf(const std::string& line) {
  std::ptrdiff_t bars = 0;
  for (std::size_t i = 0; i < line.size(); ++i) {
    if (line[i] == '\\') {
      ++i;
    } else if (line[i] == '|') {
      ++bars;
    }
  }
  return bars - 1;
}

TEST(SummaryMarkdown, HostileNamesStayInTheirCells) {
  const std::string page = FilesOf(HostileRun()).at("summary.md");
  EXPECT_THAT(page, HasSubstr("\\| \\`x\\`"));
  EXPECT_THAT(page, HasSubstr("ünïcode 手"));
  EXPECT_THAT(page, Not(HasSubstr("<b>")));
  std::istringstream lines(page);
  int rows = 0;
  for (std::string line; std::getline(lines, line);) {
    if (!line.starts_with('|')) continue;
    ++rows;
    EXPECT_EQ(ColumnsOf(line), 6) << line;
  }
  EXPECT_GT(rows, 6);
}

/// GitHub reads a tag's text as HTML up to the first empty line: what follows one would be Markdown.
TEST(SummaryMarkdown, ANameOfSeveralLinesStaysInItsFold) {
  RuleDecision rule;
  rule.name = "not worse\n\n# Passed\n";
  rule.outcome = GateOutcome::kFail;
  rule.flips_worse = 1;
  rule.counter_examples = {{"a", "41-0000", 1, "c.mp4", "b.mp4"}};
  GateDecision decision;
  decision.name = "main";
  decision.rules = {rule};
  const std::string page = SummaryMarkdown(HostileRun(), {{decision, true}});
  EXPECT_THAT(page, HasSubstr("<summary>not worse  # Passed : 1 pair where"));
  EXPECT_THAT(page, Not(HasSubstr("\n# Passed")));
}

/// Of thirty policies with names of eight thousand letters.
RunSummary LongNamedRun() {
  std::vector<SampleCell> cells;
  const std::string name(8000, 'x');
  for (int i = 0; i < 30; ++i) cells.push_back({"a", std::to_string(i), "", "s", "-"});
  RunSummary summary = SampleRun(cells).Summary();
  for (RateCell& cell : summary.rates) cell.policy += name;
  for (std::string& policy : summary.policies) policy += name;
  return summary;
}

/// GitHub refuses a longer one: 65 536 characters.
TEST(SummaryMarkdown, FitsTheCommentOfAPullRequest) {
  const std::string page = SummaryMarkdown(LongNamedRun(), {});
  EXPECT_LT(page.size(), 65'536u);
  EXPECT_GT(page.size(), 40'000u) << "as much as fits is said";
}

TEST(SummaryMarkdown, IsNeverLongerThanItsLimitAndSaysWhatIsLeftOut) {
  const std::string page = SummaryMarkdown(LongNamedRun(), {});
  EXPECT_LE(page.size(), kMostSummaryBytes);
  EXPECT_NE(page.find("report.json has all."), std::string::npos);
  EXPECT_NE(page.find("Provenance"), std::string::npos);
}

TEST(ReportFiles, TheSameStoreGivesTheSameBytes) {
  EXPECT_EQ(FilesOf(LargeRun().Summary()), FilesOf(LargeRun().Summary()));
  EXPECT_EQ(FilesOf(LargeRun().Summary()).size(), 9u);
}

/// A classifier has judged the real world beside the oracle; it gives probabilities.
RunSummary OfTwoJudges() {
  SampleRun run({{"a", "pick", "1", "sff", "sff"}, {"a", "pick", "2", "ssf", "-"}});
  for (const Episode& episode : run.store().Episodes()) {
    if (episode.key.world != "real") continue;
    Verdict verdict;
    verdict.episode_id = episode.key.Id();
    verdict.judge = "classifier:abc";
    verdict.label = Label::kSuccess;
    verdict.probability = 0.75;
    run.store().AddVerdict(verdict);
  }
  return run.Summary();
}

TEST(ReportFiles, ReportJsonFitsItsPublishedSchema) {
  if (!CanRun({"/usr/bin/python3", "-c", "import jsonschema"})) GTEST_SKIP() << "no python3-jsonschema";
  const TempFolder folder;
  const auto validate = [&](const std::string& json) {
    WriteFileAtomically(folder / "report.json", json);
    return RunCommand(
        {"/usr/bin/python3", "-c",
         "import json, jsonschema, sys\n"
         "jsonschema.Draft202012Validator(json.load(open(sys.argv[1]))).validate(json.load(open(sys.argv[2])))",
         EVAC_SOURCE_DIR "/docs/formats/report.schema.json", (folder / "report.json").string()});
  };
  const RunSummary unpaired = SampleRun({{"a", "pick", "1", "uu", "sf"}}).Summary();
  for (const RunSummary& summary : {LargeRun().Summary(), HostileRun(), unpaired, OfTwoJudges()}) {
    const CommandResult result = validate(FilesOf(summary).at("report.json"));
    EXPECT_EQ(result.exit_code, 0) << result.err.substr(0, 3000);
  }
  Json broken = Json::parse(FilesOf(HostileRun()).at("report.json"));
  broken["rates"][0]["success_rate"].erase("n");
  EXPECT_NE(validate(broken.dump()).exit_code, 0) << "an estimate without n";
}

TEST(CounterExamples, OfABetAreCountedByThePairsThatAreListed) {
  RuleDecision rule;
  rule.name = "bet";
  rule.outcome = GateOutcome::kFail;
  rule.flips_worse = 12;  // one seed of each state
  for (std::uint64_t seed = 0; seed < 30; ++seed) rule.counter_examples.push_back({"a", "41-0000", seed, "c", "b"});
  GateDecision decision;
  decision.name = "main";
  decision.rules = {rule};
  EXPECT_THAT(GateText(decision), HasSubstr("and 20 more"));
  EXPECT_THAT(JunitXml(HostileRun(), {{decision, true}}),
              AllOf(HasSubstr("30 pairs in all"), Not(HasSubstr("initial states in all"))));
}

}  // namespace
}  // namespace evac
