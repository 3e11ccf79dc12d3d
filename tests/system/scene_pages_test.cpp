#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>

#include "apps/evaluate.h"
#include "apps/factory.h"
#include "apps/recorded_suite.h"
#include "core/error.h"
#include "core/file.h"
#include "harness/suite_hash.h"
#include "tests/support/synthetic_recording.h"
#include "tests/support/temp_folder.h"
#include "tests/system/run_support.h"

namespace evac::system_test {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;

const std::filesystem::path kScenes = std::filesystem::path(EVAC_SOURCE_DIR) / "worldmodel/sim/scenes";

TEST(ScenePages, TwoArmsAndThreeCamerasGoThroughTheWholeHarnessAndTheOracle) {
  const TempFolder folder;
  const CommandResult run = RunCommand(RunWords(kSmall, folder / "run",
                                                {"tasks=[" + (kScenes / "take_bottle_two_arms.yaml").string() + "]",
                                                 "initial_states.count=1", "initial_states.seed=41"}));
  ASSERT_EQ(run.exit_code, 0) << run.err;
  const std::string list = List(folder / "run");
  EXPECT_THAT(list, HasSubstr("take_bottle_two_arms"));
  EXPECT_THAT(list, AllOf(HasSubstr("success"), HasSubstr("failure"))) << "visual_pick masters it, hold does not";
}

TEST(ScenePages, ARubricThatNamesABodyTheSceneHasNotIsRefusedBeforeTheFirstEpisode) {
  const TempFolder folder;
  std::filesystem::copy(kScenes, folder / "scenes", std::filesystem::copy_options::recursive);
  std::string page = ReadFile(folder / "scenes" / "take_ham.yaml");
  page.replace(page.find("b: ham,"), 7, "b: jam,");
  WriteFileAtomically(folder / "scenes" / "take_ham.yaml", page);
  const CommandResult result = RunCommand(
      {Binary("evac"), "validate", kSmall, "--set", "tasks=[" + (folder / "scenes" / "take_ham.yaml").string() + "]"});
  EXPECT_EQ(result.exit_code, 2);
  EXPECT_THAT(result.err, AllOf(HasSubstr("take_ham.yaml"), HasSubstr("rubric"), HasSubstr("jam")));
  const CommandResult run = RunCommand(
      RunWords(kSmall, folder / "run", {"tasks=[" + (folder / "scenes" / "take_ham.yaml").string() + "]"}));
  EXPECT_EQ(run.exit_code, 2);
  EXPECT_THAT(run.err, AllOf(HasSubstr("take_ham.yaml"), HasSubstr("rubric"), HasSubstr("jam")));
}

/// Hours after the suite was read its profile and scenes were read again, and episodes of others stored under its hash.
TEST(ScenePages, WhatWasWrittenToBetweenTheReadingOfTheSuiteAndTheWorldsTurnIsRefused) {
  const TempFolder folder;
  for (const char* file : {"take_bottle.yaml", "take_bottle.xml", "robot.xml"})
    std::filesystem::copy(kScenes / file, folder / file);
  std::filesystem::copy(kScenes / "../profiles/real.yaml", folder / "real.yaml");
  const Suite suite = ReadSuite(kSmall, {"tasks=[" + (folder / "take_bottle.yaml").string() + "]",
                                         "worlds.0.profile=" + (folder / "real.yaml").string()});
  const SuiteWorld& world = suite.worlds.front();
  EXPECT_NE(MakeWorld(world, suite, nullptr), nullptr);
  const auto is_refused = [&](const std::string& file, const std::string& page, const auto& change) {
    const std::string before = ReadFile(folder / file);
    WriteFileAtomically(folder / file, change(before));
    try {
      MakeWorld(world, suite, nullptr);
      ADD_FAILURE() << file << " was taken";
    } catch (const Error& error) {
      EXPECT_EQ(error.exit_code(), ExitCode::kInvalidInput);
      EXPECT_THAT(error.what(), AllOf(HasSubstr((folder / page).string() + ": it, or a file that it names, is another"),
                                      HasSubstr("wanted " + suite.page_hashes.at(folder / page)),
                                      HasSubstr("found SHA-256 " + PageHash(folder / page))));
    }
    WriteFileAtomically(folder / file, before);
    EXPECT_NO_THROW(MakeWorld(world, suite, nullptr)) << "as it was";
  };
  const auto with_a_comment = [](const std::string& text) { return text + "<!-- later -->\n"; };
  is_refused("take_bottle.xml", "take_bottle.yaml", with_a_comment);
  is_refused("robot.xml", "take_bottle.yaml", with_a_comment);
  const auto with_a_field = [](const char* found, const char* put) {
    return [=](std::string text) { return text.replace(text.find(found), std::string(found).size(), put); };
  };
  is_refused("take_bottle.yaml", "take_bottle.yaml", with_a_field("chance: 0.75", "chance: 0.5"));
  is_refused("real.yaml", "real.yaml", with_a_field("mass: 1.2", "mass: 1.3"));
}

/// Each of several is read again where its episode begins, hours later: what was stored bore the suite's hash.
TEST(RecordedStart, OfARecordingThatWasWrittenToSinceTheSuiteWasReadEndsTheRun) {
  const TempFolder folder;
  const auto write = [&](const char* name, int steps) {
    SyntheticClip clip(steps);
    std::ranges::fill(clip.grippers, 60.0F);  // half closed
    clip.Write(OneFolder(folder / "many" / name));
  };
  for (const char* name : {"a", "b"}) write(name, 25);
  WriteText(folder / "suite.yaml",
            "suite: recorded\nrecording: many\nworlds: [{name: echo, type: echo}]\nlanes: 1\nerror_budget: 1\n"
            "policies: [{name: hold, command: [evac-policy, hold]}]\n");
  Suite suite = ReadSuite(folder / "suite.yaml", {});
  FillInRecordedTask(suite);
  write("b", 28);
  Suite anew = ReadSuite(folder / "suite.yaml", {});
  EXPECT_NO_THROW(FillInRecordedTask(anew)) << "who reads the suite now has the new one";
  Store store = Store::CreateOrContinue(
      folder / "run", {.suite_text = suite.text, .suite_hash = suite.hash, .suite_path = "", .evac_version = "1"});
  EXPECT_THAT([&] { Evaluate(suite, store, {}); },
              testing::ThrowsMessage<Error>(
                  AllOf(HasSubstr("many/b"), HasSubstr("it is another file than when the suite was read"))));
  ASSERT_EQ(store.Episodes().size(), 1u);
  EXPECT_EQ(store.Episodes().front().key.pair.initial_state, "a");
}

}  // namespace
}  // namespace evac::system_test
