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

}  // namespace
}  // namespace evac
