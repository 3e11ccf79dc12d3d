#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <signal.h>
#include <sys/wait.h>

#include <algorithm>
#include <map>
#include <nlohmann/json.hpp>
#include <opencv2/imgcodecs.hpp>
#include <set>

#include "apps/networks/imagine_start.h"
#include "core/file.h"
#include "core/hash.h"
#include "core/recording_writer.h"
#include "core/store_lock.h"
#include "core/tensor_file.h"
#include "core/video.h"
#include "tests/support/command.h"
#include "tests/support/late_recording.h"
#include "tests/support/synthetic_recording.h"
#include "tests/support/temp_folder.h"
#include "tests/system/process_support.h"
#include "worldmodel/action_statistics.h"
#include "worldmodel/evac_config.h"
#include "worldmodel/motion_statistics.h"
#include "worldmodel/nn/library.h"
#include "worldmodel/nn/weights.h"

namespace evac {
namespace {

namespace fs = std::filesystem;
using testing::AllOf;
using testing::HasSubstr;
using testing::Not;

TEST(ImagineStart, ArmsBeginWhereTheyWereAndGoWhereTheyWereTold) {
  const TempFolder folder;
  const auto arms_at = [](double x_m) {
    ArmState left, right;
    left.base_from_gripper = Eigen::Translation3d(x_m, 0.2, 0.3);
    right.base_from_gripper = Eigen::Translation3d(x_m, -0.2, 0.3);
    return Arms{left, right};
  };
  RecordedEpisode recorded;
  recorded.cameras = {{"head", 48, 32, 40, 40, 24, 16, Mount::kBase, SyntheticClip::MountFromCamera()}};
  for (int step = 0; step < 3; ++step) {
    recorded.arms.push_back(arms_at(0.40 + 0.01 * step));
    recorded.told.push_back(arms_at(0.45 + 0.01 * step));
    recorded.pictures.push_back({cv::Mat(32, 48, CV_8UC3, cv::Scalar::all(40))});
  }
  const TreePlace place{folder.path(), "327", "648642"};
  WriteRecording(place, recorded, {.scale = 1});
  ImagineInputs inputs;
  inputs.recording = place.Folder().string();
  inputs.stride = 1;
  inputs.read_told = true;
  const ImagineStart start = ReadImagineStart(inputs, 1);
  ASSERT_EQ(start.arms.size(), 3u);
  EXPECT_NEAR(start.arms[0][0].base_from_gripper.translation().x(), 0.40, 1e-9);
  EXPECT_NEAR(start.arms[1][1].base_from_gripper.translation().x(), 0.46, 1e-9);
}

/// A network of milliseconds: chunks of 3 after a memory of 2, one view of 32x64.
constexpr const char* kTiny = R"(
chunk: 3
memory: 2
image_height_px: 32
image_width_px: 64
unet: {model_channels: 32, channel_mult: [1, 2], num_res_blocks: 1, attention_resolutions: [1, 2], num_head_channels: 16,
       context_dim: 32, init_attention_heads: 2}
vae: {channels: 32, channel_mult: [1, 1], num_res_blocks: 1}
action_resampler: {embedding_dim: 14, queries: 3, dim: 32, depth: 1, dim_head: 16, heads: 2, output_dim: 32}
image_resampler: {embedding_dim: 32, queries: 4, dim: 32, depth: 1, dim_head: 16, heads: 2, output_dim: 32}
image_encoder: {width: 32, layers: 1, head_width: 16, patch_px: 14, image_px: 28, embed_dim: 16, vocabulary: 8}
)";

/// A recording in AgiBot World's files, a configuration, and random weights of it.
class ImagineCommand : public testing::Test {
 protected:
  ImagineCommand() {
    clip_.Write(TreeUnder(folder_.path()));
    WriteText(folder_ / "tiny.yaml", kTiny);
  }

