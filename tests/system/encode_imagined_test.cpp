#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/file.h"
#include "tests/support/command.h"
#include "tests/support/synthetic_recording.h"
#include "tests/support/temp_folder.h"
#include "worldmodel/evac_config.h"
#include "worldmodel/nn/weights.h"
#include "worldmodel/train/shards.h"

/// `evac encode SHARDS --imagined OUT` where OUT holds what another world model imagined.
namespace evac {
namespace {

namespace fs = std::filesystem;
using testing::HasSubstr;
using testing::ThrowsMessage;

class EncodeImagined : public testing::Test {
 protected:
  void SetUp() override {
    std::string page = ReadFile(EVAC_SOURCE_DIR "/tests/system/evac_small.yaml");
    page.replace(page.find("chunk: 8"), 8, "chunk: 2");
    WriteText(folder_ / "page.yaml", page);
    SyntheticClip clip(9);  // at 30 Hz: three frames of a shard, the first and a chunk
    clip.cameras = {"head", "hand_left"};
    for (const char* name : {"data/a", "data/b"}) clip.Write(OneFolder(folder_ / name));
    nn::RandomWeights random(5);
    nn::SaveWeights(folder_ / "world.safetensors", random, ReadEvacConfig(folder_ / "page.yaml"), {});
    const CommandResult packed =
        RunCommand({Binary("evac"), "pack", folder_ / "data", "--config", folder_ / "page.yaml", "--holdout", "0",
                    "--clips-per-shard", "1", "--out", folder_ / "shards"});
    ASSERT_EQ(packed.exit_code, 0) << packed.err;
    const CommandResult encoded = Encode({});
    ASSERT_EQ(encoded.exit_code, 0) << encoded.err;
  }
  /// One shard after the other.
  CommandResult Encode(const std::vector<std::string>& more) const {
    std::vector<std::string> words = {Binary("evac"), "encode", folder_ / "shards", "--config", folder_ / "page.yaml",
                                      "--codec", folder_ / "world.safetensors", "--threads", "1"};
    words.insert(words.end(), more.begin(), more.end());
    return RunCommand(words);
  }
  CommandResult Imagine(const char* steps) const {
    return Encode({"--imagined", folder_ / "imagined", "--steps", steps});
  }

  const TempFolder folder_;
};

/// shards.json stood there from the first time, and a judge learned from clips of two world models.
TEST_F(EncodeImagined, HalfReplacedTheFolderIsReadByNobodyUntilAllIsReplaced) {
  const fs::path index = folder_ / "imagined/shards.json", second = folder_ / "imagined/shard_00001.safetensors";
  EXPECT_THAT(Imagine("2").out, HasSubstr("imagined latents of 2 shards, 2 of them new"));
  ASSERT_TRUE(fs::exists(index));
  fs::remove(second);
  WriteText(second, "another file");  // it ends there, as if it had been killed: the first shard is imagined anew
  const CommandResult half = Imagine("3");
  EXPECT_EQ(half.exit_code, 2);
  EXPECT_THAT(half.err, HasSubstr("is another file than"));
  const auto read = [&] { return train::ShardSet(folder_ / "imagined", train::Split::kTrain).shards().size(); };
  EXPECT_THAT(read, ThrowsMessage<TensorError>(HasSubstr("has no shards.json")));
  fs::remove(second);
  EXPECT_THAT(Imagine("3").out, HasSubstr("imagined latents of 2 shards, 1 of them new")) << "it goes on";
  EXPECT_EQ(read(), 2u);
  EXPECT_EQ(ReadFile(index), ReadFile(folder_ / "shards/shards.json"));
  EXPECT_THAT(Imagine("3").out, HasSubstr("0 of them new"));
  EXPECT_EQ(read(), 2u);
}

/// What it would take away first is compared first.
TEST_F(EncodeImagined, TheListOfAnotherPackingIsRefusedAndStays) {
  WriteText(folder_ / "imagined/shards.json", "{}");
  const CommandResult refused = Imagine("2");
  EXPECT_EQ(refused.exit_code, 2);
  EXPECT_THAT(refused.err, HasSubstr("shards.json is another file than"));
  EXPECT_EQ(ReadFile(folder_ / "imagined/shards.json"), "{}");
  EXPECT_FALSE(fs::exists(folder_ / "imagined/latents_00000.safetensors"));
}

}  // namespace
}  // namespace evac
