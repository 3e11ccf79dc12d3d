#include "worldmodel/sim/scene_page.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <string>

#include "core/error.h"
#include "core/file.h"
#include "core/task_page.h"
#include "tests/support/temp_folder.h"
#include "tests/worldmodel/sim/sim_test_support.h"

namespace evac::sim {
namespace {

using ::testing::HasSubstr;

/// What is said of the bottle's page when its scene holds one more line.
std::string RefusalWith(const std::string& line) {
  const TempFolder folder;
  const std::filesystem::path scenes = std::filesystem::path(EVAC_SOURCE_DIR) / "worldmodel/sim/scenes";
  std::filesystem::copy(scenes, folder / "scenes", std::filesystem::copy_options::recursive);
  const std::filesystem::path xml = folder / "scenes/take_bottle.xml";
  WriteFileAtomically(xml, ReadFile(xml) + line);
  try {
    ReadScenePage(ReadTaskPage(folder / "scenes/take_bottle.yaml"));
  } catch (const Error& error) {
    return error.what();
  }
  return "";
}

TEST(ScenePage, NamesEveryFileThatItsSceneIncludesBecauseTheSuitesHashCoversThose) {
  EXPECT_EQ(RefusalWith(""), "");
  EXPECT_THAT(RefusalWith("<include file=\"shelf.xml\"/>"), HasSubstr("includes 'shelf.xml', wanted that file in the list"));
  EXPECT_THAT(RefusalWith("<include\n  file = 'shelf.xml'/>"), HasSubstr("includes 'shelf.xml'"));
}

TEST(ScenePage, AnEndlessAttributeIsReadWithoutRecursion) {
  EXPECT_THAT(RefusalWith("<include file=\"" + std::string(5'000'000, 'a') + "\"/>"), HasSubstr("wanted that file"));
  EXPECT_EQ(RefusalWith("<include file=\"" + std::string(100, ' ')), "");
}

}  // namespace
}  // namespace evac::sim
