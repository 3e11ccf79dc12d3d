#include "core/collection.h"

#include <gmock/gmock.h>

#include <cmath>
#include <limits>
#include <span>

#include "core/error.h"
#include "core/file.h"
#include "core/tensor_file.h"
#include "tests/support/temp_folder.h"

namespace evac {
namespace {

using testing::AllOf;
using testing::HasSubstr;

template <typename Call>
std::string MessageOf(const Call& call) {
  try {
    call();
  } catch (const Error& error) {
    return error.what();
  }
  return "no error";
}

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

/// They may have any name: one with a comma moved all that follows by a column.
TEST(Collection, NamesOfABehaviourAndOfAThingAreOneCellEach) {
  CollectedEpisode row = Row();
  row.behaviour = "drop, \"late\"";
  row.without = "ham, the second";
  EXPECT_THAT(CollectedCsvLine(row), HasSubstr(",\"ham, the second\",0,drop,"));
  EXPECT_THAT(CollectedCsvLine(row), HasSubstr(",collect-7-00001,\"drop, \"\"late\"\"\",visual_pick,"));
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

TEST(Collection, ARowsNumbersAreTakenAsTheyStandOrNotAtAll) {
  for (const auto& [field, found] : std::vector<std::pair<std::string, std::string>>{
           {"frames", "1e300"}, {"frames", "80.9"}, {"frames", "4294967377"}, {"outcome", "0.5"}, {"outcome", "2"},
           {"index", "18446744073709551615"}, {"state_seed", "\"-5\""}, {"world_seed", "\"3 or 4\""}}) {
    std::string text = CollectedJson(Row());
    const std::size_t at = text.find("\"" + field + "\":") + field.size() + 3;
    text.replace(at, text.find_first_of(",}", at) - at, found);
    EXPECT_THAT(MessageOf([&] { ParseCollected(text, "rows/a/1.json"); }),
                AllOf(HasSubstr("rows/a/1.json: "), HasSubstr(field.ends_with("seed") ? "seed" : field)))
        << found;
  }
}

/// The message showed all of it, and what writes JSON calls itself at every bracket: the process crashed.
TEST(Collection, AMillionBracketsWhereANumberShouldBeAreRefusedInAWord) {
  const std::string text = "{\"index\": " + std::string(1'000'000, '[') + std::string(1'000'000, ']') + "}";
  EXPECT_THAT(MessageOf([&] { ParseCollected(text, "rows/a/1.json"); }),
              testing::AllOf(testing::HasSubstr("rows/a/1.json: no row of a collection"),
                             testing::HasSubstr("more than 32 deep")));
}

TEST(Collection, OnlyAnEpisodeThatDivergedHasNoFrames) {
  CollectedEpisode row = Row();
  row.stop = row.fate = "diverged";
  row.reason = "the bottle went away at 3e9 m/s";
  row.frames = row.contact_frames = 0;
  EXPECT_EQ(CollectedJson(ParseCollected(CollectedJson(row), "row")), CollectedJson(row));
  const auto error_of = [&](const std::string& stop, int frames) {
    row.stop = stop;
    row.frames = frames;
    return MessageOf([&] { ParseCollected(CollectedJson(row), "rows/a/1.json"); });
  };
  EXPECT_EQ(error_of("still", 0), "rows/a/1.json: frames is 0, wanted 1 or more of an episode whose stop is still");
  EXPECT_THAT(error_of("max_chunks", -1), HasSubstr("frames is -1, wanted 1 or more"));
  EXPECT_EQ(error_of("diverged", 25), "rows/a/1.json: frames is 25, wanted 0 of an episode whose stop is diverged");
}

/// Two frames of two cameras.
EpisodeTruth Truth() {
  return {{"head", "hand_right"}, {1, 2, 3, 4, 5, 6, std::numeric_limits<float>::quiet_NaN(), 8}, {0, 1}};
}

std::vector<Camera> Cameras(const std::vector<std::string>& names) {
  std::vector<Camera> cameras(names.size());
  for (std::size_t i = 0; i < names.size(); ++i) cameras[i].name = names[i];
  return cameras;
}

TEST(Collection, TruthIsReadForTheFramesItWasWrittenForAndNoOthers) {
  const TempFolder folder;
  WriteTruth(folder / "truth.safetensors", Truth());
  const EpisodeTruth read = ReadTruth(folder / "truth.safetensors", 2, Cameras({"head", "hand_right"}));
  EXPECT_EQ(read.contact, Truth().contact);
  EXPECT_EQ(read.cameras, Truth().cameras);
  EXPECT_EQ(read.At(1, 0)[1], 6);
  EXPECT_TRUE(std::isnan(read.At(1, 1)[0]));
  EXPECT_THROW(ReadTruth(folder / "truth.safetensors", 3, Cameras({"head", "hand_right"})), Error);
}

TEST(Collection, TruthIsReadByTheNamesOfItsCameras) {
  const TempFolder folder;
  const std::filesystem::path path = folder / "truth.safetensors";
  WriteTruth(path, Truth());
  const EpisodeTruth turned = ReadTruth(path, 2, Cameras({"hand_right", "head"}));
  EXPECT_EQ(turned.cameras, (std::vector<std::string>{"hand_right", "head"}));
  EXPECT_EQ(std::vector(turned.At(0, 0), turned.At(0, 0) + 4), (std::vector<float>{3, 4, 1, 2}));
  EXPECT_TRUE(std::isnan(turned.At(1, 0)[0]));
  EXPECT_EQ(turned.At(1, 1)[0], 5);
  EXPECT_EQ(ReadTruth(path, 2, Cameras({"head"})).object_px, (std::vector<float>{1, 2, 5, 6}));
  EXPECT_EQ(MessageOf([&] { ReadTruth(path, 2, Cameras({"head", "hand_left"})); }),
            path.string() + ": cameras are head,hand_right, wanted hand_left among them");
}

TEST(Collection, TruthThatNamesNoCamerasIsReadWhereItCanOnlyBeOfThese) {
  const TempFolder folder;
  const std::filesystem::path path = folder / "truth.safetensors";
  const float object_px[] = {1, 2, 3, 4};
  const std::uint8_t contact = 1;
  const TensorView tensors[] = {{{"object_px", TensorType::kF32, {1, 2, 2}}, std::as_bytes(std::span(object_px))},
                                {{"contact", TensorType::kU8, {1}}, std::as_bytes(std::span(&contact, 1))}};
  WriteTensorFile(path, tensors, {{"format", "evac-truth"}, {"version", "1"}});
  EXPECT_EQ(ReadTruth(path, 1, Cameras({"head", "hand_right"})).object_px, (std::vector<float>{1, 2, 3, 4}));
  const std::vector<std::string> fewer = {"head"}, turned = {"hand_right", "head"};
  for (const auto& names : {fewer, turned}) {
    EXPECT_THAT(MessageOf([&] { ReadTruth(path, 1, Cameras(names)); }),
                AllOf(HasSubstr(path.string()), HasSubstr("which cameras its 2 views are of"), HasSubstr(names[0]),
                      HasSubstr("collect anew")));
  }
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
