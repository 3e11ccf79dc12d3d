#include <gtest/gtest.h>

#include <filesystem>
#include <nlohmann/json.hpp>

#include "core/npy.h"
#include "core/store.h"
#include "core/video.h"
#include "tests/support/command.h"
#include "tests/support/temp_folder.h"

namespace evac {
namespace {

namespace fs = std::filesystem;

class Replay : public ::testing::TestWithParam<const char*> {};

TEST_P(Replay, ARecordedEpisodeOfARealRobotRunsThroughThePolicyAndTheWorldWithAllItsSteps) {
  const fs::path recording = fs::path(EVAC_SHARED_DIR) / "data/agibot_examples" / GetParam();
  if (!fs::exists(recording)) GTEST_SKIP() << "the recording " << recording << " is not here";
  const TempFolder folder;
  const fs::path run = folder / "run";
  const CommandResult result = RunCommand({Binary("evac"), "run", EVAC_SOURCE_DIR "/apps/configs/agibot_replay.yaml", "--out", run.string(), "--set",
                                           "recording=" + recording.string()});
  ASSERT_EQ(result.exit_code, 0) << result.err;

  const auto listed = nlohmann::json::parse(RunCommand({Binary("evac"), "ls", run.string(), "--json"}).out);
  ASSERT_EQ(listed.size(), 1u);
  EXPECT_EQ(listed[0]["stop"], "recording_end");
  EXPECT_TRUE(listed[0]["failure"].is_null());

  const std::size_t steps = ReadNpy(recording / "action.npy").shape.at(0);
  Store store = Store::Open(run, Store::Mode::kReadOnly);
  Episode episode = store.Episodes().at(0);
  store.LoadSteps(episode);
  EXPECT_EQ(episode.commands.size(), steps - 1);
  EXPECT_EQ(ReadAllFrames(run / episode.video).size(), steps);
}

INSTANTIATE_TEST_SUITE_P(AgiBot, Replay, ::testing::Values("example0", "example1"));

}  // namespace
}  // namespace evac
