#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <limits>
#include <nlohmann/json.hpp>
#include <optional>
#include <set>

#include "apps/collect_recipe.h"
#include "core/collection.h"
#include "core/file.h"
#include "core/hash.h"
#include "core/store_lock.h"
#include "core/tensor_file.h"
#include "harness/suite.h"
#include "reports/csv.h"
#include "tests/support/command.h"
#include "tests/support/late_recording.h"
#include "tests/support/synthetic_recording.h"
#include "tests/support/temp_folder.h"

namespace evac {
namespace {

namespace fs = std::filesystem;
using testing::AllOf;
using testing::HasSubstr;
using testing::Not;

/// Two-step chunks of small pictures, one view.
constexpr const char* kTiny = R"(
chunk: 2
memory: 2
image_height_px: 32
image_width_px: 48
unet: {model_channels: 32, channel_mult: [1, 2], num_res_blocks: 1, attention_resolutions: [1, 2], num_head_channels: 16,
       context_dim: 32, init_attention_heads: 2}
vae: {channels: 32, channel_mult: [1, 1], num_res_blocks: 1}
action_resampler: {embedding_dim: 14, queries: 3, dim: 32, depth: 1, dim_head: 16, heads: 2, output_dim: 32}
image_resampler: {embedding_dim: 32, queries: 4, dim: 32, depth: 1, dim_head: 16, heads: 2, output_dim: 32}
image_encoder: {width: 32, layers: 1, head_width: 16, patch_px: 14, image_px: 28, embed_dim: 16, vocabulary: 8}
)";

class PackCommand : public testing::Test {
 protected:
  PackCommand() { WriteText(folder_ / "tiny.yaml", kTiny); }

  /// A real-looking two-armed recording of 9 steps at 30 Hz: three at 10 Hz.
  SyntheticClip Good() const { return SyntheticClip(9); }
  /// The same without a left arm.
  SyntheticClip OneArmed() const {
    SyntheticClip clip = Good();
    clip.LoseLeftArm();
    return clip;
  }
  void Add(const std::string& name, const SyntheticClip& clip) { clip.Write(OneFolder(folder_ / ("data/" + name))); }

  /// Below collected/ an episode of a collection, of two arms that are one step behind what they are told.
  void AddCollected(const std::string& episode, bool says_told = true) const {
    const TreePlace place{folder_ / "collected", "carry", episode};
    WriteLateRecording(place, says_told);
    WriteTruth(TruthPath(place), {{"head"}, std::vector<float>(10, 1), std::vector<std::uint8_t>(5, 0)});
    CollectedEpisode row;
    row.task = place.task;
    row.episode = row.initial_state = episode;
    row.stop = "still";
    row.frames = 5;
    WriteText(RowPath(place), CollectedJson(row));
  }

  std::vector<std::string> Words(const std::string& out, const std::vector<std::string>& more = {},
                                 const std::vector<std::string>& inputs = {"data"}) const {
    std::vector<std::string> words = {Binary("evac"), "pack"};
    for (const std::string& input : inputs) words.push_back(folder_ / input);
    const std::vector<std::string> always = {"--out", folder_ / out, "--config", folder_ / "tiny.yaml", "--clips-per-shard",
                                             "2", "--holdout", "0"};
    words.insert(words.end(), always.begin(), always.end());
    words.insert(words.end(), more.begin(), more.end());
    return words;
  }
  TensorMetadata Said(const std::string& out) const {
    return TensorFile::Open(folder_ / out / "shard_00000.safetensors").metadata();
  }
  std::string HashesOf(const std::string& out) const {
    std::string all;
    std::set<fs::path> files;
    for (const auto& entry : fs::directory_iterator(folder_ / out)) {
      if (entry.path().filename() != "lock") files.insert(entry.path());  // holds the number of the last process
    }
    for (const fs::path& file : files) all += file.filename().string() + " " + Sha256HexOfFile(file) + "\n";
    return all;
  }

