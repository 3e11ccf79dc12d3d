#include "policies/spec.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

namespace evac {
namespace {

using testing::HasSubstr;

PolicySpec Harness() {
  return {.name = "evac",
          .arms = {"left", "right"},
          .period_s = 0.1,
          .chunk_size = 8,
          .cameras = {{"head", 192, 128}, {"hand_left", 96, 64}}};
}

/// Needs nothing in particular.
PolicySpec Easy() { return {.name = "easy", .checkpoint = "a", .chunk_size = 8}; }

TEST(Spec, APolicyWithoutWishesFits) { EXPECT_TRUE(Compare(Harness(), Easy()).empty()); }

TEST(Spec, ALongerChunkFitsAShorterOneDoesNot) {
  PolicySpec policy = Easy();
  policy.chunk_size = 50;
  EXPECT_TRUE(Compare(Harness(), policy).empty());
  policy.chunk_size = 7;
  ASSERT_EQ(Compare(Harness(), policy).size(), 1u);
  EXPECT_EQ(Compare(Harness(), policy)[0].field, "chunk_size");
}

TEST(Spec, APolicyThatMustKnowWhatWasExecutedRefusesALongerChunk) {
  PolicySpec policy = Easy();
  policy.needs = {"whole_chunks"};
  EXPECT_TRUE(Compare(Harness(), policy).empty());
  policy.chunk_size = 9;
  EXPECT_EQ(Compare(Harness(), policy).size(), 1u);
}

TEST(Spec, EveryDifferenceIsNamed) {
  const std::vector<std::pair<std::string, void (*)(PolicySpec&)>> changes = {
      {"action_space", [](PolicySpec& s) { s.action_space = "delta"; }},
      {"frame", [](PolicySpec& s) { s.frame = "gripper"; }},
      {"quaternion_order", [](PolicySpec& s) { s.quaternion_order = "wxyz"; }},
      {"image_format", [](PolicySpec& s) { s.image_format = "BGR"; }},
      {"gripper", [](PolicySpec& s) { s.gripper_open = 1, s.gripper_closed = 0; }},
      {"gripper", [](PolicySpec& s) { s.gripper_closed = 120; }},
      {"arms",
       [](PolicySpec& s) {
         s.arms = {"right", "left"};
       }},
      {"period", [](PolicySpec& s) { s.period_s = 1.0 / 30; }},
      {"cameras", [](PolicySpec& s) { s.cameras = {{"hand_right"}}; }},
      {"cameras",
       [](PolicySpec& s) {
         s.cameras = {{"head", 224, 224}};
       }},
      {"needs", [](PolicySpec& s) { s.needs = {"depth"}; }},
  };
  for (const auto& [field, change] : changes) {
    PolicySpec policy = Easy();
    change(policy);
    const auto mismatches = Compare(Harness(), policy);
    ASSERT_EQ(mismatches.size(), 1u) << field;
    EXPECT_EQ(mismatches[0].field, field);
    EXPECT_NE(mismatches[0].why, "");
    EXPECT_THAT(SideBySide(Harness(), policy), HasSubstr("* " + field));
  }
}

TEST(Spec, ThePeriodsOfTenHertzAreThoseOfTenHertz) {
  PolicySpec policy = Easy();
  policy.period_s = 3 * (1.0 / 30);
  EXPECT_TRUE(Compare(Harness(), policy).empty());
}

TEST(Spec, ACameraOfAnySizeIsFoundAmongOthers) {
  PolicySpec policy = Easy();
  policy.cameras = {{"hand_left", 0, 0}};
  EXPECT_TRUE(Compare(Harness(), policy).empty());
}

TEST(Spec, TheTableShowsBothSidesInColumns) {
  PolicySpec policy = Easy();
  policy.period_s = 0.05;
  policy.needs = {"images"};
  EXPECT_EQ(SideBySide(Harness(), policy),
            "                    this run                       the policy\n"
            "  name              evac                           easy\n"
            "  checkpoint                                       a\n"
            "  action_space      absolute                       absolute\n"
            "  frame             base                           base\n"
            "  quaternion_order  xyzw                           xyzw\n"
            "  image_format      RGB                            RGB\n"
            "  gripper           0 open … 1 closed              0 open … 1 closed\n"
            "  arms              left, right                    any\n"
            "* period            0.1 s                          0.05 s\n"
            "  chunk_size        8                              8\n"
            "  cameras           head 192x128, hand_left 96x64  all\n"
            "  needs                                            images\n"
            "period: the policy's targets are another time apart than the world executes them\n");
}

TEST(Spec, JsonKeepsAllOfIt) {
  PolicySpec spec = Harness();
  spec.checkpoint = "step \"40k\" é";
  spec.needs = {"images", "arms"};
  EXPECT_EQ(nlohmann::json::parse(ToJson(spec)), nlohmann::json::parse(R"({
    "name": "evac", "checkpoint": "step \"40k\" é", "action_space": "absolute", "frame": "base",
    "quaternion_order": "xyzw", "image_format": "RGB", "gripper_open": 0.0, "gripper_closed": 1.0,
    "arms": ["left", "right"], "period_s": 0.1, "chunk_size": 8, "needs": ["arms", "images"],
    "cameras": [{"name": "head", "width_px": 192, "height_px": 128},
                {"name": "hand_left", "width_px": 96, "height_px": 64}]})"));
}

TEST(Spec, JsonOfANameThatIsNoTextIsJsonAllTheSame) {
  PolicySpec spec = Harness();
  spec.name = "\xff";
  EXPECT_EQ(nlohmann::json::parse(ToJson(spec)).at("name"), "\uFFFD");
}

}  // namespace
}  // namespace evac
