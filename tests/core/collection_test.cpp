#include "core/collection.h"

#include <gmock/gmock.h>

#include <cmath>
#include <limits>

#include "core/error.h"
#include "core/file.h"
#include "tests/support/temp_folder.h"

namespace evac {
namespace {

using testing::HasSubstr;

CollectedEpisode Row() {
  CollectedEpisode row;
  row.index = 12;
  row.task = "take_ham";
  row.episode = "000012";
  row.initial_state = "collect-7-00001";
  row.state_seed = 0xFFFFFFFFFFFFFFF1ULL;
  row.world_seed = 3;
  row.policy_seed = 4;
  row.behaviour = "drop";
  row.policy = "visual_pick";
  row.parameters = {{"noise_m", 0.0125}, {"retries", 0}};
  row.fate = "drop";
  row.reason = "stage place was not reached; nearest \"at\" 3.1 s, 4";
  row.stop = "still";
  row.frames = 81;
  row.contact_frames = 18;
  row.video_scale = 2;
  return row;
}

TEST(Collection, ARowComesBackAsItWasWritten) {
  const CollectedEpisode row = Row();
  const CollectedEpisode read = ParseCollected(CollectedJson(row), "row");
  EXPECT_EQ(CollectedJson(read), CollectedJson(row));
  EXPECT_EQ(read.state_seed, row.state_seed) << "64 bits, not a double's 53";
  EXPECT_EQ(read.parameters, row.parameters);
}

TEST(Collection, ACellWithCommasAndQuotesStaysOneCell) {
  EXPECT_THAT(CollectedCsvLine(Row()), HasSubstr(",\"stage place was not reached; nearest \"\"at\"\" 3.1 s, 4\"\n"));
}

TEST(Collection, ABrokenRowIsRefusedByName) {
  for (const std::string text : {"", "[]", "{\"index\": 1}", "{\"index\": \"one\"}"}) {
    try {
      ParseCollected(text, "rows/a/1.json");
      ADD_FAILURE() << text << " was read";
    } catch (const Error& error) {
      EXPECT_THAT(error.what(), HasSubstr("rows/a/1.json"));
    }
  }
}

TEST(Collection, TruthIsReadForTheFramesAndViewsItWasWrittenForAndNoOthers) {
  const TempFolder folder;
  const EpisodeTruth truth{2, {1, 2, 3, 4, 5, 6, std::numeric_limits<float>::quiet_NaN(), 8}, {0, 1}};
  WriteTruth(folder / "truth.safetensors", truth);
  const EpisodeTruth read = ReadTruth(folder / "truth.safetensors", 2, 2);
  EXPECT_EQ(read.contact, truth.contact);
  EXPECT_EQ(read.At(1, 0)[1], 6);
  EXPECT_TRUE(std::isnan(read.At(1, 1)[0]));
  EXPECT_THROW(ReadTruth(folder / "truth.safetensors", 3, 2), Error);
  EXPECT_THROW(ReadTruth(folder / "truth.safetensors", 2, 1), Error);
}

TEST(Collection, AFolderOfATreeKnowsItsRow) {
  const TempFolder folder;
  const TreePlace place{folder.path(), "take_ham", "000012"};
  EXPECT_FALSE(RowOf(place.Folder()));
  MakeFolders(RowPath(place).parent_path());
  WriteFileAtomically(RowPath(place), CollectedJson(Row()));
  ASSERT_TRUE(RowOf(place.Folder()));
  EXPECT_EQ(RowOf(place.Folder())->fate, "drop");
  EXPECT_FALSE(RowOf(folder / "elsewhere"));
}

}  // namespace
}  // namespace evac
