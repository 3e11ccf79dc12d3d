#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <functional>
#include <nlohmann/json.hpp>

#include "core/error.h"
#include "reports/gate_baseline.h"
#include "reports/gate_rules.h"
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

}  // namespace
}  // namespace evac
