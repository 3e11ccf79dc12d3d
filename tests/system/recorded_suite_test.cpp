#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <set>

#include "apps/factory.h"
#include "apps/network_parts.h"
#include "core/error.h"
#include "core/file.h"
#include "core/recording_writer.h"
#include "core/store.h"
#include "tests/support/command.h"
#include "tests/support/late_recording.h"
#include "tests/support/synthetic_recording.h"
#include "tests/support/temp_folder.h"
#include "tests/system/run_support.h"
#include "worldmodel/evac_config.h"
#include "worldmodel/nn/weights.h"

/// A suite with a recording instead of tasks, and a network in it that was trained on others of the same robot.
namespace evac {
namespace {

namespace fs = std::filesystem;
using system_test::RunWords;
using testing::AllOf;
using testing::HasSubstr;
using testing::ThrowsMessage;

constexpr const char* kEcho = "  - {name: echo, type: echo}\n";
constexpr const char* kEvac = "  - {name: evac, type: evac, weights: two.safetensors, config: small.yaml, steps: 1}\n";

/// A recording as AgiBot World has them: 30 Hz, three cameras, two arms. And weights of two views at 10 Hz.
class RecordedSuite : public testing::Test {
 protected:
  RecordedSuite() {
    SyntheticClip clip(25);  // every third: 9 steps, 8 targets
    clip.cameras = {"head", "hand_left", "hand_right"};
    std::ranges::fill(clip.grippers, 60.0F);
    clip.Write(OneFolder(folder_ / "pour"));
    fs::copy_file(EVAC_SOURCE_DIR "/tests/system/evac_small.yaml", folder_ / "small.yaml");
    WriteWeights("two", {{"period_s", "0.1"}, {"cameras", "head,hand_right"}, {"arms", "left,right"}});
  }

  void WriteWeights(const std::string& name, const TensorMetadata& says) const {
    nn::RandomWeights random(5);
    nn::SaveWeights(folder_ / (name + ".safetensors"), random, ReadEvacConfig(folder_ / "small.yaml"),
                    {.metadata = says});
  }

  /// @param replay  more words of the policy's command, as the YAML's list goes on
  fs::path WriteSuite(const std::string& worlds, const std::string& replay = "") const {
    const fs::path path = folder_ / "suite.yaml";
    WriteText(path, "suite: recorded\nrecording: pour\nworlds:\n" + worlds +
                        "policies:\n  - {name: replay, checkpoint: recorded, command: [evac-policy, replay, "
                        "--recording, \"${recording}\"" +
                        replay + "]}\nchunk_size: 8\nlanes: 1\nvideo: {scale: 1}\n");
    return path;
  }

  Suite Filled(const std::string& worlds, const std::vector<std::string>& assignments = {}) const {
    Suite suite = ReadSuite(WriteSuite(worlds), assignments);
    FillInRecordedTask(suite);
    return suite;
  }

  static std::vector<std::string> Cameras(const Suite& suite) {
    std::vector<std::string> names;
    for (const Camera& camera : suite.tasks.front().cameras) names.push_back(camera.name);
    return names;
  }

