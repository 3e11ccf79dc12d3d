#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <signal.h>
#include <sys/wait.h>

#include <nlohmann/json.hpp>
#include <thread>

#include "apps/factory.h"
#include "core/error.h"
#include "core/file.h"
#include "core/hash.h"
#include "core/seed.h"
#include "tests/support/command.h"
#include "tests/support/temp_folder.h"
#include "tests/system/killed_run.h"
#include "tests/system/run_support.h"
#include "worldmodel/action_statistics.h"
#include "worldmodel/evac_config.h"
#include "worldmodel/motion_statistics.h"
#include "worldmodel/nn/weights.h"

namespace evac {
namespace {

namespace fs = std::filesystem;
using system_test::KillOnce;
using system_test::List;
using system_test::MadeAnew;
using system_test::RunWords;
using system_test::VideoTimes;
using testing::HasSubstr;

const std::string kImagined = EVAC_SOURCE_DIR "/tests/system/imagined.yaml";
const std::string kSmallNetwork = EVAC_SOURCE_DIR "/tests/system/evac_small.yaml";

/// A folder with random weights in it.
class ImaginedRun : public testing::Test {
 protected:
  ImaginedRun() {
    nn::RandomWeights random(5);
    nn::SaveWeights(weights_, random, ReadEvacConfig(kSmallNetwork));
  }

  std::vector<std::string> Settings(const std::vector<std::string>& more = {}) const {
    std::vector<std::string> settings = {"worlds.1.weights=" + weights_.string()};
    settings.insert(settings.end(), more.begin(), more.end());
    return settings;
  }

