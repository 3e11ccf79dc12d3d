#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <opencv2/imgcodecs.hpp>

#include "apps/factory.h"
#include "apps/network_parts.h"
#include "apps/recorded_suite.h"
#include "core/error.h"
#include "core/file.h"
#include "core/store.h"
#include "tests/support/command.h"
#include "tests/support/synthetic_recording.h"
#include "tests/support/temp_folder.h"
#include "tests/system/run_support.h"
#include "worldmodel/evac_config.h"
#include "worldmodel/nn/weights.h"
#include "worldmodel/trained_for.h"

/// Suites over recordings as labs have them: with a rubric of their own, or a camera that a network does not ask for
/// broken.
namespace evac {
namespace {

namespace fs = std::filesystem;
using system_test::RunWords;
using testing::ElementsAre;
using testing::HasSubstr;

class OwnRecordings : public testing::Test {
 protected:
  void WriteClip(const std::string& name) const {
    SyntheticClip clip(25);
    clip.cameras = {"head", "hand_left", "hand_right"};
    std::ranges::fill(clip.grippers, 60.0F);
    clip.Write(OneFolder(folder_ / name));
  }

  /// A network of so many views and weights that do not say which cameras those are.
  void WriteNetwork(int views) const {
    std::string page = ReadFile(EVAC_SOURCE_DIR "/tests/system/evac_small.yaml");
    page.replace(page.find("views: 2"), 8, "views: " + std::to_string(views));
    WriteText(folder_ / "small.yaml", page);
    nn::RandomWeights random(5);
    nn::SaveWeights(folder_ / "small.safetensors", random, ReadEvacConfig(folder_ / "small.yaml"), {});
  }

  fs::path WriteSuite(const std::string& world, const std::string& recording, const std::string& more = "") const {
    const fs::path path = folder_ / "suite.yaml";
    WriteText(path, "suite: mine\nrecording: " + recording + "\nworlds:\n  - " + world +
                        "\npolicies:\n  - {name: hold, checkpoint: still, command: [evac-policy, hold]}\n"
                        "chunk_size: 8\nlanes: 1\nvideo: {scale: 1}\n" + more);
    return path;
  }