  TempFolder folder_;
};

TEST_F(PackCommand, LeavesBrokenRecordingsOutAndCountsThemByKind) {
  Add("good", Good());
  SyntheticClip cut = Good();
  cut.frames = 5;
  Add("short_video", cut);
  SyntheticClip lost = Good();
  lost.positions_m[7] = std::numeric_limits<double>::quiet_NaN();
  Add("not_finite", lost);
  SyntheticClip slipped = Good();
  slipped.slip_m = 0.2;
  Add("moving", slipped);
  Add("no_camera", Good());
  fs::remove(folder_ / "data/no_camera/head_color.mp4");
  const CommandResult result = RunCommand(Words("out"));
  ASSERT_EQ(result.exit_code, 0) << result.err;
  EXPECT_THAT(result.err, AllOf(HasSubstr("4 recordings left out"), HasSubstr("1 missing_camera"),
                                HasSubstr("1 moving_camera"), HasSubstr("1 not_finite"), HasSubstr("1 short_video")));
  const std::string table = ReadFile(folder_ / "out/left_out.csv");
  EXPECT_THAT(table, AllOf(HasSubstr("short_video"), HasSubstr("5 frames, wanted one for each of the 9 steps")));
}

/// They were in no shard, and neither counted nor in the table.
TEST_F(PackCommand, CountsClipsWithoutTheArmsTrackAndNamesFoldersThatItDoesNotLookInto) {
  for (const char* name : {"good", "dead", "day2/0001"}) Add(name, Good());
  fs::remove(folder_ / "data/dead/proprio_stats.h5");
  const CommandResult result = RunCommand(Words("out"));
  ASSERT_EQ(result.exit_code, 0) << result.err;
  EXPECT_THAT(result.err, AllOf(HasSubstr("1 recordings left out: 1 broken_track"),
                                HasSubstr("data/day2: no recording lies in it, and none is looked for below it")));
  EXPECT_THAT(ReadFile(folder_ / "out/left_out.csv"), AllOf(HasSubstr("data/dead"), HasSubstr("found head_color.mp4")));
}

/// All cameras were read to know the first one's name, and the way round was not named.
TEST_F(PackCommand, ABrokenWristCameraIsInTheWayOfThoseAloneWhoPackIt) {
  SyntheticClip clip = Good();
  clip.cameras = {"head", "hand_left", "hand_right"};
  for (const char* name : {"a", "b"}) {
    Add(name, clip);
    fs::remove(folder_ / "data" / name / "hand_left_color.mp4");
  }
  const CommandResult head = RunCommand(Words("head"));
  ASSERT_EQ(head.exit_code, 0) << head.err;
  EXPECT_EQ(Said("head").at("cameras"), "head");
  WriteText(folder_ / "tiny.yaml", std::string(kTiny) + "views: 2\n");
  const CommandResult two = RunCommand(Words("two"));
  EXPECT_EQ(two.exit_code, 2);
  EXPECT_THAT(two.err, AllOf(HasSubstr("no recording's first 2 cameras can be read"),
                             HasSubstr("camera hand_left has no video"), HasSubstr("; --cameras names others")));
  ASSERT_EQ(RunCommand(Words("two", {"--cameras", "head,hand_right"})).exit_code, 0);
}

/// --cameras was advised, which cannot help: no recording has so many.
TEST_F(PackCommand, MoreViewsThanAnyRecordingHasCamerasAreRefusedWithThePage) {
  SyntheticClip clip = Good();
  clip.cameras = {"head", "hand_right"};
  Add("a", clip);
  WriteText(folder_ / "tiny.yaml", std::string(kTiny) + "views: 3\n");
  const CommandResult three = RunCommand(Words("out"));
  EXPECT_EQ(three.exit_code, 2);
  EXPECT_THAT(three.err, AllOf(HasSubstr("tiny.yaml: field views: found 3, wanted as many as a recording has cameras"),
                               HasSubstr("none of 1 has more than 2 ("), HasSubstr("data/a has head, hand_right)"),
                               Not(HasSubstr("--cameras"))));
}

TEST_F(PackCommand, ListsRecordingsWhateverTheirFoldersAreCalled) {
  Add("caf\xE9", Good());
  SyntheticClip cut = Good();
  cut.frames = 5;
  Add("the \"second\", cut", cut);
  const CommandResult result = RunCommand(Words("out"));
  ASSERT_EQ(result.exit_code, 0) << result.err;
  EXPECT_THAT(ReadFile(folder_ / "out/shards.json"), HasSubstr("\"caf\xEF\xBF\xBD\"")) << "JSON is UTF-8";
  const std::string table = ReadFile(folder_ / "out/left_out.csv");
  CsvReader rows(table, "left_out.csv");
  ASSERT_TRUE(rows.Next()) << "a header";
  const std::optional<CsvRow> row = rows.Next();
  ASSERT_TRUE(row && row->cells.size() == 3) << table;
  EXPECT_THAT(row->cells[0], HasSubstr("data/the \"second\", cut"));
  EXPECT_EQ(row->cells[1], "short_video");
}

TEST_F(PackCommand, WithNothingToPackSaysWhyAndExitsWith2) {
  SyntheticClip cut = Good();
  cut.frames = 5;
  Add("short_video", cut);
  const CommandResult result = RunCommand(Words("out", {"--cameras", "head"}));
  EXPECT_EQ(result.exit_code, 2);
  EXPECT_THAT(result.err, HasSubstr("5 frames, wanted one for each"));
}

/// They were all looked at and packed, and the first training refused the shards.
TEST_F(PackCommand, OtherThanAsManyCamerasAsTheNetworkHasViewsAreRefusedAtOnce) {
  SyntheticClip cut = Good();
  cut.frames = 5;
  Add("would_be_left_out", cut);
  const CommandResult result = RunCommand(Words("out", {"--cameras", "head,hand_left"}));
  EXPECT_EQ(result.exit_code, 2);
  EXPECT_THAT(result.err, HasSubstr("--cameras: 2 cameras, wanted 1, one for each view of " + (folder_ / "tiny.yaml").string()));
  EXPECT_THAT(result.err, Not(HasSubstr("left out")));
}

TEST_F(PackCommand, RealRecordingsAreThinnedToTheClipsPeriodAndKnowNoOutcome) {
  Add("a", Good());
  ASSERT_EQ(RunCommand(Words("out")).exit_code, 0);
  const TensorFile shard = TensorFile::Open(folder_ / "out/shard_00000.safetensors");
  EXPECT_EQ(shard.Get("frames").shape, (std::vector<std::int64_t>{3, 1, 32, 48, 3}));
  EXPECT_EQ(shard.metadata().at("arms"), "left,right");
  EXPECT_EQ(shard.metadata().at("delta_frames"), "3");
  EXPECT_EQ(static_cast<int>(static_cast<std::int8_t>(shard.Get("outcome").bytes[0])), -1);
  const int second = std::to_integer<int>(shard.Get("frames").bytes[32 * 48 * 3 + 700]);
  EXPECT_NEAR(second, SyntheticClip::FrameGrey(3), 3) << "every third frame";
}

TEST_F(PackCommand, ShardsSayWhetherTheirArmsAreToldOrMeasured) {
  Add("a", Good());
  AddCollected("000000");
  ASSERT_EQ(RunCommand(Words("real")).exit_code, 0);
  EXPECT_EQ(Said("real").at("arms_read"), "measured");
  const CommandResult told = RunCommand(Words("told", {}, {"collected"}));
  ASSERT_EQ(told.exit_code, 0) << told.err;
  EXPECT_EQ(Said("told").at("arms_read"), "told");
  ASSERT_EQ(RunCommand(Words("measured", {"--arms", "measured"}, {"collected"})).exit_code, 0);
  EXPECT_EQ(Said("measured").at("arms_read"), "measured");
  EXPECT_NE(Said("measured").at("recipe"), Said("told").at("recipe"));
}

TEST_F(PackCommand, AnEpisodeOfACollectionThatSaysNothingToldIsLeftOutAndNotReadAsMeasured) {
  AddCollected("000000");
  AddCollected("000001", false);
  const CommandResult told = RunCommand(Words("told", {}, {"collected"}));
  ASSERT_EQ(told.exit_code, 0) << told.err;
  EXPECT_THAT(told.err, HasSubstr("1 recordings left out: 1 nothing_told"));
  EXPECT_EQ(Said("told").at("arms_read"), "told");
  const CommandResult measured = RunCommand(Words("measured", {"--arms", "measured"}, {"collected"}));
  EXPECT_THAT(measured.err, Not(HasSubstr("left out")));
}

TEST_F(PackCommand, IsNotGoneOnWithByArmsOfAnotherKind) {
  for (const char* episode : {"000000", "000001", "000002"}) AddCollected(episode);
  ASSERT_EQ(RunCommand(Words("out", {}, {"collected"})).exit_code, 0);
  const std::string whole = HashesOf("out");
  const fs::path second = folder_ / "out/shard_00001.safetensors";
  fs::remove(second);  // as if it had been killed before this one
  fs::remove(folder_ / "out/shards.json");
  const CommandResult other = RunCommand(Words("out", {"--arms", "measured"}, {"collected"}));
  EXPECT_EQ(other.exit_code, 2);
  EXPECT_THAT(other.err, HasSubstr("holds shards of other recordings or options"));
  EXPECT_FALSE(fs::exists(second));
  ASSERT_EQ(RunCommand(Words("out", {"--arms", "told"}, {"collected"})).exit_code, 0) << "as it was by itself";
  EXPECT_EQ(HashesOf("out"), whole);
}

TEST_F(PackCommand, SaysThatAnotherVersionOfEvacBeganIt) {
  Add("a", Good());
  const fs::path claim = folder_ / "out/packing.json";
  const auto pack = [&] {
    const CommandResult packed = RunCommand(Words("out"));
    EXPECT_EQ(packed.exit_code, 0) << packed.err;
    return packed.err;
  };
  pack();
  EXPECT_THAT(pack(), Not(HasSubstr("was begun by")));
  nlohmann::ordered_json page = nlohmann::ordered_json::parse(ReadFile(claim));
  page["evac_version"] = "0.0.1";
  WriteText(claim, page.dump(1) + "\n");
  EXPECT_THAT(pack(), HasSubstr("evac: note: " + (folder_ / "out").string() + " was begun by evac 0.0.1; evac "));
  page.erase("evac_version");  // as earlier versions wrote it
  WriteText(claim, page.dump(1) + "\n");
  EXPECT_THAT(pack(), HasSubstr("was begun by an evac that did not write down its version"));
}

TEST_F(PackCommand, ACollectionBesideOtherRecordingsIsAskedWhichArmsAreMeant) {
  Add("a", Good());
  AddCollected("000000");
  const CommandResult open = RunCommand(Words("out", {}, {"collected", "data"}));
  EXPECT_EQ(open.exit_code, 2);
  EXPECT_THAT(open.err, AllOf(HasSubstr("collected/observations/carry/000000 is of a collection"), HasSubstr("data/a is not"),
                              HasSubstr("wanted --arms told or --arms measured for all")));
  EXPECT_FALSE(fs::exists(folder_ / "out/packing.json"));
  ASSERT_EQ(RunCommand(Words("out", {"--arms", "measured"}, {"collected", "data"})).exit_code, 0);
}

TEST_F(PackCommand, WarnsOfMeasuredArmsOnAPageThatHasToldOnesFollowLate) {
  Add("a", Good());
  AddCollected("000000");
  EXPECT_THAT(RunCommand(Words("as_published")).err, Not(HasSubstr("warning")));
  WriteText(folder_ / "tiny.yaml", std::string(kTiny) + "pose_map: {lag_frames: 0.5}\n");
  const CommandResult measured = RunCommand(Words("measured")), told = RunCommand(Words("told", {}, {"collected"}));
  EXPECT_EQ(measured.exit_code, 0);
  EXPECT_THAT(measured.err, HasSubstr("evac: warning: the arms packed are measured ones, and pose_map.lag_frames is 0.5"));
  EXPECT_THAT(told.err, AllOf(HasSubstr("arms are 1.00 frames behind what they are told; pose_map.lag_frames is 0.5"),
                              Not(HasSubstr("warning"))));
}

/// In metres or from 0 to 1 a gripper reads as one that never closes.
TEST_F(PackCommand, WarnsOfGrippersThatNeverClose) {
  SyntheticClip clip = Good();
  for (float& gripper : clip.grippers) gripper /= 120;
  Add("a", clip);
  const CommandResult result = RunCommand(Words("out"));
  EXPECT_EQ(result.exit_code, 0) << result.err;
  EXPECT_THAT(result.err, AllOf(HasSubstr("evac: warning: no hand of any recording closes by half (the furthest is 0.0042 of the way)"),
                                HasSubstr("from 0 (open) to 120 (closed)")));
}

/// A training said so, once the shards were made and encoded, and named no option.
TEST_F(PackCommand, WarnsWhereNothingIsHeldOutOrNothingIsLeftToLearnFrom) {
  for (const char* name : {"a", "b"}) Add(name, Good());
  const auto said = [&](const std::string& out, const std::string& share) {
    std::vector<std::string> words = Words(out);
    *(std::find(words.begin(), words.end(), "--holdout") + 1) = share;
    const CommandResult result = RunCommand(words);
    EXPECT_EQ(result.exit_code, 0) << result.err;
    return result.err;
  };
  EXPECT_THAT(said("few", "0.05"), HasSubstr("evac: warning: none of 2 recordings is held out by --holdout 0.05, and "
                                             "trainings want some on either side: wanted a larger --holdout"));
  EXPECT_THAT(said("most", "0.9"), HasSubstr("every one of 2 recordings is held out by --holdout 0.9"));
  EXPECT_THAT(said("one", "0.37"), Not(HasSubstr("held out"))) << "a and not b, by the default seed";
  EXPECT_THAT(said("asked", "0"), Not(HasSubstr("held out")));
}

TEST_F(PackCommand, TakesTheFoldersBehindItsCamerasForRecordings) {
  Add("a", Good());
  const CommandResult result = RunCommand({Binary("evac"), "pack", "--config", folder_ / "tiny.yaml", "--holdout", "0",
                                           "--cameras", "head", folder_ / "data", "--out", folder_ / "out"});
  ASSERT_EQ(result.exit_code, 0) << result.err;
  EXPECT_EQ(Said("out").at("cameras"), "head");
}

TEST_F(PackCommand, DrawsMapsAsThePageOfTheNetworkSays) {
  Add("a", Good());
  ASSERT_EQ(RunCommand(Words("published")).exit_code, 0);
  WriteText(folder_ / "tiny.yaml", std::string(kTiny) + "pose_map: {scaled: true}\n");
  ASSERT_EQ(RunCommand(Words("scaled")).exit_code, 0);
  EXPECT_EQ(Said("published").at("pose_map"), "radius_px=50 thickness_px=8");
  EXPECT_EQ(Said("scaled").at("pose_map"), "radius_px=5 thickness_px=1");
  const auto maps = [&](const char* out) {
    const TensorFile shard = TensorFile::Open(folder_ / out / "shard_00000.safetensors");
    const auto bytes = shard.Get("maps").bytes;
    return std::string(reinterpret_cast<const char*>(bytes.data()), bytes.size());
  };
  EXPECT_NE(maps("published"), maps("scaled"));
}

TEST_F(PackCommand, PacksTheRobotOfMostRecordingsAndSaysTheOthers) {
  Add("a", OneArmed());
  for (const char* name : {"b", "c"}) Add(name, Good());
  const CommandResult result = RunCommand(Words("out"));
  ASSERT_EQ(result.exit_code, 0) << result.err;
  EXPECT_EQ(Said("out").at("arms"), "left,right");
  EXPECT_THAT(result.err, HasSubstr("1 recordings left out: 1 other_robot"));
  EXPECT_THAT(ReadFile(folder_ / "out/left_out.csv"), HasSubstr("a: 1 arms, wanted 2 as in 2 recordings"));
  fs::remove_all(folder_ / "data/c");
  ASSERT_EQ(RunCommand(Words("even")).exit_code, 0);
  EXPECT_EQ(Said("even").at("arms"), "right") << "the first of two";
}

TEST_F(PackCommand, ShardsAreImaginedAgainIntoAFolderOfTheirOwn) {
  for (const char* name : {"a", "b", "c"}) Add(name, Good());
  ASSERT_EQ(RunCommand(Words("out")).exit_code, 0);
  const std::string page = folder_ / "tiny.yaml", weights = folder_ / "w.safetensors", shards = folder_ / "out";
  const CommandResult made = RunCommand({Binary("evac"), "weights", "init", weights, "--config", page});
  ASSERT_EQ(made.exit_code, 0) << made.err;
  std::vector<std::string> encode = {Binary("evac"), "encode", shards, "--config", page, "--codec", weights};
  std::vector<std::string> imagine = encode;
  imagine.insert(imagine.end(), {"--imagined", folder_ / "imagined"});
  const CommandResult early = RunCommand(imagine);
  EXPECT_EQ(early.exit_code, 2);
  EXPECT_THAT(early.err, HasSubstr("has no latents"));
  ASSERT_EQ(RunCommand(encode).exit_code, 0);
  {
    const RunLock lock(folder_ / "imagined/lock");
    EXPECT_THAT(RunCommand(imagine).err, HasSubstr("is writing here; wait for it"));
  }
  const CommandResult result = RunCommand(imagine);
  ASSERT_EQ(result.exit_code, 0) << result.err;
  EXPECT_THAT(result.out, HasSubstr("imagined latents of 2 shards, 2 of them new"));
  EXPECT_THAT(RunCommand(imagine).out, HasSubstr("0 of them new"));
  WriteText(page, ReadFile(page) + "\ndomain: 1\n");  // the same sizes, and another answer
  EXPECT_THAT(RunCommand(imagine).out, HasSubstr("2 of them new"));
  const TensorFile truth = TensorFile::Open(folder_ / "out/latents_00000.safetensors"),
                   imagined = TensorFile::Open(folder_ / "imagined/latents_00000.safetensors");
  const auto bytes = [](const TensorFile& file, const char* name) {
    const auto all = file.Get(name).bytes;
    return std::string(reinterpret_cast<const char*>(all.data()), all.size());
  };
  EXPECT_NE(bytes(imagined, "latents"), bytes(truth, "latents"));
  EXPECT_EQ(bytes(imagined, "map_latents"), bytes(truth, "map_latents"));
  EXPECT_EQ(imagined.metadata().at("codec"), truth.metadata().at("codec"));
  EXPECT_THAT(imagined.metadata().at("products"), HasSubstr("imagined by"));
  EXPECT_EQ(Sha256HexOfFile(folder_ / "imagined/shards.json"), Sha256HexOfFile(folder_ / "out/shards.json"));
  encode.insert(encode.end(), {"--imagined", shards});
  EXPECT_EQ(RunCommand(encode).exit_code, 2) << "would be written over";
}

/// They were imagined anyway: a judge was calibrated on what the network says of another robot's motion.
TEST_F(PackCommand, ShardsOfAnotherRobotThanTheWeightsAreNotImagined) {
  Add("a", Good());
  OneArmed().Write(OneFolder(folder_ / "one/a"));
  ASSERT_EQ(RunCommand(Words("out")).exit_code, 0);
  ASSERT_EQ(RunCommand(Words("of_one", {}, {"one"})).exit_code, 0);
  const std::string page = folder_ / "tiny.yaml", weights = folder_ / "w.safetensors", told = folder_ / "told.safetensors";
  ASSERT_EQ(RunCommand({Binary("evac"), "weights", "init", weights, "--config", page}).exit_code, 0);
  const CommandResult converted = RunCommand({Binary("evac"), "weights", "convert", weights, told, "--config", page, "--shards", folder_ / "of_one"});
  ASSERT_EQ(converted.exit_code, 0) << converted.err;
  const CommandResult result = RunCommand({Binary("evac"), "encode", folder_ / "out", "--config", page, "--codec", told, "--imagined", folder_ / "imagined"});
  EXPECT_EQ(result.exit_code, 2);
  EXPECT_THAT(result.err, HasSubstr("found arms left, right, wanted right: those that"));
}

TEST_F(PackCommand, GivesTheSameBytesForAnyNumberOfJobsAndGoesOnWhereItWasCut) {
  for (const char* name : {"a", "b", "c", "d", "e"}) Add(name, Good());
  ASSERT_EQ(RunCommand(Words("one", {"--jobs", "1", "--crops", "2"})).exit_code, 0);
  ASSERT_EQ(RunCommand(Words("two", {"--jobs", "3", "--crops", "2"})).exit_code, 0);
  EXPECT_EQ(HashesOf("one"), HashesOf("two"));
  const std::string whole = HashesOf("one");
  fs::remove(folder_ / "one/shard_00003.safetensors");  // as if it had been killed before this one
  fs::remove(folder_ / "one/shards.json");
  ASSERT_EQ(RunCommand(Words("one", {"--crops", "2"})).exit_code, 0);
  EXPECT_EQ(HashesOf("one"), whole);
}

/// Sixty-four clips of full size were as many gigabytes in memory as a machine has, for each core.
TEST_F(PackCommand, AShardHoldsNoMoreMegabytesThanItMay) {
  for (const char* name : {"a", "b", "c"}) Add(name, Good());
  ASSERT_EQ(RunCommand(Words("out")).exit_code, 0);
  ASSERT_EQ(RunCommand(Words("small", {"--shard-mb", "0.001"})).exit_code, 0);
  const auto shards = [&](const char* out) {
    return nlohmann::json::parse(ReadFile(folder_ / out / "shards.json")).at("shards").size();
  };
  EXPECT_EQ(shards("out"), 2u);
  EXPECT_EQ(shards("small"), 3u);
  EXPECT_NE(Said("small").at("recipe"), Said("out").at("recipe"));
}

TEST_F(PackCommand, NormalisesByTheStatisticsThatWeightsWereTrainedWith) {
  Add("a", Good());
  ASSERT_EQ(RunCommand(Words("own")).exit_code, 0);
  std::string page = ReadFile(folder_ / "own/statistics.yaml");
  page.replace(page.find("packed"), 6, "theirs");
  const std::size_t deviation = page.find("deviation: [") + 12;
  page.replace(deviation, page.find(',', deviation) - deviation, "0.5");  // the left hand's x
  WriteText(folder_ / "theirs.yaml", page);
  const CommandResult result = RunCommand(Words("out", {"--statistics", folder_ / "theirs.yaml"}));
  ASSERT_EQ(result.exit_code, 0) << result.err;
  EXPECT_EQ(ReadFile(folder_ / "out/statistics.yaml"), page);
  const auto first_step = [&](const std::string& out) {
    const TensorFile shard = TensorFile::Open(folder_ / out / "shard_00000.safetensors");
    EXPECT_EQ(shard.metadata().at("statistics"), ReadFile(folder_ / out / "statistics.yaml"));
    std::array<float, 14> numbers;
    std::memcpy(numbers.data(), shard.Get("deltas").bytes.data() + sizeof numbers, sizeof numbers);
    return numbers;
  };
  const std::array<float, 14> own = first_step("own"), theirs = first_step("out");
  EXPECT_NE(theirs[0], own[0]);
  EXPECT_LT(std::abs(theirs[0]), 0.1) << "centimetres against half a metre";
  for (std::size_t i = 1; i < 14; ++i) EXPECT_EQ(theirs[i], own[i]) << i;

  WriteText(folder_ / "wrong.yaml", "robot: theirs\nmean: [0]\ndeviation: [1]\n");
  const CommandResult wrong = RunCommand(Words("wrong", {"--statistics", folder_ / "wrong.yaml"}));
  EXPECT_EQ(wrong.exit_code, 2);
  EXPECT_THAT(wrong.err, AllOf(HasSubstr("wrong.yaml"), HasSubstr("mean")));
}

/// Metadata have commas between tasks: clips were of another task than their own, and nobody said so.
TEST_F(PackCommand, ATaskWithACommaInItsNameIsRefused) {
  WriteLateRecording({folder_ / "tree", "cut, then pour", "000000"});
  const CommandResult result = RunCommand(Words("out", {}, {"tree"}));
  EXPECT_EQ(result.exit_code, 2) << result.err;
  EXPECT_THAT(result.err, HasSubstr("tree/observations/cut, then pour/000000: its task is called 'cut, then pour', "
                                    "wanted a name without a comma"));
  EXPECT_FALSE(fs::exists(folder_ / "out"));
}

TEST_F(PackCommand, RefusesAFolderThatHoldsAnotherPacking) {
  Add("a", Good());
  ASSERT_EQ(RunCommand(Words("out")).exit_code, 0);
  const CommandResult result = RunCommand(Words("out", {"--crops", "3"}));
  EXPECT_EQ(result.exit_code, 2);
  EXPECT_THAT(result.err, HasSubstr("holds shards of other recordings or options"));
}

TEST(AgiBotExamples, HaveNoVideoAndAreLeftOutByThatName) {
  const fs::path examples = fs::path(EVAC_SHARED_DIR) / "data/agibot_examples";
  if (!fs::exists(examples)) GTEST_SKIP() << examples << " is not there";
  const TempFolder folder;
  WriteText(folder / "tiny.yaml", kTiny);
  const CommandResult result =
      RunCommand({Binary("evac"), "pack", examples, "--out", folder / "out", "--config", folder / "tiny.yaml"});
  EXPECT_EQ(result.exit_code, 2);
  EXPECT_THAT(result.err, AllOf(HasSubstr("2 recordings left out: 2 no_video"), HasSubstr("there is no video")));
}

}  // namespace
}  // namespace evac
