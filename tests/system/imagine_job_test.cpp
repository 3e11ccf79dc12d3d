#include "apps/networks/imagine_job.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "apps/networks/imagine_start.h"
#include "core/error.h"
#include "tests/support/command.h"
#include "tests/support/synthetic_recording.h"
#include "tests/support/temp_folder.h"
#include "worldmodel/action_statistics.h"
#include "worldmodel/evac_config.h"
#include "worldmodel/motion_statistics.h"
#include "worldmodel/nn/weights.h"

namespace evac {
namespace {

using testing::HasSubstr;

/// What copies or writes such a page calls itself at every bracket; the process crashed.
TEST(Sidecar, AMillionBracketsInsteadOfAnotherJobsNumberAreRefused) {
  const TempFolder folder;
  const std::string deep = std::string(1'000'000, '[') + std::string(1'000'000, ']');
  ImagineArguments arguments;
  arguments.out = folder.path();
  const auto taken = [&](const std::string& page) {
    WriteText(folder / kImagined, page);
    return Sidecar(arguments, ImagineStart(), {{"eta", 1.0}, {"seed", 9}});
  };
  EXPECT_THAT([&] { taken("{\"job\": {\"eta\": " + deep + ", \"seed\": 0}}"); },
              testing::ThrowsMessage<Error>(HasSubstr("says of no job of evac imagine")));
  EXPECT_THAT([&] { taken("{\"job\": " + deep + "}"); },
              testing::ThrowsMessage<Error>(HasSubstr("says of no job of evac imagine")));
  EXPECT_NO_THROW(taken("{\"job\": {\"eta\": 1.0, \"seed\": 9}}"));
}

/// `evac run` said it of the same weights; imagined by another robot's motion, nobody was told.
TEST(ImagineFrames, SaysWhereNobodySaidTheStatisticsWhoseTheyAre) {
  const TempFolder folder;
  SyntheticClip two(8);
  two.cameras = {"head", "hand_left"};
  two.Write(OneFolder(folder / "two"));
  const std::string config = EVAC_SOURCE_DIR "/tests/system/evac_small.yaml", weights = folder / "small.safetensors";
  const auto imagine = [&](const TensorMetadata& says, const std::string& out) {
    nn::RandomWeights random(5);
    nn::SaveWeights(weights, random, ReadEvacConfig(config), {.metadata = says});
    return RunCommand({Binary("evac"), "imagine", "--recording", folder / "two", "--config", config, "--weights",
                       weights, "--stride", "1", "--steps", "1", "--chunks", "1", "--threads", "1", "--out", folder / out});
  };
  const CommandResult silent = imagine({}, "silent");
  ASSERT_EQ(silent.exit_code, 0) << silent.err;
  EXPECT_THAT(silent.err, HasSubstr("evac: warning: neither --statistics nor " + weights + " says the statistics of "
                                    "the arms' motion: taken are AgiBot World's\n"));
  const CommandResult said = imagine({{"statistics", StatisticsPage(AgiBotWorldStatistics())}}, "said");
  ASSERT_EQ(said.exit_code, 0) << said.err;
  EXPECT_THAT(said.err, testing::Not(HasSubstr("AgiBot World")));
}

/// A one-armed robot's wrist camera is the right one's: the left one's was missed, which `evac pack` does not ask for.
TEST(ImagineMaps, TakeOfARecordingTheCamerasThatItHas) {
  const TempFolder folder;
  SyntheticClip clip(8);
  clip.cameras = {"head", "hand_right"};
  clip.LoseLeftArm();
  clip.Write(OneFolder(folder / "clip"));
  SyntheticClip(8).Write(OneFolder(folder / "head_alone"));
  const auto maps = [&](const std::string& recording, const std::string& out) {
    return RunCommand({Binary("evac"), "imagine", "--maps-only", "--recording", folder / recording, "--config",
                       EVAC_SOURCE_DIR "/tests/system/evac_small.yaml", "--out", folder / out});
  };
  const CommandResult taken = maps("clip", "maps");
  EXPECT_EQ(taken.exit_code, 0) << taken.err;
  ImagineInputs inputs;
  inputs.recording = folder / "clip";
  EXPECT_THAT(NamesOf(ReadImagineStart(inputs, 2).scene.cameras), testing::ElementsAre("head", "hand_right"));
  const CommandResult too_few = maps("head_alone", "refused");
  EXPECT_EQ(too_few.exit_code, 2);
  EXPECT_THAT(too_few.err, HasSubstr((folder / "head_alone").string() + ": cameras: found 1 (head), wanted 2, one for each view"));
  std::filesystem::create_directory(folder / "none");
  EXPECT_THAT(maps("none", "refused").err, HasSubstr("no recording; wanted"));
  EXPECT_THAT(maps("nowhere", "refused").err, HasSubstr("no such folder"));
  EXPECT_FALSE(std::filesystem::exists(folder / "refused"));
}

/// `--cameras`, which nobody had given, was said to be wrong, and the next message wanted them back.
TEST(ImagineFrames, WeightsOfMoreViewsThanTheSizesWantTheirOwnPage) {
  const TempFolder folder;
  SyntheticClip(8).Write(OneFolder(folder / "one"));
  const std::string config = EVAC_SOURCE_DIR "/tests/system/evac_small.yaml", weights = folder / "small.safetensors";
  nn::RandomWeights random(5);
  nn::SaveWeights(weights, random, ReadEvacConfig(config), {.metadata = {{"cameras", "head,hand_right"}}});
  const std::vector<std::string> words = {Binary("evac"), "imagine", "--recording", folder / "one", "--weights",
                                          weights, "--out", folder / "out"};
  for (const std::vector<std::string>& more : {std::vector<std::string>{}, {"--maps-only"}, {"--cameras", "head"}}) {
    std::vector<std::string> all = words;
    all.insert(all.end(), more.begin(), more.end());
    const CommandResult result = RunCommand(all);
    EXPECT_EQ(result.exit_code, 2) << result.err;
    EXPECT_THAT(result.err, testing::AllOf(HasSubstr(weights + ": its network sees head,hand_right (2 views)"),
                                           HasSubstr("--config"), testing::Not(HasSubstr("--cameras"))));
    EXPECT_FALSE(std::filesystem::exists(folder / "out"));
  }
}

}  // namespace
}  // namespace evac
