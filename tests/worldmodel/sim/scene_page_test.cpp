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

TEST(ScenePage, NumbersAreFiniteAndNoBodyIsPlacedTwice) {
  const auto complaint = [](const std::string& found, const std::string& put) {
    Task task = test::ReadTask("take_bottle");
    const std::size_t at = task.page.find(found);
    EXPECT_NE(at, std::string::npos) << found;
    const std::size_t end = task.page.find_first_of(",}\n", at);
    task.page.replace(at, end - at, put);
    try {
      ReadScenePage(task);
    } catch (const Error& error) {
      return std::string(error.what());
    }
    return std::string("no complaint");
  };
  EXPECT_THAT(complaint("z_m: ", "z_m: .nan"), HasSubstr("wanted a number"));
  EXPECT_THAT(complaint("spread_m: ", "spread_m: .inf"), HasSubstr("wanted a number"));
  EXPECT_THAT(complaint("body: bottle", "body: box"), HasSubstr("wanted another body than those before it"));
}

/// Its name was put into the page as it stands: this one made the page no YAML, others another body or none.
TEST(ScenePage, AThingOfAnyNameIsTakenAway) {
  Task task = test::ReadTask("take_bottle");
  const std::string before = "body: bottle";
  task.page.replace(task.page.find(before), before.size(), R"(body: "a \"b\": [c}, #~")");
  const std::string name = R"(a "b": [c}, #~)";
  ASSERT_EQ(ReadScenePage(task).placements.at(1).body, name);
  const Placement away = ReadScenePage(WithoutObject(task, name)).placements.at(1);
  EXPECT_EQ(away.body, name);
  EXPECT_EQ(away.inside, "");
  EXPECT_EQ(away.x_m.low, 3);
}

TEST(ScenePage, AnEndlessAttributeIsReadWithoutRecursion) {
  EXPECT_THAT(RefusalWith("<include file=\"" + std::string(5'000'000, 'a') + "\"/>"), HasSubstr("wanted that file"));
  EXPECT_EQ(RefusalWith("<include file=\"" + std::string(100, ' ')), "");
}

}  // namespace
}  // namespace evac::sim
