#include "apps/collect_recipe.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/error.h"
#include "core/file.h"
#include "tests/support/command.h"
#include "tests/support/temp_folder.h"

namespace evac {
namespace {

namespace fs = std::filesystem;
using testing::AllOf;
using testing::HasSubstr;

const std::string kRecipe = EVAC_SOURCE_DIR "/apps/configs/desk_recipe.yaml";

/// What is said of the desk's recipe with one field replaced.
std::string ErrorWith(const std::string& assignment) {
  try {
    ReadRecipe(kRecipe, {assignment});
  } catch (const Error& error) {
    return error.what();
  }
  return "it was read";
}

/// The page with the first of `found` replaced.
std::string With(std::string text, const std::string& found, const std::string& put) {
  const std::size_t at = text.find(found);
  EXPECT_NE(at, std::string::npos) << found;
  return at == std::string::npos ? text : text.replace(at, found.size(), put);
}

/// "visual_pick: noise-m is 3" was all that was said, of a page with a dozen behaviours.
TEST(Recipe, AnOptionThatItsPolicyRefusesIsNamedWithFileAndBehaviour) {
  EXPECT_THAT(ErrorWith("mix.3.noise_m=[0, 3]"),
              AllOf(HasSubstr(kRecipe), HasSubstr(": field mix.3: visual_pick: noise-m is 3, wanted")));
  EXPECT_THAT(ErrorWith("mix.13.does=fly"), HasSubstr(": field mix.13: explorer: found does 'fly'"));
}

/// Both ends of such ranges passed, and what was drawn between them ended the collection, or meant something else: 2^32
/// retries were none.
TEST(Recipe, WhatIsDrawnBetweenTheEndsOfARangeIsTakenToo) {
  const std::string pick = "mix.5={name: a, share: 1, policy: visual_pick, ";
  EXPECT_THAT(ErrorWith(pick + "miss_m: [0, 0.6], miss_deg: [90, 225]}"),
              HasSubstr("mix.5.miss_m: found a list, wanted numbers from -0.5 to 0.5"));
  EXPECT_THAT(ErrorWith("mix.5.miss_deg=[-1.5e308, 1.5e308]"), HasSubstr("wanted numbers from -360 to 360"));
  EXPECT_THAT(ErrorWith("mix.1.retries=[0, 4294967296]"),
              HasSubstr("mix.1.retries: found a list, wanted numbers from 0 to 5"));
  EXPECT_THAT(ErrorWith("mix.1.retries=[0, 5.49999]"), HasSubstr("from 0 to 5")) << "5.5 is drawn, and is 6";
  EXPECT_THAT(ErrorWith("mix.0.share=1e308"),
              HasSubstr("mix.0.share: found '1e308', wanted a number above 0, at most 1000000000"));
  EXPECT_EQ(ErrorWith(pick + "miss_m: [-0.5, 0.5], miss_deg: [-360, 360], retries: [0, 5]}"), "it was read");
}

/// A list of them, 8 bytes each, was made before the first began; `--episodes` had its bound.
TEST(Recipe, MoreEpisodesThanACollectionMayHaveAreRefused) {
  EXPECT_THAT(ErrorWith("episodes=10000001"), HasSubstr("field episodes: found '10000001', wanted 1 … 10000000"));
  EXPECT_EQ(ErrorWith("episodes=10000000"), "it was read");
}

/// The hash is of the recipe for any number of them, and that number was set in the page: of an alias it could not be.
TEST(Recipe, ItsNumberOfEpisodesMayBeAnothersByAnAlias) {
  const TempFolder folder;
  std::string text = ReadFile(kRecipe);
  while (text.find("../../") != std::string::npos) text = With(text, "../../", EVAC_SOURCE_DIR "/");
  WriteFileAtomically(folder / "plain.yaml", text);
  text = With(With(text, "episodes: 1000", "episodes: &n 8"), "chunk_size: 8", "chunk_size: *n");
  WriteFileAtomically(folder / "alias.yaml", text);
  const Recipe alias = ReadRecipe(folder / "alias.yaml", {});
  EXPECT_EQ(alias.episodes, 8);
  EXPECT_EQ(alias.hash, ReadRecipe(folder / "plain.yaml", {}).hash);
}

/// A thousand episodes were collected of a camera on the gripper that no reader takes to be there.
TEST(Recipe, ACameraThatItsRecordingsCannotSayIsRefused) {
  const TempFolder folder;
  const fs::path sim = EVAC_SOURCE_DIR "/worldmodel/sim", page = folder / "bottle.yaml";
  for (const char* file : {"take_bottle.xml", "robot.xml"}) fs::copy(sim / "scenes" / file, folder / file);
  WriteFileAtomically(page, With(ReadFile(sim / "scenes/take_bottle.yaml"), "name: hand_right", "name: wrist"));
  EXPECT_THAT(ErrorWith("tasks.0.page=" + page.string()),
              AllOf(HasSubstr("bottle.yaml"), HasSubstr("camera 'wrist' is mounted on right_gripper")));
}

/// It was known in the first episode, when the folder was that recipe's: once the page was mended, another --out had to
/// be taken.
TEST(CollectCommand, AMistakeInTheProfileOrATaskIsSaidBeforeTheFolderIsClaimed) {
  const TempFolder folder;
  const fs::path sim = EVAC_SOURCE_DIR "/worldmodel/sim", profile = folder / "real.yaml", page = folder / "bottle.yaml",
                 cup = folder / "cup.yaml";
  for (const char* file : {"take_bottle.xml", "robot.xml"}) fs::copy(sim / "scenes" / file, folder / file);
  WriteFileAtomically(profile, With(ReadFile(sim / "profiles/real.yaml"), "mass: 1.2", "mass: 120"));
  WriteFileAtomically(page, With(ReadFile(sim / "scenes/take_bottle.yaml"), "chance: 0.75", "chance: 75"));
  WriteFileAtomically(cup, With(ReadFile(sim / "scenes/take_bottle.yaml"), "id: take_bottle", "id: take_cup"));
  for (const auto& [set, what] : std::vector<std::pair<std::string, std::string>>{
           {"profile=" + profile.string(), "real.yaml:6: field physics.mass: found '120'"},
           {"tasks.0.page=" + page.string(), "field mujoco.clutter.chance: found '75'"},
           {"tasks.0.page=" + cup.string(), ": field mix.0: visual_pick: found task take_cup, wanted take_bottle,"}}) {
    const CommandResult refused =
        RunCommand({Binary("evac"), "collect", kRecipe, "--out", folder / "all", "--episodes", "1", "--set", set});
    EXPECT_EQ(refused.exit_code, 2);
    EXPECT_THAT(refused.err, HasSubstr(what));
    EXPECT_FALSE(fs::exists(folder / "all/collection.json"));
  }
}

/// It was copied for the message, bracket by bracket within each other, until the process crashed.
TEST(CollectCommand, AMillionBracketsInTheFoldersClaimAreAnotherCollection) {
  const TempFolder folder;
  const std::string open(1'000'000, '['), close(1'000'000, ']');
  WriteFileAtomically(folder / "collection.json", "{\"version\": " + open + close + ", \"seed\": \"7\"}");
  const CommandResult refused =
      RunCommand({Binary("evac"), "collect", kRecipe, "--out", folder.path(), "--episodes", "1"});
  EXPECT_EQ(refused.exit_code, 2);
  EXPECT_THAT(refused.err, testing::AllOf(HasSubstr("collection.json: holds another collection: "), HasSubstr("more than 32 deep")));
}

}  // namespace
}  // namespace evac
