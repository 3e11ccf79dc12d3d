#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <span>

#include "core/file.h"
#include "core/hash.h"
#include "core/tensor_file.h"
#include "tests/support/command.h"
#include "tests/support/synthetic_recording.h"
#include "tests/support/temp_folder.h"
#include "tests/system/process_support.h"

namespace evac {
namespace {

namespace fs = std::filesystem;
using ::testing::HasSubstr;

const char kTinyPage[] = R"(chunk: 3
memory: 2
image_height_px: 16
image_width_px: 24
unet: {model_channels: 32, channel_mult: [1, 2], num_res_blocks: 1, attention_resolutions: [1, 2], num_head_channels: 16,
       context_dim: 32, init_attention_heads: 2}
vae: {channels: 32, channel_mult: [1, 1], num_res_blocks: 1}
action_resampler: {queries: 3, dim: 32, depth: 1, dim_head: 16, heads: 2, output_dim: 32}
image_resampler: {embedding_dim: 32, queries: 4, dim: 32, depth: 1, dim_head: 16, heads: 2, output_dim: 32}
image_encoder: {width: 32, layers: 1, head_width: 16, patch_px: 14, image_px: 28, embed_dim: 16, vocabulary: 8}
)";

class WeightsCommand : public ::testing::Test {
 protected:
  void SetUp() override {
    std::ofstream(folder_ / "tiny.yaml") << kTinyPage;
  }
  struct Answer {
    int exit_code = -1;
    std::string text;
  };
  /// `evac weights …` in the test's folder, both streams.
  Answer Evac(const std::string& arguments) const {
    const std::string log = (folder_ / "log").string();
    const std::string command = fmt::format("cd '{}' && '{}/evac' weights {} >'{}' 2>&1", folder_.string(),
                                            EVAC_BIN_DIR, arguments, log);
    const int status = std::system(command.c_str());
    std::ostringstream text;
    text << std::ifstream(log).rdbuf();
    return {WEXITSTATUS(status), text.str()};
  }
  void Init(const std::string& file, const std::string& options = "") const {
    const Answer answer = Evac("init " + file + " --config tiny.yaml " + options);
    ASSERT_EQ(answer.exit_code, 0) << answer.text;
  }
  /// `file` with its codec from another one: as two trainings with one codec are.
  void TakeCodec(const std::string& file, const std::string& from) const {
    const TensorFile own = TensorFile::Open(folder_ / file), other = TensorFile::Open(folder_ / from);
    std::vector<TensorView> tensors = own.tensors();
    for (TensorView& tensor : tensors) {
      if (tensor.name.starts_with("first_stage_model")) tensor.bytes = other.Get(tensor.name).bytes;
    }
    WriteTensorFile(folder_ / file, tensors, own.metadata());
  }
  std::string Hash(const std::string& file) const { return Sha256HexOfFile(folder_ / file); }

