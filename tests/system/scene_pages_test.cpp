#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>

#include "core/file.h"
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

}  // namespace
}  // namespace evac::system_test