  /// `evac imagine WORDS…` of the recording with the tiny sizes, one thread.
  std::vector<std::string> Words(const std::string& out, const std::vector<std::string>& more) const {
    std::vector<std::string> words = {Binary("evac"),        "imagine", "--recording", Tree().string(), "--config",
                                      folder_ / "tiny.yaml", "--out",   folder_ / out};
    words.insert(words.end(), more.begin(), more.end());
    return words;
  }

  /// The same with weights, two steps of the sampler, and pictures.
  std::vector<std::string> Frames(const std::string& out, const std::vector<std::string>& more = {}) {
    if (!fs::exists(folder_ / "tiny.safetensors")) {
      nn::RandomWeights weights(5);
      nn::SaveWeights(folder_ / "tiny.safetensors", weights, ReadEvacConfig(folder_ / "tiny.yaml"));
    }
    std::vector<std::string> words = Words(
        out, {"--weights", folder_ / "tiny.safetensors", "--steps", "2", "--threads", "1", "--stride", "1", "--png"});
    words.insert(words.end(), more.begin(), more.end());
    return words;
  }

  fs::path Tree() const { return folder_.path() / "observations/327/648642"; }
  fs::path Page(const std::string& name) const {
    return folder_.path() / "parameters/327/648642/parameters/camera" / name;
  }

  /// Every file below a folder → its hash.
  std::map<std::string, std::string> Files(const std::string& name) const {
    std::map<std::string, std::string> files;
    if (!fs::exists(folder_ / name)) return files;
    for (const auto& entry : fs::recursive_directory_iterator(folder_ / name)) {
      if (entry.is_regular_file())
        files[fs::relative(entry.path(), folder_ / name).string()] = Sha256HexOfFile(entry.path());
    }
    return files;
  }

  /// What a user sees of a finished run: pictures, maps and video.
  std::map<std::string, std::string> Results(const std::string& name) const {
    std::map<std::string, std::string> files = Files(name);
    std::erase_if(files, [](const auto& file) { return file.first == "imagined.json" || file.first == "lock"; });
    return files;
  }

  /// Fails, says why, and leaves nothing.
  void ExpectRefused(const std::vector<std::string>& words, const std::string& why) const {
    const CommandResult result = RunCommand(words);
    EXPECT_EQ(result.exit_code, 2) << result.err;
    EXPECT_THAT(result.err, HasSubstr(why));
    EXPECT_EQ(std::count(result.err.begin(), result.err.end(), '\n'), 1) << "one message: " << result.err;
    EXPECT_FALSE(fs::exists(folder_ / "refused"));
  }