  const TempFolder folder_;
};

TEST_F(RecordedSuite, ItsRecordingIsSeenAsTheNetworkWasTrainedAndByAllItsWorldsAlike) {
  const Suite suite = Filled(std::string(kEcho) + kEvac);
  const Task& task = suite.tasks.front();
  EXPECT_EQ(task.period_s, 0.1);
  EXPECT_EQ(task.max_chunks, 1) << "as long as the recording: 8 steps";
  EXPECT_EQ(Cameras(suite), (std::vector<std::string>{"head", "hand_right"}));
  for (const SuiteWorld& world : suite.worlds) {
    const std::unique_ptr<World> made = MakeWorld(world, suite, nullptr);
    EXPECT_EQ(made->Reset(0, task, suite.initial_states.front(), 1).observation.images.size(), 2u) << world.name;
  }
}

TEST_F(RecordedSuite, TheDocumentedReplayTakesTheSameSteps) {
  const fs::path run = folder_ / "run";
  const CommandResult result = RunCommand(RunWords(WriteSuite(std::string(kEcho) + kEvac), run));
  ASSERT_EQ(result.exit_code, 0) << result.err;
  Store store = Store::Open(run, Store::Mode::kReadOnly);
  ASSERT_EQ(store.Episodes().size(), 2u);
  for (Episode& episode : store.Episodes()) {
    EXPECT_EQ(episode.stop, StopReason::kRecordingEnd) << episode.failure;
    store.LoadSteps(episode);
    ASSERT_EQ(episode.commands.size(), 8u) << episode.key.world;
    EXPECT_NEAR(episode.commands[1][0].base_from_gripper.translation().x(), 0.4 + 6 * 0.01, 1e-6) << "step 6 of 30 Hz";
  }
}

TEST_F(RecordedSuite, WithoutANetworkItsRecordingIsReadWhole) {
  const Suite suite = Filled(kEcho);
  EXPECT_NEAR(suite.tasks.front().period_s, 1.0 / 30, 1e-12);
  EXPECT_EQ(suite.tasks.front().max_chunks, 3) << "24 steps";
  EXPECT_EQ(Cameras(suite), (std::vector<std::string>{"head", "hand_left", "hand_right"}));
}

TEST_F(RecordedSuite, ComesToRestByTheRuleThatThePageSaysAndByNoneOfItsOwn) {
  const auto with = [&](const std::string& line) { return Filled(std::string(kEcho) + line + "\n"); };
  EXPECT_FALSE(Filled(kEcho).tasks.front().still.enabled);
  const StillRule still = with("still: {translation_m: 0.002}").tasks.front().still;
  EXPECT_TRUE(still.enabled);
  EXPECT_EQ(still.translation_m, 0.002);
  EXPECT_EQ(still.dwell_chunks, StillRule{}.dwell_chunks);
  EXPECT_TRUE(with("still: {}").tasks.front().still.enabled) << "as docs/your_robot.md writes it";
  EXPECT_THAT([&] { with("still: {speed: 1}"); }, testing::ThrowsMessage<Error>(testing::HasSubstr("speed")));
  EXPECT_THAT([&] { with("image: {height_px: 64, width_px: 96}"); },
              testing::ThrowsMessage<Error>(testing::HasSubstr("none beside a `recording`")));
}

TEST_F(RecordedSuite, OfWeightsThatDoNotSayTheirCamerasAsManyAreSeenAsThereAreViews) {
  WriteWeights("two", {});
  EXPECT_EQ(Cameras(Filled(kEvac)), (std::vector<std::string>{"head", "hand_left"}));
}

TEST_F(RecordedSuite, TwoNetworksThatWantItOtherwiseAreRefusedWithWhatEachWants) {
  const std::string other = "  - {name: other, type: evac, weights: other.safetensors, config: small.yaml, steps: 1}\n";
  WriteWeights("other", {{"cameras", "head,hand_right"}});
  EXPECT_NO_THROW(Filled(kEvac + other));
  WriteWeights("other", {{"cameras", "head,hand_left"}});
  EXPECT_THAT([&] { Filled(kEvac + other); },
              ThrowsMessage<Error>(AllOf(HasSubstr("world evac is to see frames 0.1 s apart of head, hand_right"),
                                         HasSubstr("world other frames 0.1 s apart of head, hand_left"))));
  WriteWeights("other", {{"cameras", "head,hand_right"}});
  EXPECT_THAT([&] { Filled(kEvac + other, {"worlds.1.period_s=0.2"}); },
              ThrowsMessage<Error>(HasSubstr("world other frames 0.2 s apart")));
}

TEST_F(RecordedSuite, APeriodThatIsNoMultipleOfItsStepsIsRefused) {
  WriteWeights("two", {});
  EXPECT_THAT([&] { Filled(kEvac, {"worlds.0.period_s=0.05"}); },
              ThrowsMessage<Error>(HasSubstr("steps of 0.03333 s: wanted steps of 0.05 s, or of a whole part of it")));
}

TEST_F(RecordedSuite, WeightsOfOtherArmsAreRefusedWithBoth) {
  WriteWeights("two", {{"arms", "right"}});
  const Suite suite = Filled(kEvac);
  EXPECT_THAT([&] { CheckNetwork(suite.worlds.front(), suite.tasks); },
              ThrowsMessage<Error>(AllOf(HasSubstr("world evac: task pour: found arms left, right, wanted right"),
                                         HasSubstr("two.safetensors"))));
}

TEST_F(RecordedSuite, ATaskOfFewerCamerasThanTheNetworkHasViewsIsRefusedBeforeTheFirstEpisode) {
  WriteWeights("two", {});
  Suite suite = Filled(kEvac);
  suite.tasks.front().cameras.pop_back();
  EXPECT_THAT([&] { CheckNetwork(suite.worlds.front(), suite.tasks); },
              ThrowsMessage<Error>(HasSubstr("world evac: task pour has 1 cameras, the network imagines 2 views")));
}

TEST_F(RecordedSuite, ItsHashCoversWhatLiesElsewhereInTheTree) {
  const TreePlace place{folder_ / "tree", "carry", "1"};
  WriteLateRecording(place);
  const fs::path page = WriteSuite(kEcho);
  const auto hash = [&] { return ReadSuite(page, {"recording=" + place.Folder().string()}).hash; };
  std::set<std::string> hashes = {hash()};
  EXPECT_EQ(ReadSuite(page, {"recording=" + (place.Folder() / "videos").string()}).hash, *hashes.begin());
  fs::path last;
  for (const char* part : {"observations", "parameters", "proprio_stats"}) {
    for (const auto& entry : fs::recursive_directory_iterator(place.root / part)) {
      if (entry.is_regular_file()) last = entry.path();
    }
    WriteText(last, ReadFile(last) + " ");
    EXPECT_TRUE(hashes.insert(hash()).second) << last << " was changed and the hash is the same";
  }
}

TEST_F(RecordedSuite, ToldArmsAreReplayedWhereThatIsAskedForAndRecorded) {
  const TreePlace place{folder_ / "tree", "carry", "1"};
  WriteLateRecording(place);
  const std::string recording = "recording=" + place.Folder().string();
  for (const auto& [words, x_m] : {std::pair("", 0.4), std::pair(", --told", 0.41)}) {
    const fs::path run = folder_ / (*words == '\0' ? "measured" : "told");
    const CommandResult result = RunCommand(RunWords(WriteSuite(kEcho, words), run, {recording}));
    ASSERT_EQ(result.exit_code, 0) << result.err;
    Store store = Store::Open(run, Store::Mode::kReadOnly);
    Episode episode = store.Episodes().at(0);
    store.LoadSteps(episode);
    EXPECT_NEAR(episode.commands.at(0)[1].base_from_gripper.translation().x(), x_m, 1e-6) << words;
  }
  const CommandResult nothing_told =
      RunCommand({Binary("evac-policy"), "replay", "--recording", folder_ / "pour", "--told"});
  EXPECT_EQ(nothing_told.exit_code, 2) << nothing_told.err;
  EXPECT_THAT(nothing_told.err, HasSubstr("it does not say where the arms were told to be"));
}

}  // namespace
}  // namespace evac
