#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <cstring>
#include <limits>
#include <set>

#include "apps/collect_recipe.h"
#include "core/file.h"
#include "core/hash.h"
#include "core/tensor_file.h"
#include "harness/suite.h"
#include "tests/support/command.h"
#include "tests/support/synthetic_recording.h"
#include "tests/support/temp_folder.h"

namespace evac {
namespace {

namespace fs = std::filesystem;
using testing::AllOf;
using testing::HasSubstr;

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
  void Add(const std::string& name, const SyntheticClip& clip) { clip.Write(OneFolder(folder_ / ("data/" + name))); }

  std::vector<std::string> Words(const std::string& out, const std::vector<std::string>& more = {}) const {
    std::vector<std::string> words = {
        Binary("evac"),      "pack", folder_ / "data", "--out", folder_ / out, "--config", folder_ / "tiny.yaml",
        "--clips-per-shard", "2",    "--holdout",      "0"};
    words.insert(words.end(), more.begin(), more.end());
    return words;
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

TEST_F(PackCommand, WithNothingToPackSaysWhyAndExitsWith2) {
  SyntheticClip cut = Good();
  cut.frames = 5;
  Add("short_video", cut);
  const CommandResult result = RunCommand(Words("out", {"--cameras", "head"}));
  EXPECT_EQ(result.exit_code, 2);
  EXPECT_THAT(result.err, HasSubstr("5 frames, wanted one for each"));
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
  const CommandResult result = RunCommand(imagine);
  ASSERT_EQ(result.exit_code, 0) << result.err;
  EXPECT_THAT(result.out, HasSubstr("imagined latents of 2 shards, 2 of them new"));
  EXPECT_THAT(RunCommand(imagine).out, HasSubstr("0 of them new"));
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