  const TempFolder temp_;
  const fs::path folder_ = temp_.path();
};

TEST_F(WeightsCommand, InitMakesTheSameFileOfASeedAndItFits) {
  Init("a.safetensors", "--seed 7");
  Init("b.safetensors", "--seed 7");
  Init("c.safetensors", "--seed 8");
  EXPECT_EQ(Hash("a.safetensors"), Hash("b.safetensors"));
  EXPECT_NE(Hash("a.safetensors"), Hash("c.safetensors"));
  const Answer answer = Evac("inspect a.safetensors --config tiny.yaml --json");
  EXPECT_EQ(answer.exit_code, 0);
  const auto json = nlohmann::json::parse(answer.text);
  EXPECT_TRUE(json.at("fits"));
  EXPECT_EQ(json.at("missing").size(), 0u);
  EXPECT_EQ(json.at("list").size(), json.at("tensors"));
}

TEST_F(WeightsCommand, AFullDiskIsTheMachinesFaultAndAMissingFolderTheUsers) {
  const std::string log = (folder_ / "log").string();
  const std::string command = fmt::format(
      "cd '{}' && trap '' XFSZ && ulimit -f 8 && '{}/evac' weights init full.safetensors --config tiny.yaml >'{}' 2>&1",
      folder_.string(), EVAC_BIN_DIR, log);
  const int status = std::system(command.c_str());
  std::ostringstream text;
  text << std::ifstream(log).rdbuf();
  EXPECT_EQ(WEXITSTATUS(status), 4) << text.str();
  EXPECT_THAT(text.str(), HasSubstr("full.safetensors.partial-"));
  EXPECT_FALSE(std::filesystem::exists(folder_ / "full.safetensors"));
  EXPECT_EQ(Evac("init none/a.safetensors --config tiny.yaml").exit_code, 2);
}

TEST_F(WeightsCommand, ConvertThereAndBackLosesNothing) {
  Init("f32.safetensors");
  EXPECT_EQ(Evac("convert f32.safetensors same.safetensors --config tiny.yaml").exit_code, 0);
  EXPECT_EQ(Hash("f32.safetensors"), Hash("same.safetensors"));
  EXPECT_EQ(Evac("convert f32.safetensors bf16.safetensors --config tiny.yaml --dtype bf16").exit_code, 0);
  EXPECT_EQ(Evac("convert bf16.safetensors wide.safetensors --config tiny.yaml").exit_code, 0);
  EXPECT_EQ(Evac("convert wide.safetensors again.safetensors --config tiny.yaml --dtype bf16").exit_code, 0);
  EXPECT_EQ(Hash("bf16.safetensors"), Hash("again.safetensors"));
}

TEST_F(WeightsCommand, MeanFitsAndSaysWhatItIsOf) {
  Init("a.safetensors", "--seed 7");
  Init("b.safetensors", "--seed 8");
  const Answer of_two_codecs = Evac("mean a.safetensors b.safetensors --config tiny.yaml --out mean.safetensors");
  EXPECT_EQ(of_two_codecs.exit_code, 2);
  EXPECT_THAT(of_two_codecs.text, HasSubstr("wanted trainings with one codec"));
  EXPECT_FALSE(fs::exists(folder_ / "mean.safetensors"));
  TakeCodec("b.safetensors", "a.safetensors");
  const Answer made = Evac("mean a.safetensors b.safetensors --config tiny.yaml --dtype bf16 --out mean.safetensors");
  ASSERT_EQ(made.exit_code, 0) << made.text;
  const Answer answer = Evac("inspect mean.safetensors --config tiny.yaml --json");
  EXPECT_EQ(answer.exit_code, 0) << answer.text;
  EXPECT_EQ(nlohmann::json::parse(answer.text).at("metadata").at("mean_of"), Hash("a.safetensors") + "," + Hash("b.safetensors"));
  const Answer alone = Evac("mean a.safetensors --config tiny.yaml --out alone.safetensors");
  EXPECT_EQ(alone.exit_code, 2) << alone.text;
  const Answer there = Evac("mean a.safetensors b.safetensors --config tiny.yaml --out a.safetensors");
  EXPECT_EQ(there.exit_code, 2);
  EXPECT_THAT(there.text, HasSubstr("is there already"));
}

TEST_F(WeightsCommand, ConvertReadsWhatTorchSavedInEveryLayout) {
  Init("f32.safetensors");
  const std::string script = EVAC_SOURCE_DIR "/tests/support/torch_checkpoint.py";
  if (std::system("python3 -c 0 2>/dev/null") != 0) GTEST_SKIP() << "there is no python3 to write checkpoints with";
  for (const std::string layout : {"state_dict", "module", "plain"}) {
    const std::string pt = layout + ".pt", out = layout + ".safetensors";
    const std::string command = fmt::format("python3 '{}' '{}' '{}' {}", script,
                                            (folder_ / "f32.safetensors").string(), (folder_ / pt).string(), layout);
    ASSERT_EQ(std::system(command.c_str()), 0);
    const Answer answer = Evac("convert " + pt + " " + out + " --config tiny.yaml");
    ASSERT_EQ(answer.exit_code, 0) << answer.text;
    const TensorFile before = TensorFile::Open(folder_ / "f32.safetensors"), after = TensorFile::Open(folder_ / out);
    ASSERT_EQ(before.tensors().size(), after.tensors().size());
    for (const TensorView& tensor : before.tensors())
      EXPECT_TRUE(std::ranges::equal(tensor.bytes, after.Get(tensor.name).bytes)) << layout << " " << tensor.name;
  }
}

TEST_F(WeightsCommand, ARenamedKeyIsRefusedByConvertAndNamedByInspect) {
  Init("f32.safetensors");
  {
    const TensorFile file = TensorFile::Open(folder_ / "f32.safetensors");
    std::vector<TensorView> tensors = file.tensors();
    tensors.back().name += "_renamed";
    WriteTensorFile(folder_ / "renamed.safetensors", tensors, {});
  }
  const Answer inspected = Evac("inspect renamed.safetensors --config tiny.yaml");
  EXPECT_EQ(inspected.exit_code, 1);
  EXPECT_THAT(inspected.text, HasSubstr("1 key is missing: image_proj_model."));
  const Answer converted = Evac("convert renamed.safetensors out.safetensors --config tiny.yaml");
  EXPECT_EQ(converted.exit_code, 2);
  EXPECT_THAT(converted.text, HasSubstr("_renamed"));
  EXPECT_FALSE(fs::exists(folder_ / "out.safetensors"));
}

TEST_F(WeightsCommand, InspectSaysThatAnotherNoiseScheduleDoesNotFit) {
  Init("a.safetensors");
  WriteFileAtomically(folder_ / "noisy.yaml", ReadFile(folder_ / "tiny.yaml") + "\nschedule: {base_scale: 0.9}\n");
  const Answer answer = Evac("inspect a.safetensors --config noisy.yaml --json");
  EXPECT_EQ(answer.exit_code, 1);
  const auto json = nlohmann::json::parse(answer.text);
  EXPECT_FALSE(json.at("fits"));
  EXPECT_THAT(json.at("schedule").get<std::string>(), HasSubstr("scale_arr"));
  const Answer words = Evac("inspect a.safetensors --config noisy.yaml");
  EXPECT_EQ(words.exit_code, 1);
  EXPECT_THAT(words.text, HasSubstr("does not fit: "));
}

TEST_F(WeightsCommand, BadFilesEndInOneMessageAndExitCode2) {
  Init("there.safetensors");
  std::ofstream(folder_ / "text.safetensors") << "these are no tensors at all";
  EXPECT_EQ(Evac("inspect text.safetensors").exit_code, 2);
  EXPECT_EQ(Evac("inspect nowhere.safetensors").exit_code, 2);
  EXPECT_THAT(Evac("init there.safetensors --config tiny.yaml").text, HasSubstr("is there already"));
  const std::string hostile = EVAC_SOURCE_DIR "/tests/fuzz/corpus/checkpoint_fuzz/hostile";
  const Answer answer = Evac("inspect '" + hostile + "'");
  EXPECT_EQ(answer.exit_code, 2);
  EXPECT_THAT(answer.text, HasSubstr("'posix.system'"));
}

TEST_F(WeightsCommand, LeanLeavesOutWhatNothingReadsAndStillFits) {
  Init("f32.safetensors");
  EXPECT_EQ(Evac("convert f32.safetensors lean.safetensors --config tiny.yaml --lean").exit_code, 0);
  EXPECT_LT(fs::file_size(folder_ / "lean.safetensors"), fs::file_size(folder_ / "f32.safetensors"));
  const Answer answer = Evac("inspect lean.safetensors --config tiny.yaml");
  EXPECT_THAT(answer.text, HasSubstr("fits; 0 of its keys are read by nothing"));
}

/// A number beyond 65504 was infinite in OUT, which `inspect` called fitting.
TEST_F(WeightsCommand, ConvertWritesNoNumberThatTheTypeCannotHold) {
  Init("a.safetensors");
  {
    const TensorFile file = TensorFile::Open(folder_ / "a.safetensors");
    std::vector<TensorView> tensors = file.tensors();
    const std::string key = "first_stage_model.decoder.conv_out.bias";
    const auto found = std::ranges::find(tensors, key, &TensorView::name);
    ASSERT_NE(found, tensors.end());
    const std::vector<float> large(found->ByteCount() / sizeof(float), 1e6F);
    found->bytes = std::as_bytes(std::span(large));
    WriteTensorFile(folder_ / "large.safetensors", tensors, file.metadata());
  }
  const Answer half = Evac("convert large.safetensors half.safetensors --config tiny.yaml --dtype f16");
  EXPECT_EQ(half.exit_code, 2);
  EXPECT_THAT(half.text, HasSubstr("large.safetensors: first_stage_model.decoder.conv_out.bias holds 1000000"));
  EXPECT_FALSE(fs::exists(folder_ / "half.safetensors"));
  const Answer bf16 = Evac("convert large.safetensors bf16.safetensors --config tiny.yaml --dtype bf16");
  EXPECT_EQ(bf16.exit_code, 0) << bf16.text;
}

/// OUT said the cameras, maps and statistics of another packing, and could be used by nothing.
TEST_F(WeightsCommand, ConvertTakesNoShardsOfOtherViewsSizesOrMapsThanThePages) {
  SyntheticClip clip(15);
  clip.cameras = {"head", "hand_left"};
  clip.Write(OneFolder(folder_ / "data/a"));
  const auto pack = [&](const std::string& name, const std::string& more) {
    WriteFileAtomically(folder_ / (name + ".yaml"), kTinyPage + more);
    const CommandResult packed =
        RunCommand({Binary("evac"), "pack", folder_ / "data", "--out", folder_ / name, "--config",
                    folder_ / (name + ".yaml"), "--clips-per-shard", "1", "--holdout", "0"});
    ASSERT_EQ(packed.exit_code, 0) << packed.err;
  };
  pack("own", "");
  pack("two_views", "views: 2\n");
  pack("scaled", "pose_map: {scaled: true}\n");
  Init("w.safetensors");
  const auto convert = [&](const std::string& shards) {
    return Evac("convert w.safetensors " + shards + ".safetensors --config tiny.yaml --shards " + shards);
  };
  const Answer of_two_views = convert("two_views"), of_scaled = convert("scaled");
  EXPECT_EQ(of_two_views.exit_code, 2);
  EXPECT_THAT(of_two_views.text, HasSubstr("found 2 views of 24x16 px, wanted 1 of 24x16, as tiny.yaml has"));
  EXPECT_FALSE(fs::exists(folder_ / "two_views.safetensors"));
  EXPECT_EQ(of_scaled.exit_code, 2);
  EXPECT_THAT(of_scaled.text, HasSubstr("pose maps were drawn with"));
  EXPECT_FALSE(fs::exists(folder_ / "scaled.safetensors"));
  const Answer of_its_own = convert("own");
  EXPECT_EQ(of_its_own.exit_code, 0) << of_its_own.text;
}

}  // namespace
}  // namespace evac