  const TempFolder folder_;
};

constexpr const char* kEcho = "{name: echo, type: echo}";
constexpr const char* kEvac = "{name: evac, type: evac, weights: small.safetensors, config: small.yaml, steps: 1}";

/// The oracle asked them for conditions, which a recording's rubric cannot have: such a suite could never run.
TEST_F(OwnRecordings, ARubricOfStagesInWordsIsValidAndRun) {
  WriteClip("pour");
  const fs::path page = WriteSuite(kEcho, "pour",
                                   "rubric: {success: The cup stands on the shelf.,\n"
                                   "         stages: [{name: held, description: The hand holds the cup.}]}\n");
  const CommandResult valid = RunCommand({Binary("evac"), "validate", page.string()});
  EXPECT_EQ(valid.exit_code, 0) << valid.err;
  const fs::path run = folder_ / "run";
  const CommandResult result = RunCommand(RunWords(page, run));
  ASSERT_EQ(result.exit_code, 0) << result.err;
  const CommandResult resumed = RunCommand({Binary("evac"), "resume", run.string()});
  EXPECT_EQ(resumed.exit_code, 0) << resumed.err;
  const CommandResult judged = RunCommand({Binary("evac"), "judge", run.string(), "--judge", "oracle"});
  EXPECT_EQ(judged.exit_code, 0) << judged.err;
  const Store store = Store::Open(run, Store::Mode::kReadOnly);
  ASSERT_EQ(store.Tasks().size(), 1u);
  const Rubric rubric = store.Tasks().front().rubric;
  ASSERT_EQ(rubric.stages.size(), 1u);
  EXPECT_EQ(rubric.stages.front().name, "held");
  EXPECT_EQ(store.Episodes().size(), 1u);
  ASSERT_EQ(store.Verdicts().size(), 1u);
  EXPECT_EQ(store.Verdicts().front().label, Label::kCannotTell) << store.Verdicts().front().reason;
}

/// To know the cameras' names all were read: every recording was left out, and a suite has no field to choose them by.
TEST_F(OwnRecordings, ANetworkThatSeesTheHeadAloneTakesRecordingsWhoseWristCamerasAreBroken) {
  for (const char* name : {"many/a", "many/b"}) {
    WriteClip(name);
    fs::remove(folder_ / name / "hand_left_color.mp4");
    WriteText(folder_ / name / "hand_right_intrinsic_params.json",
              R"({"intrinsic": {"fx": 40, "fy": 41, "ppx": 24, "ppy": 16, "k1": 0.1}})");
  }
  const auto filled = [&] {
    Suite suite = ReadSuite(WriteSuite(kEvac, "many"), {});
    FillInRecordedTask(suite);
    return suite;
  };
  WriteNetwork(1);
  const Suite suite = filled();
  EXPECT_EQ(suite.initial_states.size(), 2u);
  EXPECT_THAT(NamesOf(suite.tasks.front().cameras), ElementsAre("head"));
  EXPECT_NO_THROW(CheckNetwork(suite.worlds.front(), suite.tasks));
  WriteNetwork(2);
  testing::internal::CaptureStderr();
  EXPECT_THAT(filled, testing::ThrowsMessage<Error>(HasSubstr("no recording can be begun from")));
  EXPECT_THAT(testing::internal::GetCapturedStderr(), HasSubstr("camera hand_left has no video")) << "its second view";
}

/// Its two steps counted as 1/30 s apart, of which .05 s is no whole number.
TEST_F(OwnRecordings, AFirstFrameAndAStepBeginEpisodesOfANetworkOfAnyPeriod) {
  SyntheticClip(2).Write(OneFolder(folder_ / "first"));
  fs::remove(folder_ / "first/head_color.mp4");
  cv::imwrite((folder_ / "first/frame.png").string(), cv::Mat(32, 48, CV_8UC3, cv::Scalar::all(77)));
  WriteNetwork(1);
  Suite suite = ReadSuite(WriteSuite(kEvac, "first", "max_chunks: 3\n"), {"worlds.0.period_s=0.05"});
  FillInRecordedTask(suite);
  EXPECT_EQ(suite.tasks.front().period_s, 0.05);
  EXPECT_EQ(suite.tasks.front().max_chunks, 3);
  EXPECT_NO_THROW(CheckNetwork(suite.worlds.front(), suite.tasks));
}

/// Every recording was warned of, and at last their folder named: nothing was wrong with it.
TEST_F(OwnRecordings, AMistakeOfTheSuiteIsToldOnceAndBlamesNoRecording) {
  for (const char* name : {"many/a", "many/b"}) WriteClip(name);
  WriteNetwork(1);
  nn::RandomWeights random(5);
  nn::SaveWeights(folder_ / "small.safetensors", random, ReadEvacConfig(folder_ / "small.yaml"),
                  {.metadata = {{"period_s", "0.1"}, {"cameras", "head"}}});
  nn::SaveWeights(folder_ / "other.safetensors", random, ReadEvacConfig(folder_ / "small.yaml"),
                  {.metadata = {{"period_s", "0.1"}, {"cameras", "hand_left"}}});
  const auto expect_told = [&](const std::vector<std::string>& set, const std::string& what) {
    testing::internal::CaptureStderr();
    EXPECT_THAT(
        [&] {
          Suite suite = ReadSuite(WriteSuite(kEvac, "many"), set);
          FillInRecordedTask(suite);
        },
        testing::ThrowsMessage<Error>(testing::AllOf(HasSubstr(what), testing::Not(HasSubstr("begun from")))));
    EXPECT_EQ(testing::internal::GetCapturedStderr(), "") << what;
  };
  expect_told({"worlds.0.period_s=0.2"}, "world evac: field period_s");
  const std::string beside = folder_.path().string() + "/";
  const auto world = [&](const std::string& name) {
    return "{name: " + name + ", type: evac, weights: " + beside + name + ".safetensors, config: " + beside +
           "small.yaml, steps: 1}";
  };
  expect_told({"worlds=[" + world("small") + ", " + world("other") + "]"}, "world small is to see");
}

/// A task was called like its folder: pour/held_out and stack/held_out were one, pour/held_out and pour/next two.
TEST_F(OwnRecordings, TheirTaskIsCalledAsThePageSaysAndElseLikeTheirFolder) {
  WriteClip("pour/held_out/a");
  const auto called = [&](const std::string& recording, const std::string& more) {
    Suite suite = ReadSuite(WriteSuite(kEcho, recording, more), {});
    FillInRecordedTask(suite);
    return suite.tasks.front().id;
  };
  EXPECT_EQ(called("pour/held_out", ""), "held_out");
  EXPECT_EQ(called("pour/held_out", "task: pour\n"), "pour");
  EXPECT_EQ(called("pour/held_out/a", ""), "a");
  EXPECT_EQ(called("pour/held_out/a", "task: pour\n"), "pour") << "of one alone too";
}

}  // namespace
}  // namespace evac
