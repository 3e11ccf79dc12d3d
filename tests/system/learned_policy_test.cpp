#include <ATen/Parallel.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <cstdlib>
#include <deque>
#include <fstream>

#include "apps/network_parts.h"
#include "core/seed.h"
#include "core/store.h"
#include "core/task_page.h"
#include "core/tensor_file.h"
#include "policies/learned_input.h"
#include "policies/learned_net.h"
#include "tests/support/command.h"
#include "tests/support/temp_folder.h"
#include "tests/system/run_support.h"

namespace evac {
namespace {

namespace fs = std::filesystem;
using testing::HasSubstr;

const fs::path kSim = fs::path(EVAC_SOURCE_DIR) / "worldmodel" / "sim";

/// Weights that no training made, for one of the desk's tasks: it moves, if to no end.
void WriteWeights(const fs::path& path, const std::string& period_s = "0.1") {
  const Task task = ReadTaskPage(kSim / "scenes" / "take_toast.yaml");
  std::deque<std::vector<float>> numbers;
  std::vector<TensorView> views;
  SplitMix64 random(3);
  const TakeParameter take = [&](const std::string& key, const std::vector<std::int64_t>& shape) {
    TensorView view{{key, TensorType::kF32, shape}, {}};
    std::vector<float>& values = numbers.emplace_back(view.ByteCount() / sizeof(float));
    for (float& value : values) value = static_cast<float>(random.Uniform(-0.03, 0.03));
    view.bytes = std::as_bytes(std::span(values));
    views.push_back(view);
    return at::Tensor();
  };
  LearnedNet({{"take_toast"}, {"head", "hand_right"}, {"right"}, 64, 96}, take);
  TensorMetadata card = {{"format", kLearnedFormat}, {"tasks", "take_toast"}, {"cameras", "head,hand_right"},
                         {"arms", "right"},          {"chunk", "16"},         {"period_s", period_s},
                         {"height_px", "64"},        {"width_px", "96"}};
  for (const Camera& camera : task.cameras) card["camera." + camera.name] = CardLine(camera);
  WriteTensorFile(path, views, card);
}

class LearnedPolicyProgram : public testing::Test {
 protected:
  CommandResult Run(const std::string& task) {
    std::ofstream(folder_ / "suite.yaml")
        << "suite: learned\n"
           "worlds: [{name: real, type: mujoco, role: real, profile: "
        << (kSim / "profiles" / "real.yaml").string() << "}]\ntasks: [" << (kSim / "scenes" / (task + ".yaml")).string()
        << "]\npolicies: [{name: learned, checkpoint: step, command: [evac-policy, learned, "
           "--checkpoint, step.safetensors]}]\n"
           "initial_states: {seed: 3, count: 1}\njudges: [oracle]\nvideo: {scale: 1}\n";
    return RunCommand(system_test::RunWords((folder_ / "suite.yaml").string(), folder_ / "run"));
  }
  const TempFolder folder_;
};

TEST_F(LearnedPolicyProgram, PlaysAnEpisodeOverLcm) {
  WriteWeights(folder_ / "step.safetensors");
  const CommandResult result = Run("take_toast");
  ASSERT_EQ(result.exit_code, 0) << result.err;
  const std::vector<Episode> episodes = Store::Open(folder_ / "run", Store::Mode::kReadOnly).Episodes();
  ASSERT_EQ(episodes.size(), 1U);
  EXPECT_FALSE(IsFailure(episodes[0].stop)) << episodes[0].stop_reason;
  EXPECT_GT(episodes[0].chunks, 0);
}

TEST_F(LearnedPolicyProgram, ATaskItDidNotLearnIsAPolicyErrorWithTheReason) {
  WriteWeights(folder_ / "step.safetensors");
  Run("take_ham");
  const std::vector<Episode> episodes = Store::Open(folder_ / "run", Store::Mode::kReadOnly).Episodes();
  ASSERT_EQ(episodes.size(), 1U);
  EXPECT_EQ(episodes[0].stop, StopReason::kPolicyError);
  EXPECT_THAT(episodes[0].failure, HasSubstr("task take_ham is none it learned, wanted one of take_toast"));
}

TEST_F(LearnedPolicyProgram, AnotherPeriodEndsTheRunBeforeItsFirstEpisode) {
  WriteWeights(folder_ / "step.safetensors", "0.05");
  const CommandResult result = Run("take_toast");
  EXPECT_EQ(result.exit_code, 2);
  EXPECT_THAT(result.err, HasSubstr("* period"));
}

TEST_F(LearnedPolicyProgram, WeightsThatAreNotThereEndTheRunWithTheirName) {
  const CommandResult result = Run("take_toast");
  EXPECT_EQ(result.exit_code, 2);
  EXPECT_THAT(result.err, HasSubstr("step.safetensors"));
}

/// The number of threads was put back as the last thing of all: libtorch then cleared a cache that was freed already, and
/// a process that had imagined, too, was aborted now and then ("corrupted size vs. prev_size").
TEST(LearnedPolicyInThisProcess, PutsNoNumberOfThreadsBackWhenTheProcessEnds) {
  testing::FLAGS_gtest_death_test_style = "threadsafe";
  const TempFolder folder;
  WriteWeights(folder / "step.safetensors");
  const auto record_and_end = [&] {
    at::set_num_threads(2);
    std::atexit([] { ::_exit(at::get_num_threads() == 1 ? 0 : 3); });  // behind whatever is static and made below
    MakeLearnedPolicy(folder / "step.safetensors", 16);
    std::exit(0);
  };
  EXPECT_EXIT(record_and_end(), testing::ExitedWithCode(0), "");
}

}  // namespace
}  // namespace evac