  const TempFolder folder_;
  const fs::path weights_ = folder_ / "small.safetensors";
};

nlohmann::json Imagined(const std::string& list) {
  nlohmann::json imagined = nlohmann::json::array();
  for (const auto& episode : nlohmann::json::parse(list))
    if (episode["world"] == "evac") imagined.push_back(episode);
  return imagined;
}

TEST_F(ImaginedRun, HasTheSameFramesWithOneLaneAndWithEight) {
  const fs::path one = folder_ / "one", eight = folder_ / "eight";
  const CommandResult alone = RunCommand(RunWords(kImagined, one, Settings({"lanes=1"})));
  ASSERT_EQ(alone.exit_code, 0) << alone.err;
  const CommandResult together = RunCommand(RunWords(kImagined, eight, Settings({"lanes=8", "threads=3"})));
  ASSERT_EQ(together.exit_code, 0) << together.err;
  EXPECT_EQ(List(one), List(eight)) << "video hashes and all";
  const nlohmann::json imagined = Imagined(List(one));
  ASSERT_EQ(imagined.size(), 4u);
  EXPECT_NE(imagined[0]["video_sha256"], imagined[1]["video_sha256"]);
  for (const auto& episode : imagined)
    EXPECT_EQ(Sha256HexOfFile(one / episode["video"].get<std::string>()), episode["video_sha256"]);
}

/// Of those that were imagined: a file of the cache per chunk.
bool IsAnyKept(const fs::path& cache) {
  std::error_code error;
  for (auto file = fs::recursive_directory_iterator(cache, error); !error && file != fs::recursive_directory_iterator();
       file.increment(error)) {
    if (file->path().extension() == ".safetensors") return true;
  }
  return false;
}

TEST_F(ImaginedRun, AfterAnyKillIsThatOfAnUninterruptedRun) {
  const fs::path whole = folder_ / "whole", killed = folder_ / "killed";
  const auto begin = std::chrono::steady_clock::now();
  const CommandResult straight = RunCommand(RunWords(kImagined, whole, Settings()));
  ASSERT_EQ(straight.exit_code, 0) << straight.err;
  const double whole_s = std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
  SplitMix64 random(23);
  const auto words = RunWords(
      kImagined, killed, Settings({"worlds.1.cache={folder: " + (folder_ / "cache").string() + "}", "lanes=1"}));
  // The first one when the first chunk of one episode after the other was imagined, the others wherever they come.
  KillOnce([&] { return IsAnyKept(folder_ / "cache"); }, words, folder_ / "log");
  const auto finished = VideoTimes(killed);
  EXPECT_THAT(finished.size(), testing::AllOf(testing::Ge(4u), testing::Lt(8u))) << "four real ones, not all imagined";
  for (int kill = 1; kill < 3; ++kill) {
    const pid_t pid = StartCommand(words, folder_ / "log");
    std::this_thread::sleep_for(std::chrono::duration<double>(random.Uniform(0.2, 0.9) * whole_s));
    ::kill(pid, SIGKILL);
    ::waitpid(pid, nullptr, 0);
  }
  const CommandResult last = RunCommand(words);
  ASSERT_EQ(last.exit_code, 0) << last.err;
  EXPECT_EQ(List(killed), List(whole)) << "also when chunks come from the cache";
  EXPECT_THAT(MadeAnew(finished, killed), testing::IsEmpty()) << "what was stored is kept";
}

TEST_F(ImaginedRun, NeedsTheRealOneFirst) {
  const Suite suite = ReadSuite(kImagined, Settings());
  const std::unique_ptr<World> world = MakeWorld(suite.worlds[1], suite, nullptr);
  try {
    world->Reset(0, suite.tasks.front(), suite.initial_states.front(), 1);
    ADD_FAILURE() << "it started from nothing";
  } catch (const Error& error) {
    EXPECT_THAT(error.what(),
                HasSubstr("nobody has seen task take_bottle, initial state 3-0000: run the real world first"));
  }
}

/// Their frames were stored, and cached, under the hash of the weights that the suite named.
TEST_F(ImaginedRun, WeightsThatWereWrittenToBeforeTheWorldsTurnAreRefused) {
  const Suite suite = ReadSuite(kImagined, Settings());
  EXPECT_NE(MakeWorld(suite.worlds[1], suite, nullptr), nullptr);
  const std::string before = Sha256HexOfFile(weights_);
  nn::RandomWeights later(6);
  nn::SaveWeights(weights_, later, ReadEvacConfig(kSmallNetwork));
  try {
    MakeWorld(suite.worlds[1], suite, nullptr);
    ADD_FAILURE() << "the run would go on with other weights";
  } catch (const Error& error) {
    EXPECT_EQ(error.exit_code(), ExitCode::kInvalidInput);
    EXPECT_THAT(error.what(), testing::AllOf(HasSubstr(weights_.string()), HasSubstr("wanted " + before),
                                             HasSubstr("found SHA-256 " + Sha256HexOfFile(weights_))));
  }
}

/// The bottle's page with another period, from anywhere.
std::string BottleEvery(double period_s) {
  const std::string scenes = EVAC_SOURCE_DIR "/worldmodel/sim/scenes/";
  std::string page = ReadFile(scenes + "take_bottle.yaml");
  const std::pair<std::string, std::string> changes[] = {{"period_s: 0.1", fmt::format("period_s: {}", period_s)},
                                                         {"scene: ", "scene: " + scenes},
                                                         {"includes: [", "includes: [" + scenes}};
  for (const auto& [was, is] : changes) page.replace(page.find(was), was.size(), is);  // throws where there is none
  return page;
}

/// A tenth of a second is what the published network's motion was divided by, however far apart its frames were; of
/// frames 1/30 s apart it was told motion three times too large, and by `evac imagine` was not.
TEST_F(ImaginedRun, WeightsThatSayNoPeriodAreToldTheSameMotionWhateverThePeriod) {
  const auto pictures = [&](double period_s, const TensorMetadata& says) {
    nn::RandomWeights random(5);
    nn::SaveWeights(weights_, random, ReadEvacConfig(kSmallNetwork), {.metadata = says});
    WriteFileAtomically(folder_ / "page.yaml", BottleEvery(period_s));
    const Suite suite = ReadSuite(kImagined, Settings({fmt::format("worlds.1.period_s={}", period_s),
                                                       "tasks=[" + (folder_ / "page.yaml").string() + "]"}));
    const Task& task = suite.tasks.front();
    InitialScene scene{.images = {}, .arms = Arms(1), .cameras = task.cameras};
    for (const Camera& camera : task.cameras)
      scene.images.emplace_back(camera.height_px, camera.width_px, CV_8UC3, cv::Scalar(90, 120, 60));
    Store store = Store::InMemory(
        folder_ / "memory", {.suite_text = "", .suite_hash = "hash", .suite_path = "", .evac_version = ""});
    store.AddTask(task);
    store.AddInitialScene({task.id, "first", "nobody", "none"}, scene);
    const std::unique_ptr<World> world = MakeWorld(suite.worlds[1], suite, &store);
    world->Reset(0, task, {"first", 1}, 1);
    ActionChunk chunk;
    for (int step = 1; step <= 8; ++step) {
      ArmState arm;
      arm.base_from_gripper.translation().x() = 0.01 * step;
      chunk.targets.push_back({arm});
    }
    const SceneChunk batch[] = {{0, &chunk}};
    const std::vector<Advanced> answers = world->Advance(batch);
    std::string seen;
    for (const WorldStep& step : std::get<std::vector<WorldStep>>(answers.at(0))) {
      for (const cv::Mat& picture : step.observation.images)
        seen.append(reinterpret_cast<const char*>(picture.data), picture.total() * picture.elemSize());
    }
    return seen;
  };
  EXPECT_EQ(pictures(1.0 / 30, {}), pictures(0.1, {}));
  EXPECT_NE(pictures(1.0 / 30, {{"period_s", "0.0333333"}}), pictures(1.0 / 30, {})) << "theirs is of 30 Hz";
  EXPECT_EQ(pictures(0.1, {{"period_s", "0.1"}}), pictures(0.1, {})) << "as the desk's are told";
}

TEST_F(ImaginedRun, WeightsOfAnotherNetworkAreRefusedBeforeTheFirstEpisodeOfAnyWorld) {
  const CommandResult result = RunCommand(RunWords(
      kImagined, folder_ / "run", Settings({"worlds.1.config=" EVAC_SOURCE_DIR "/apps/configs/evac_published.yaml"})));
  EXPECT_EQ(result.exit_code, 2) << result.err;
  EXPECT_THAT(result.err, HasSubstr("small.safetensors"));
  EXPECT_FALSE(fs::exists(folder_ / "run" / "videos"));
}

/// Validated and begun, every episode of it failed.
TEST_F(ImaginedRun, OfMoreStepsThanTheScheduleHasIsRefusedBeforeTheFirstEpisodeOfAnyWorld) {
  WriteFileAtomically(folder_ / "short.yaml", ReadFile(kSmallNetwork) + "\nschedule: {steps: 50}\n");
  nn::RandomWeights random(5);
  nn::SaveWeights(weights_, random, ReadEvacConfig(folder_ / "short.yaml"));
  const auto settings = Settings({"worlds.1.config=" + (folder_ / "short.yaml").string(), "worlds.1.steps=100"});
  const CommandResult result = RunCommand(RunWords(kImagined, folder_ / "run", settings));
  EXPECT_EQ(result.exit_code, 2) << result.err;
  EXPECT_THAT(result.err, HasSubstr("world evac: field steps: found 100, wanted at most 50"));
  EXPECT_FALSE(fs::exists(folder_ / "run" / "videos"));
}

TEST_F(ImaginedRun, WeightsThatWereTrainedForSomethingElseAreRefusedBeforeTheFirstEpisodeOfAnyWorld) {
  ActionStatistics other = AgiBotWorldStatistics();
  other.deviation[7] *= 2;
  const std::string other_page = folder_ / "other.yaml";
  WriteFileAtomically(other_page, StatisticsPage(other));
  const struct {
    TensorMetadata says;
    std::vector<std::string> settings;
    std::string refusal;
  } cases[] = {
      {{{"period_s", "0.2"}}, {}, "field period_s: frames 0.1 s apart are asked for"},
      {{{"cameras", "hand_right,head"}}, {}, "task take_bottle: found cameras head, hand_right, wanted hand_right, head"},
      {{{"arms", "left,right"}}, {}, "task take_bottle: found arms right, wanted left, right"},
      {{{"statistics", StatisticsPage(AgiBotWorldStatistics())}}, {"worlds.1.statistics=" + other_page}, "deviation of right y"},
      {{{"pose_map", "radius_px=50 thickness_px=8"}}, {}, "pose maps would be drawn with radius_px="},
  };
  for (const auto& [says, settings, refusal] : cases) {
    nn::RandomWeights random(5);
    nn::SaveWeights(weights_, random, ReadEvacConfig(kSmallNetwork), {.metadata = says});
    const CommandResult result = RunCommand(RunWords(kImagined, folder_ / "run", Settings(settings)));
    EXPECT_EQ(result.exit_code, 2) << result.err;
    EXPECT_THAT(result.err, HasSubstr(refusal));
    EXPECT_THAT(result.err, HasSubstr("small.safetensors"));
    EXPECT_FALSE(fs::exists(folder_ / "run" / "videos"));
    fs::remove_all(folder_ / "run");
    std::vector<std::string> words = {Binary("evac"), "validate", kImagined};
    for (const std::string& setting : Settings(settings)) words.insert(words.end(), {"--set", setting});
    const CommandResult validated = RunCommand(words);
    EXPECT_EQ(validated.exit_code, 2) << validated.out << "what a run refuses is not valid";
    EXPECT_THAT(validated.err, HasSubstr(refusal));
  }
}

/// Their frames differ by a grey level, and a run went on with another number of threads as if they did not.
TEST_F(ImaginedRun, OfAllThreadsPerSceneGoesOnWithThatNumberAlone) {
  const auto declare = [&](Store& store, const std::string& per_scene, const std::string& threads) {
    const Suite suite =
        ReadSuite(kImagined, Settings({"worlds.1.threads_per_scene=" + per_scene, "threads=" + threads}));
    Declare(suite, store);
    return suite.worlds[1].evac->hash;
  };
  const RunInfo run{.suite_text = "", .suite_hash = "hash", .suite_path = "", .evac_version = ""};
  Store all = Store::InMemory(folder_ / "all", run), one = Store::InMemory(folder_ / "one", run);
  declare(all, "all", "2");
  EXPECT_NO_THROW(declare(all, "all", "2"));
  try {
    declare(all, "all", "3");
    ADD_FAILURE() << "the run would go on with other frames";
  } catch (const Error& error) {
    EXPECT_EQ(error.exit_code(), ExitCode::kInvalidInput);
    EXPECT_THAT(error.what(), testing::AllOf(HasSubstr("evac"), HasSubstr(" threads 2'"), HasSubstr(" threads 3'")));
  }
  const std::string hash = declare(one, "1", "2");
  EXPECT_NO_THROW(declare(one, "1", "3")) << "the same bits for any number of threads";
  const std::vector<WorldInfo> worlds = one.Worlds();
  const auto evac = std::ranges::find(worlds, "evac", &WorldInfo::name);
  ASSERT_NE(evac, worlds.end());
  EXPECT_EQ(evac->profile_hash, hash);
}

TEST_F(ImaginedRun, IsAnotherOneWithOtherWeights) {
  const Suite first = ReadSuite(kImagined, Settings());
  nn::RandomWeights random(6);
  nn::SaveWeights(weights_, random, ReadEvacConfig(kSmallNetwork));
  EXPECT_NE(ReadSuite(kImagined, Settings()).hash, first.hash);
}

}  // namespace
}  // namespace evac
