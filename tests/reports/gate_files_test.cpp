#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <functional>
#include <nlohmann/json.hpp>

#include "core/error.h"
#include "core/hash.h"
#include "reports/gate.h"
#include "reports/gate_baseline.h"
#include "reports/gate_rules.h"
#include "tests/reports/repeated_run.h"
#include "tests/reports/sample_run.h"

/// The two files a gate reads: its rules, and the pinned baseline.
namespace evac {
namespace {

using testing::AllOf;
using testing::HasSubstr;

std::string MessageOf(const std::function<void()>& act) {
  try {
    act();
  } catch (const Error& error) {
    EXPECT_EQ(error.exit_code(), ExitCode::kInvalidInput);
    return error.what();
  }
  return "nothing was thrown";
}

std::string Refusal(const std::string& text) {
  return MessageOf([&] { ReadGateRules(Config::FromText(text, "gate.yaml")); });
}

GateRules Read(const std::string& text) { return ReadGateRules(Config::FromText(text, "gate.yaml")); }

TEST(GateRules, WhatIsLeftOutHasItsDefault) {
  const GateRules rules = Read("gates:\n  - {name: r, test: paired_mcnemar}\n");
  EXPECT_EQ(rules.name, "gate") << "the file's";
  EXPECT_EQ(rules.judge, "oracle");
  EXPECT_EQ(rules.rules[0].metric, "success_rate");
  EXPECT_DOUBLE_EQ(rules.rules[0].alpha, 0.05);
  EXPECT_DOUBLE_EQ(rules.rules[0].margin, 0.1);
  EXPECT_TRUE(rules.rules[0].ComparesPairs());
  EXPECT_FALSE(Read("gates: [{name: r, test: boschloo}]").rules[0].ComparesPairs());
}

TEST(GateRules, TheHashIsThatOfTheMeaning) {
  const std::string hash = Read("gates: [{name: r, test: savi, margin: 0.2}]").hash;
  EXPECT_EQ(Read("# a comment\ngates:\n- margin: 0.2\n  name: r\n  test: savi\n").hash, hash);
  EXPECT_NE(Read("gates: [{name: r, test: savi, margin: 0.3}]").hash, hash);
}

TEST(GateRules, EveryComplaintNamesFileLineFieldFoundAndWanted) {
  EXPECT_THAT(Refusal("gates: []"), HasSubstr("gate.yaml: field gates: found no rule, wanted at least one"));
  EXPECT_THAT(
      Refusal("gates:\n  - {name: r, test: ttest}"),
      AllOf(HasSubstr("gate.yaml:2: field gates.0.test: found 'ttest'"), HasSubstr("wanted paired_mcnemar, boschloo")));
  EXPECT_THAT(Refusal("gates: [{name: r, test: savi, alpha: 0.7}]"),
              HasSubstr("field gates.0.alpha: found '0.7', wanted a number above 0 and below 0.5"));
  EXPECT_THAT(Refusal("gates: [{name: r, test: savi, margin: big}]"), HasSubstr("found 'big', wanted a number"));
  EXPECT_THAT(Refusal("gates: [{name: r, test: savi, margn: 0.1}]"),
              HasSubstr("there is no such field; the nearest is 'margin'"));
  EXPECT_THAT(Refusal("gates: [{name: r, test: savi, metric: kappa}]"),
              HasSubstr("metric: found 'kappa', wanted success_rate"));
  EXPECT_THAT(Refusal("gates: [{name: r, test: savi}, {name: r, test: savi}]"),
              HasSubstr("gates.1.name: found 'r', wanted a name that no other rule has"));
  EXPECT_THAT(Refusal("gates: [{name: r, test: ci_lower}]"), HasSubstr("at_least: found nothing, wanted a number"));
  EXPECT_THAT(Refusal("gates: [{name: r, test: ci_lower, at_least: 0.5, margin: 0.1}]"),
              HasSubstr("margin: found '0.1', wanted none"));
  EXPECT_THAT(Refusal("gates: [{name: r, test: error_share, at_least: 0.5, at_most: 0.5}]"),
              HasSubstr("at_least: found '0.5', wanted none"));
  EXPECT_THAT(Refusal("gates: [{name: r, test: savi, paired: true}]"), HasSubstr("paired: found 'true', wanted none"));
  EXPECT_THAT(Refusal("on_inconclusive: shrug\ngates: [{name: r, test: savi}]"),
              HasSubstr("on_inconclusive: found 'shrug', wanted warn, fail"));
  EXPECT_THAT(Refusal("gates: [savi]"), HasSubstr("found no rule, wanted a mapping"));
}

const SampleRun& Run() {
  static const SampleRun run({{"take_bottle", "pick \"it\"\n手", "good", "sf?", "sie"}});
  return run;
}

PinnedResult Pinned() { return Pin(Run().Summary({.bootstrap_replicates = 1}), "out/main"); }

/// What a rule of `fields` is told of a baseline, before there is a candidate.
std::string ToldBeforeTheRun(const std::string& fields, const PinnedResult& baseline, const std::string& top = "") {
  const GateRules rules = Read(top + "gates: [{name: r, " + fields + "}]\n");
  return MessageOf([&] { DemandBaseline(rules, baseline); });
}

/// It said how many episodes the rule takes; that it can never be held was known after these had been run.
TEST(GateRules, ThatCanNeverBeHeldAgainstTheBaselineAreRefusedBeforeTheRun) {
  const SampleRun run({{"take", "pick", "good", "-", "sf"},
                       {"take", "pick", "poor", "-", "ff"},
                       {"put", "pick", "good", "-", "sf"},
                       {"put", "pick", "poor", "-", "-"}});
  const PinnedResult pinned = Pin(run.Summary({.bootstrap_replicates = 1}), "out/main");
  const std::string test = "test: paired_mcnemar, ";
  EXPECT_THAT(ToldBeforeTheRun(test + "task: tak", pinned),
              HasSubstr("gate rule 'r': task: found 'tak', which the baseline has not, wanted one of: put, take"));
  EXPECT_THAT(ToldBeforeTheRun(test + "world: moon", pinned),
              HasSubstr("gate rule 'r': world: found 'moon', which the baseline has not, wanted one of: real, sim"));
  EXPECT_THAT(ToldBeforeTheRun(test + "baseline_policy: pick@god", pinned),
              HasSubstr("baseline_policy: found 'pick@god', wanted one of: pick@good, pick@poor"));
  EXPECT_THAT(ToldBeforeTheRun(test + "policy: pick@new", pinned),
              HasSubstr("baseline_policy: found nothing, wanted one of: pick@good, pick@poor"));
  EXPECT_THAT(ToldBeforeTheRun(test + "world: real, baseline_policy: pick@good", pinned),
              HasSubstr("found no episode of pick@good in real in the baseline, wanted some"));
  EXPECT_THAT(ToldBeforeTheRun(test + "world: sim, task: put, policy: pick@poor", pinned),
              HasSubstr("found no episode of pick@poor on task 'put' in sim in the baseline"));
  EXPECT_THAT(ToldBeforeTheRun("test: boschloo, world: sim, policy: pick@good", pinned),
              HasSubstr("task: found 2 tasks in the baseline, wanted one"));
  EXPECT_THAT(ToldBeforeTheRun(test + "world: sim, policy: pick@good", pinned, "judge: classifier\n"),
              HasSubstr("gate rule 'r': judge: found classifier, wanted the baseline's, oracle"));
}

TEST(GateRules, ThatAnyCandidateMayYetKeepAreNotRefusedBeforeTheRun) {
  PinnedResult pinned = Pinned();
  pinned.judge = "oracle,classifier:abc";
  const std::string test = "test: paired_mcnemar, ", judge = "judge: 'oracle,classifier'\n";
  for (const std::string fields : {"world: sim", "world: sim, policy: pick@new", "task: take_bottle", "margin: 0.2"})
    EXPECT_EQ(ToldBeforeTheRun(test + fields, pinned, judge), "nothing was thrown") << fields;
  EXPECT_EQ(ToldBeforeTheRun("test: error_share, world: moon, at_most: 0", pinned), "nothing was thrown")
      << "it compares with no baseline";
}

TEST(PinnedResult, IsReadAsItWasWritten) {
  const PinnedResult pinned = Pinned();
  const PinnedResult read = ReadPinned(PinnedJson(pinned), "p.json");
  EXPECT_EQ(read.sha256, pinned.sha256);
  ASSERT_EQ(read.cells.size(), 2u);
  EXPECT_EQ(read.cells[0].policy, "pick \"it\"\n手@good");
  EXPECT_EQ(read.cells[1].outcomes[1].outcome, Outcome::kInvalid);
  EXPECT_EQ(read.cells[1].outcomes[2].outcome, Outcome::kError);
  EXPECT_EQ(read.worlds.at("sim"), "sim-profile");
  EXPECT_EQ(PinnedJson(read), PinnedJson(pinned));
}

TEST(PinnedResult, ChangedByHandIsRefused) {
  nlohmann::ordered_json json = nlohmann::ordered_json::parse(PinnedJson(Pinned()));
  json["cells"][1]["outcomes"][0]["outcome"] = "failure";
  EXPECT_THAT(MessageOf([&] { ReadPinned(json.dump(), "p.json"); }),
              HasSubstr("p.json: field sha256: found " + Pinned().sha256 + ", wanted "));
  json = nlohmann::ordered_json::parse(PinnedJson(Pinned()));
  json["cells"][0]["outcomes"][0]["state"] = "41-0009";
  EXPECT_THAT(MessageOf([&] { ReadPinned(json.dump(), "p.json"); }), HasSubstr("field cells.0.initial_states_hash"));
  json = nlohmann::ordered_json::parse(PinnedJson(Pinned()));
  json["note"] = "mine";
  EXPECT_THAT(MessageOf([&] { ReadPinned(json.dump(), "p.json"); }), HasSubstr("field sha256"));
}

TEST(PinnedResult, WhatIsNoPinnedResultIsRefusedWithItsField) {
  EXPECT_THAT(MessageOf([] { ReadPinned("not json", "p.json"); }), HasSubstr("p.json: found no JSON"));
  EXPECT_THAT(MessageOf([] { ReadPinned("[]", "p.json"); }),
              HasSubstr("p.json: field format: found nothing, wanted a value"));
  EXPECT_THAT(MessageOf([] { ReadPinned("{\"format\": \"x\"}", "p.json"); }),
              HasSubstr("field format: found \"x\", wanted \"evac pinned result\""));
  nlohmann::ordered_json json = nlohmann::ordered_json::parse(PinnedJson(Pinned()));
  json["schema"] = 2;
  EXPECT_THAT(MessageOf([&] { ReadPinned(json.dump(), "p.json"); }), HasSubstr("field schema: found 2, wanted 1"));
  json["schema"] = 1;
  json["cells"][0]["outcomes"][0]["seed"] = -1;
  EXPECT_THAT(MessageOf([&] { ReadPinned(json.dump(), "p.json"); }),
              HasSubstr("field cells.0.outcomes.0.seed: found -1, wanted a whole number, 0 or more"));
  json["cells"][0]["outcomes"][0]["seed"] = 1;
  json["cells"][0]["outcomes"][1] = json["cells"][0]["outcomes"][0];
  EXPECT_THAT(MessageOf([&] { ReadPinned(json.dump(), "p.json"); }), HasSubstr("wanted each state and seed once"));
}

/// The message showed what was found, and the hash is of all of it: the process crashed where that lies deep.
TEST(PinnedResult, AMillionBracketsAreRefused) {
  const std::string deep = std::string(1'000'000, '[') + std::string(1'000'000, ']');
  EXPECT_EQ(MessageOf([&] { ReadPinned("{\"format\": " + deep + "}", "p.json"); }),
            "p.json: lists and objects lie more than 32 deep");
  std::string text = PinnedJson(Pinned());
  text.insert(text.find('{') + 1, "\"notes\": " + deep + ",");
  EXPECT_EQ(MessageOf([&] { ReadPinned(text, "p.json"); }), "p.json: lists and objects lie more than 32 deep");
}

/// A copy under another name got the decision of the first, and nothing was kept under its own.
TEST(GateRules, ACopyUnderAnotherNameIsAnotherGate) {
  const auto hash = [](const std::string& text, const char* file) {
    return ReadGateRules(Config::FromText(text, file)).hash;
  };
  const std::string nameless = "gates: [{name: r, test: savi}]\n", named = "name: nightly\n" + nameless;
  EXPECT_NE(hash(nameless, "gate.yaml"), hash(nameless, "release.yaml"));
  EXPECT_EQ(hash(nameless, "gate.yaml"), hash(nameless, "elsewhere/gate.yaml"));
  EXPECT_EQ(hash(named, "gate.yaml"), hash(named, "release.yaml")) << "it says its name";
  EXPECT_EQ(hash(named, "gate.yaml"), Config::FromText(named, "gate.yaml").ContentHash()) << "decisions that are kept";
}


/// Four successes of p on t, whose page names a scene.
RunSummary RunOnPage() {
  RunSummary run = RepeatedRun({{"t", "p", {}, {"ssss"}}});
  run.data.tasks.at(0).page = "id: t\nmujoco: {scene: t.xml}\n";
  run.data.page_hashes = {{"t", "5ce9e"}};
  run.data.run.suite_text = "suite: s\npolicy: {latency: 0.10}\n";
  return run;
}

/// What a rule is told of that run, changed, held against a baseline.
std::string Told(const std::string& rule, const PinnedResult& baseline, const std::function<void(RunData&)>& change,
                 RunSummary run = RunOnPage()) {
  change(run.data);
  const GateRules rules = Read("gates: [{name: r, world: sim, " + rule + "}]\n");
  return MessageOf([&] { Decide(rules, {run, "out", {}}, &baseline); });
}

/// The page's text alone was compared: other physics, pictures, stop rules, chunks and latencies passed without a word.
TEST(PinnedResult, OfAnotherSceneStopRulePictureChunkOrLatencyIsRefused) {
  const PinnedResult baseline = ReadPinned(PinnedJson(Pin(RunOnPage(), "out/main")), "p.json");
  for (const std::string rule : {"test: paired_mcnemar", "test: boschloo"}) {
    SCOPED_TRACE(rule);
    const auto told = [&](const std::function<void(RunData&)>& change) { return Told(rule, baseline, change); };
    EXPECT_EQ(told([](RunData&) {}), "nothing was thrown");
    EXPECT_THAT(told([](RunData& run) { run.page_hashes["t"] = "07e42"; }),
                HasSubstr("gate rule 'r': the page of task t with all files that it names: found 07e42, wanted the "
                          "baseline's, 5ce9e"));
    EXPECT_THAT(told([](RunData& run) { run.tasks[0].still.dwell_chunks = 9; }),
                HasSubstr("gate rule 'r': cameras, stop rule and limits of task t: found "));
    EXPECT_THAT(told([](RunData& run) { run.tasks[0].cameras.resize(1); }), HasSubstr("cameras, stop rule and limits"));
    EXPECT_THAT(told([](RunData& run) { run.run.suite_text += "chunk_size: 16\n"; }),
                HasSubstr("the suite's chunk_size: found 16, wanted the baseline's, 8"));
    EXPECT_THAT(told([](RunData& run) { run.run.suite_text = "suite: s\n"; }),
                HasSubstr("the suite's policy.latency: found off, wanted the baseline's, 0.1 s"));
    EXPECT_EQ(told([](RunData& run) { run.run.suite_text = "suite: s\nchunk_size: 8\npolicy: {latency: 0.1}\n"; }),
              "nothing was thrown");
    EXPECT_EQ(told([](RunData& run) { run.page_hashes.clear(); }), "nothing was thrown") << "an earlier evac's run";
  }
}

TEST(PinnedResult, OfOtherRecordingsIsRefusedOnlyWhereWhatIsDoneInThemDiffers) {
  RunSummary run = RunOnPage();
  run.data.tasks.at(0).page = "";
  run.data.page_hashes.clear();
  const PinnedResult baseline = Pin(run, "out/main");
  const auto told = [&](const std::function<void(RunData&)>& change) {
    return Told("test: boschloo", baseline, change, run);
  };
  EXPECT_EQ(told([](RunData& data) {
              data.tasks[0].max_chunks = 99;  // the longest has so many
              data.tasks[0].workspace_m.extend(Eigen::Vector3d(9, 9, 9));
            }),
            "nothing was thrown");
  EXPECT_THAT(told([](RunData& data) { data.tasks[0].still.enabled = false; }), HasSubstr("stop rule"));
  EXPECT_THAT(told([](RunData& data) { data.run.suite_text += "max_chunks: 5\n"; }),
              HasSubstr("the suite's max_chunks: found 5, wanted the baseline's, not said"));
}

TEST(PinnedResult, OfAnEarlierEvacIsComparedWithoutWhatItLacks) {
  nlohmann::ordered_json json = nlohmann::ordered_json::parse(PinnedJson(Pin(RunOnPage(), "out/main")));
  for (const char* key : {"scenes", "definitions", "settings", "sha256"}) EXPECT_EQ(json.erase(key), 1u) << key;
  json["sha256"] = Sha256Hex(json.dump());
  const PinnedResult baseline = ReadPinned(json.dump(), "old.json");
  EXPECT_EQ(nlohmann::ordered_json::parse(PinnedJson(baseline)), json);
  EXPECT_EQ(Told("test: paired_mcnemar", baseline,
                 [](RunData& run) {
                   run.page_hashes["t"] = "07e42";
                   run.tasks[0].still.dwell_chunks = 9;
                   run.run.suite_text = "suite: s\nchunk_size: 16\n";
                 }),
            "nothing was thrown");
}

}  // namespace
}  // namespace evac