  TempFolder folder_;
  SyntheticClip clip_{8};
};

TEST_F(ImagineCommand, MapsAreThoseOfTheNewFramesFromZeroAndNothingElseIsWritten) {
  const CommandResult result = RunCommand(Words("maps", {"--maps-only", "--stride", "1"}));
  ASSERT_EQ(result.exit_code, 0) << result.err;
  const auto files = Files("maps");
  ASSERT_EQ(files.size(), 7u) << "one for every step but the first";
  EXPECT_EQ(files.begin()->first, "maps/frame_00000.png");
  EXPECT_EQ(files.rbegin()->first, "maps/frame_00006.png");
  EXPECT_EQ(cv::imread(folder_ / "maps/maps/frame_00003.png").size(), cv::Size(64, 32));
}

TEST_F(ImagineCommand, MapsNeedNoConfigurationAndComeInThePublishedSizeEveryTenthOfASecond) {
  const CommandResult result =
      RunCommand({Binary("evac"), "imagine", "--maps-only", "--recording", Tree().string(), "--out", folder_ / "maps"});
  ASSERT_EQ(result.exit_code, 0) << result.err;
  EXPECT_EQ(Files("maps").size(), 2u) << "8 steps of 30 Hz are 3 of 10 Hz";
  EXPECT_EQ(cv::imread(folder_ / "maps/maps/frame_00000.png").size(), cv::Size(512, 320));
}

TEST_F(ImagineCommand, SeveralViewsStandSideBySide) {
  SyntheticClip two(8);
  two.cameras = {"head", "hand_left"};
  two.Write(OneFolder(folder_ / "two"));
  WriteText(folder_ / "two.yaml", std::string(kTiny) + "views: 2\n");
  const std::vector<std::string> words = {
      Binary("evac"), "imagine", "--recording", folder_ / "two", "--config", folder_ / "two.yaml", "--stride", "1"};
  std::vector<std::string> maps = words;
  maps.insert(maps.end(), {"--maps-only", "--out", folder_ / "maps"});
  ASSERT_EQ(RunCommand(maps).exit_code, 0);
  const cv::Mat first = cv::imread(folder_ / "maps/maps/frame_00000.png");
  ASSERT_EQ(first.size(), cv::Size(128, 32));
  nn::RandomWeights weights(5);
  nn::SaveWeights(folder_ / "two.safetensors", weights, ReadEvacConfig(folder_ / "two.yaml"));
  std::vector<std::string> frames = words;
  frames.insert(frames.end(), {"--weights", folder_ / "two.safetensors", "--steps", "1", "--chunks", "1", "--out",
                               folder_ / "frames"});
  const CommandResult result = RunCommand(frames);
  ASSERT_EQ(result.exit_code, 0) << result.err;
  EXPECT_EQ(ReadAllFrames(folder_ / "frames/imagined.mp4").at(2).size(), cv::Size(128, 64));
  frames.insert(frames.end(), {"--cameras", "head", "--restart"});
  EXPECT_THAT(RunCommand(frames).err, HasSubstr("1 cameras, wanted 2"));
}

TEST_F(ImagineCommand, FourNamedFilesAndTheFolderGiveTheSameMaps) {
  const fs::path frame = folder_ / "first.png";
  cv::imwrite(frame.string(),
              cv::Mat(SyntheticClip::kHeight_px, SyntheticClip::kWidth_px, CV_8UC3, cv::Scalar::all(9)));
  ASSERT_EQ(RunCommand(Words("folder", {"--maps-only"})).exit_code, 0);
  const CommandResult named = RunCommand({Binary("evac"), "imagine", "--maps-only", "--frame", frame.string(),
                                          "--actions", folder_ / "proprio_stats/327/648642/proprio_stats.h5",
                                          "--extrinsics", Page("head_extrinsic_params_aligned.json").string(),
                                          "--intrinsics", Page("head_intrinsic_params.json").string(), "--config",
                                          folder_ / "tiny.yaml", "--out", folder_ / "named"});
  ASSERT_EQ(named.exit_code, 0) << named.err;
  EXPECT_EQ(Files("named"), Files("folder"));
}

TEST_F(ImagineCommand, MapsWrittenAgainReplaceTheOldOnesWhole) {
  ASSERT_EQ(RunCommand(Words("maps", {"--maps-only", "--stride", "1"})).exit_code, 0);
  ASSERT_EQ(RunCommand(Words("maps", {"--maps-only", "--stride", "1", "--chunks", "1"})).exit_code, 0);
  EXPECT_EQ(Files("maps").size(), 3u);
  EXPECT_FALSE(fs::exists(folder_ / "maps/maps.old"));
}

/// maps, maps.old and maps.tmp went, whoever's they were.
TEST_F(ImagineCommand, SomebodysFilesWhereMapsWouldBeAreRefusedAndStay) {
  for (const char* name : {"out/maps/own.txt", "out/maps/frame_1.png", "out/maps.tmp/frame_00000.png"}) {
    WriteText(folder_ / name, "mine");
    for (const auto& words : {Words("out", {"--maps-only"}), Frames("out")}) {
      const CommandResult result = RunCommand(words);
      EXPECT_EQ(result.exit_code, 2) << result.err;
      EXPECT_THAT(result.err, HasSubstr((folder_ / name).parent_path().string() + ":"));
      EXPECT_EQ(ReadFile(folder_ / name), "mine");
    }
    fs::remove_all(folder_ / "out");
  }
  WriteText(folder_ / "out/maps.old/frame_00000.png", "mine");
  ASSERT_EQ(RunCommand(Words("out", {"--maps-only"})).exit_code, 0);
  ASSERT_EQ(RunCommand(Words("out", {"--maps-only"})).exit_code, 0);
  EXPECT_EQ(ReadFile(folder_ / "out/maps.old/frame_00000.png"), "mine");
}

TEST_F(ImagineCommand, FramesThatNoJobOfOutMadeAreRefusedAndStay) {
  WriteText(folder_ / "out/frames/frame_00000.png", "mine");
  const CommandResult result = RunCommand(Frames("out"));
  EXPECT_EQ(result.exit_code, 2);
  EXPECT_THAT(result.err, HasSubstr((folder_ / "out/frames").string() + ":"));
  EXPECT_EQ(ReadFile(folder_ / "out/frames/frame_00000.png"), "mine");
}

TEST_F(ImagineCommand, AFirstFrameIsNotTakenFromWhatWouldBeReplaced) {
  ASSERT_EQ(RunCommand(Frames("out", {"--chunks", "1"})).exit_code, 0);
  const std::string frame = folder_ / "out/frames/frame_00000.png";
  cv::imwrite(frame, cv::Mat(SyntheticClip::kHeight_px, SyntheticClip::kWidth_px, CV_8UC3, cv::Scalar::all(9)));
  const auto before = Results("out");
  const CommandResult result =
      RunCommand({Binary("evac"), "imagine", "--frame", frame, "--actions",
                  folder_ / "proprio_stats/327/648642/proprio_stats.h5", "--extrinsics",
                  Page("head_extrinsic_params_aligned.json").string(), "--intrinsics",
                  Page("head_intrinsic_params.json").string(), "--config", folder_ / "tiny.yaml", "--weights",
                  folder_ / "tiny.safetensors", "--steps", "2", "--threads", "1", "--stride", "1", "--restart", "--out",
                  folder_ / "out"});
  EXPECT_EQ(result.exit_code, 2) << result.err;
  EXPECT_THAT(result.err, HasSubstr(frame + ": lies in"));
  EXPECT_EQ(Results("out"), before);
}

TEST_F(ImagineCommand, MapsAloneDoNotReplaceThoseOfWhatWasImaginedNorThoseThatAreBeingWritten) {
  ASSERT_EQ(RunCommand(Frames("out")).exit_code, 0);
  const auto before = Results("out");
  const CommandResult result = RunCommand(Words("out", {"--maps-only", "--stride", "1", "--chunks", "1"}));
  EXPECT_EQ(result.exit_code, 2);
  EXPECT_THAT(result.err, AllOf(HasSubstr((folder_ / "out").string()), HasSubstr("--maps-only")));
  EXPECT_EQ(Results("out"), before);
  fs::create_directory(folder_ / "held");
  const RunLock lock(folder_ / "held/lock");
  const CommandResult held = RunCommand(Words("held", {"--maps-only"}));
  EXPECT_EQ(held.exit_code, 2);
  EXPECT_THAT(held.err, HasSubstr("is writing here"));
}

TEST_F(ImagineCommand, RestartThrowsAwayWhatAJobLeftAndNothingElse) {
  ASSERT_EQ(RunCommand(Frames("out")).exit_code, 0);
  WriteText(folder_ / "out/frames/own.txt", "mine");
  const CommandResult result = RunCommand(Frames("out", {"--seed", "9", "--restart"}));
  EXPECT_EQ(result.exit_code, 2);
  EXPECT_THAT(result.err, HasSubstr((folder_ / "out/frames").string() + ":"));
  EXPECT_EQ(ReadFile(folder_ / "out/frames/own.txt"), "mine");
  fs::remove(folder_ / "out/frames/own.txt");
  WriteText(folder_ / "out/chunks/own.txt", "mine");
  ASSERT_EQ(RunCommand(Frames("out", {"--seed", "9", "--restart"})).exit_code, 0);
  EXPECT_EQ(ReadFile(folder_ / "out/chunks/own.txt"), "mine");
}

TEST_F(ImagineCommand, ADistortedCameraIsRefusedWhereverItsPageSaysSo) {
  for (const std::string coefficients :
       {R"("k1": -0.3,)", R"("distortion": {"k1": "0.02"},)", R"("D": [0, 0, 1e-4],)"}) {
    WriteText(Page("head_intrinsic_params.json"),
              R"({"intrinsic": {)" + coefficients + R"("fx": 40, "fy": 41, "ppx": 24, "ppy": 16}})");
    ExpectRefused(Words("refused", {"--maps-only"}), "a distorted camera is no pinhole");
  }
}

TEST_F(ImagineCommand, BadInputEndsInOneMessageAndLeavesNothing) {
  ExpectRefused(Words("refused", {"--maps-only", "--frame", "frame.png"}),
                "--frame and --recording exclude each other");
  ExpectRefused({Binary("evac"), "imagine", "--maps-only", "--frame", "frame.png", "--out", folder_ / "refused"},
                "--actions is missing");
  ExpectRefused(Words("refused", {}), "--weights is missing");
  ExpectRefused(Words("refused", {"--maps-only", "--reference-quirks", "all,odd"}), "found 'odd'");
  ExpectRefused(Words("refused", {"--maps-only", "--cameras", "head,hand_left"}), "2 cameras, wanted 1");
  ExpectRefused(Words("refused", {"--maps-only", "--stride", "8"}), "nothing to imagine");
  ExpectRefused(Words("refused", {"--weights", folder_ / "none.safetensors"}), "none.safetensors");
  EXPECT_EQ(RunCommand(Frames("refused", {"--eta", "2"})).exit_code, 2);
  ExpectRefused(Frames("refused", {"--dtype", "f16"}), "--dtype f16");
  ExpectRefused(Words("refused", {"--weights", folder_ / "tiny.safetensors", "--solver", "dpm", "--steps", "1"}),
                "--steps 1: wanted 2 … 1000 with dpm");
  if (!nn::HasCuda()) ExpectRefused(Frames("refused", {"--device", "cuda"}), "has no CUDA");
  ExpectRefused(Frames("refused", {"--statistics", folder_ / "none.yaml"}), "none.yaml");
  WriteText(folder_ / "tiny.yaml", std::string(kTiny) + "image_hight_px: 32\n");
  ExpectRefused(Words("refused", {"--maps-only"}), "image_hight_px");
  fs::remove(Page("head_intrinsic_params.json"));
  WriteText(folder_ / "tiny.yaml", kTiny);
  ExpectRefused(Words("refused", {"--maps-only"}), "head_intrinsic_params.json");
}

TEST_F(ImagineCommand, TheSameSeedImaginesTheSameBytesAndAnotherSeedOthers) {
  for (const auto& [out, seed] : {std::pair("a", "7"), std::pair("b", "7"), std::pair("c", "8")}) {
    const CommandResult result = RunCommand(Frames(out, {"--seed", seed}));
    ASSERT_EQ(result.exit_code, 0) << result.err;
    EXPECT_THAT(result.err, HasSubstr("chunk 3 of 3 done"));
  }
  EXPECT_EQ(Results("a"), Results("b"));
  const auto a = Files("a"), c = Files("c");
  EXPECT_EQ(a.at("maps/frame_00004.png"), c.at("maps/frame_00004.png"));
  EXPECT_NE(a.at("frames/frame_00000.png"), c.at("frames/frame_00000.png"));
  EXPECT_EQ(a.count("frames/frame_00006.png"), 1u);
  EXPECT_EQ(a.count("frames/frame_00007.png"), 0u) << "what fills the last chunk is no frame";
}

TEST_F(ImagineCommand, WeightsSayHowActionsAreNormalisedAndWhichPeriodTheyAreFor) {
  ActionStatistics mine = AgiBotWorldStatistics();
  mine.robot = "mine";
  mine.deviation[0] *= 3;
  nn::RandomWeights weights(5);
  const TensorMetadata says = {{"statistics", StatisticsPage(mine)}, {"period_s", "0.0333333"}, {"cameras", "head"}};
  nn::SaveWeights(folder_ / "tiny.safetensors", weights, ReadEvacConfig(folder_ / "tiny.yaml"), {.metadata = says});
  const CommandResult result = RunCommand(Frames("out"));
  ASSERT_EQ(result.exit_code, 0) << result.err;
  const auto job = nlohmann::json::parse(ReadFile(folder_ / "out/imagined.json")).at("job");
  EXPECT_EQ(job.at("statistics").at("deviation"), nlohmann::json(mine.deviation));

  ExpectRefused(Frames("refused", {"--statistics", EVAC_SOURCE_DIR "/apps/configs/robots/agibotworld.yaml"}),
                "deviation of left x");
  ExpectRefused(Words("refused", {"--weights", folder_ / "tiny.safetensors", "--steps", "2", "--stride", "3"}), "frames 0.1 s apart are asked for");
}

/// Packed with a period typed in few digits, a robot's own recordings were those of another period.
TEST_F(ImagineCommand, APeriodThatWasRoundedWhenPackingIsTheRecordings) {
  nn::RandomWeights weights(5);
  const auto of_period = [&](const char* period_s) {
    nn::SaveWeights(folder_ / "tiny.safetensors", weights, ReadEvacConfig(folder_ / "tiny.yaml"),
                    {.metadata = {{"period_s", period_s}}});
  };
  of_period("0.0333");  // of 30 Hz
  const CommandResult result = RunCommand(Frames("rounded"));
  EXPECT_EQ(result.exit_code, 0) << result.err;
  of_period("0.035");
  ExpectRefused(Frames("refused"), "frames 0.03333333 s apart are asked for");
}

TEST_F(ImagineCommand, WeightsOfOtherArmsThanTheRecordingsAreRefused) {
  nn::RandomWeights weights(5);
  nn::SaveWeights(folder_ / "tiny.safetensors", weights, ReadEvacConfig(folder_ / "tiny.yaml"),
                  {.metadata = {{"arms", "right"}}});
  ExpectRefused(Frames("refused"), "found arms left, right, wanted right");
  ExpectRefused(Words("refused", {"--maps-only", "--weights", folder_ / "tiny.safetensors"}),
                "found arms left, right, wanted right");
}

TEST_F(ImagineCommand, MapsOfWeightsThatAreNamedAreThoseThatTheirFramesAreImaginedFrom) {
  nn::RandomWeights weights(5);
  nn::SaveWeights(folder_ / "tiny.safetensors", weights, ReadEvacConfig(folder_ / "tiny.yaml"),
                  {.metadata = {{"period_s", "0.0333333"}}});
  const CommandResult maps = RunCommand(Words("maps", {"--maps-only", "--weights", folder_ / "tiny.safetensors"}));
  ASSERT_EQ(maps.exit_code, 0) << maps.err;
  ASSERT_EQ(RunCommand(Frames("frames")).exit_code, 0);
  const auto of_maps = Files("maps"), of_frames = Files("frames");
  ASSERT_EQ(of_maps.size(), 7u) << "every step of 30 Hz";
  for (const auto& [name, hash] : of_maps) EXPECT_EQ(of_frames.at(name), hash) << name;
}

TEST_F(ImagineCommand, ToldArmsAreDrawnWhereTheyAreAskedForAndRecorded) {
  const TreePlace place{folder_ / "late", "carry", "1"};
  WriteLateRecording(place);
  const auto maps = [&](const std::string& arms) {
    const CommandResult result =
        RunCommand({Binary("evac"), "imagine", "--maps-only", "--recording", place.Folder().string(), "--config",
                    folder_ / "tiny.yaml", "--stride", "1", "--arms", arms, "--out", folder_ / arms});
    EXPECT_EQ(result.exit_code, 0) << result.err;
    return Files(arms);
  };
  const auto told = maps("told"), measured = maps("measured");
  ASSERT_EQ(told.size(), 4u);
  EXPECT_EQ(told.at("maps/frame_00001.png"), measured.at("maps/frame_00002.png")) << "the arms are a step late";
  EXPECT_NE(told.at("maps/frame_00001.png"), measured.at("maps/frame_00001.png"));
  ExpectRefused(Words("refused", {"--maps-only", "--arms", "told"}), "does not say where the arms were told to be");
}

TEST_F(ImagineCommand, WhereToldArmsAreNotRecordedThatIsSaid) {
  nn::RandomWeights weights(5);
  nn::SaveWeights(folder_ / "tiny.safetensors", weights, ReadEvacConfig(folder_ / "tiny.yaml"),
                  {.metadata = {{"arms_read", "told"}}});
  const CommandResult result =
      RunCommand(Words("maps", {"--maps-only", "--stride", "1", "--weights", folder_ / "tiny.safetensors"}));
  EXPECT_EQ(result.exit_code, 0);
  EXPECT_THAT(result.err, HasSubstr("warning"));
  EXPECT_THAT(result.err, HasSubstr("where they were is taken"));
  const CommandResult asked = RunCommand(Words(
      "asked", {"--maps-only", "--stride", "1", "--weights", folder_ / "tiny.safetensors", "--arms", "measured"}));
  EXPECT_EQ(asked.err, "");
  EXPECT_EQ(Files("asked"), Files("maps"));
}

TEST_F(ImagineCommand, TheVideoShowsEachPictureAboveItsMapAndTheSidecarSaysHowItWasMade) {
  ASSERT_EQ(RunCommand(Frames("out")).exit_code, 0);
  const std::vector<cv::Mat> video = ReadAllFrames(folder_ / "out/imagined.mp4");
  ASSERT_EQ(video.size(), 7u);
  ASSERT_EQ(video[2].size(), cv::Size(64, 64));
  const cv::Mat map = cv::imread(folder_ / "out/maps/frame_00002.png");
  EXPECT_LT(
      cv::norm(cv::mean(video[2].rowRange(32, 64)), cv::Scalar(cv::mean(map)[2], cv::mean(map)[1], cv::mean(map)[0])),
      4);
  const auto sidecar = nlohmann::json::parse(ReadFile(folder_ / "out/imagined.json"));
  EXPECT_EQ(sidecar["finished"], true);
  EXPECT_EQ(sidecar["frames"], 7);
  EXPECT_EQ(sidecar["video"]["sha256"], Sha256HexOfFile(folder_ / "out/imagined.mp4"));
  EXPECT_EQ(sidecar["job"]["weights"], Sha256HexOfFile(folder_ / "tiny.safetensors"));
  std::vector<std::string> words = sidecar["command"];
  words[0] = Binary("evac");
  words.insert(words.end(), {"--out", folder_ / "again", "--png"});
  const CommandResult again = RunCommand(words);
  ASSERT_EQ(again.exit_code, 0) << again.err;
  EXPECT_EQ(Results("again"), Results("out"));
}

TEST_F(ImagineCommand, KilledAtAnyMomentItGoesOnAndEndsWithTheSameBytes) {
  ASSERT_EQ(RunCommand(Frames("whole")).exit_code, 0);
  for (const std::string until :
       {"imagined.json", "chunks/chunk_00000.safetensors", "chunks/chunk_00001.safetensors"}) {
    const pid_t pid = StartCommand(Frames("killed"), folder_ / "log");
    EXPECT_TRUE(system_test::WaitUntil([&] { return fs::exists(folder_ / ("killed/" + until)); })) << until;
    ::kill(pid, SIGKILL);
    ::waitpid(pid, nullptr, 0);
  }
  const auto first = fs::last_write_time(folder_ / "killed/chunks/chunk_00000.safetensors");
  const CommandResult last = RunCommand(Frames("killed"));
  ASSERT_EQ(last.exit_code, 0) << last.err;
  EXPECT_EQ(Results("killed"), Results("whole"));
  EXPECT_EQ(fs::last_write_time(folder_ / "killed/chunks/chunk_00000.safetensors"), first) << "not imagined again";
}

TEST_F(ImagineCommand, ADamagedChunkIsImaginedAgainWithAWarning) {
  ASSERT_EQ(RunCommand(Frames("whole")).exit_code, 0);
  const auto whole = Results("whole");
  const fs::path chunk = folder_ / "whole/chunks/chunk_00001.safetensors";
  std::string bytes = ReadFile(chunk);
  bytes.back() ^= 1;
  WriteText(chunk, bytes);
  const CommandResult again = RunCommand(Frames("whole"));
  ASSERT_EQ(again.exit_code, 0) << again.err;
  EXPECT_THAT(again.err, HasSubstr("its numbers are not those that were written; it is imagined again"));
  EXPECT_EQ(Results("whole"), whole);
}

TEST_F(ImagineCommand, AnotherJobIsRefusedByNameMoreChunksAreAddedAndRestartBeginsAnew) {
  ASSERT_EQ(RunCommand(Frames("out", {"--chunks", "1"})).exit_code, 0);
  auto one = Files("out");
  const CommandResult other = RunCommand(Frames("out", {"--seed", "9", "--eta", "0.5"}));
  EXPECT_EQ(other.exit_code, 2);
  EXPECT_THAT(other.err, AllOf(HasSubstr("eta is 1.0 there, 0.5 here"), HasSubstr("seed is 0 there, 9 here"),
                               Not(HasSubstr("weights")), HasSubstr("--restart")));
  one["lock"] = Files("out").at("lock");
  EXPECT_EQ(Files("out"), one) << "nothing was touched";
  const CommandResult more = RunCommand(Frames("out"));
  ASSERT_EQ(more.exit_code, 0) << more.err;
  EXPECT_EQ(Files("out").at("chunks/chunk_00000.safetensors"), one.at("chunks/chunk_00000.safetensors"));
  EXPECT_EQ(Files("out").count("frames/frame_00006.png"), 1u);
  ASSERT_EQ(RunCommand(Frames("out", {"--seed", "9", "--restart"})).exit_code, 0);
  ASSERT_EQ(RunCommand(Frames("nine", {"--seed", "9"})).exit_code, 0);
  EXPECT_EQ(Results("out"), Results("nine"));
}

TEST_F(ImagineCommand, EverySolverAndQuirkImaginesSomethingElse) {
  const std::vector<std::vector<std::string>> jobs = {{},
                                                      {"--solver", "dpm"},
                                                      {"--eta", "0"},
                                                      {"--cfg", "3"},
                                                      {"--dtype", "bf16"},
                                                      {"--reference-quirks", "residual_noise"},
                                                      {"--reference-quirks", "memory_not_scaled"},
                                                      {"--reference-quirks", "delta_window"},
                                                      {"--reference-quirks", "decoded_start"},
                                                      {"--reference-quirks", "all"}};
  std::set<std::string> latents;
  for (std::size_t i = 0; i < jobs.size(); ++i) {
    const std::string out = std::to_string(i);
    const CommandResult result = RunCommand(Frames(out, jobs[i]));
    ASSERT_EQ(result.exit_code, 0) << result.err;
    const TensorFile chunk = TensorFile::Open(fs::path(folder_ / out) / "chunks/chunk_00001.safetensors");
    const auto bytes = chunk.Get("latents").bytes;
    const std::string_view numbers(reinterpret_cast<const char*>(bytes.data()), bytes.size());
    EXPECT_TRUE(latents.insert(Sha256Hex(numbers)).second) << testing::PrintToString(jobs[i]);
  }
}

}  // namespace
}  // namespace evac
