#include "worldmodel/evac_world.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/wait.h>
#include <unistd.h>

#include <fstream>
#include <limits>

#include "core/check.h"
#include "core/error.h"
#include "tests/support/temp_folder.h"
#include "tests/worldmodel/imagined_support.h"

namespace evac {
namespace {

namespace fs = std::filesystem;
using testing::HasSubstr;
using testing::SizeIs;

Task SomeTask(std::size_t views = 2) {
  Task task;
  task.id = "push";
  task.cameras = SomeCameras(views);
  return task;
}

/// Each initial state begins with another picture.
InitialScene FirstOf(const Task& task, const InitialState& initial) {
  return SomeScene(initial.seed, task.cameras.size());
}

EvacWorld SmallWorld(int threads, const ImaginerOptions& options = FewSteps()) {
  return EvacWorld(SmallImaginer(2, options), FirstOf, {.name = "evac", .threads = threads});
}

ActionChunk ChunkOf(std::size_t count, double from_m) {
  ActionChunk chunk;
  chunk.targets = Targets(count, from_m);
  return chunk;
}

/// What the scenes of one world answered, one text of all pixels per scene.
using Seen = std::map<SceneId, std::string>;

void Add(const Observation& observation, std::string& text) {
  for (const cv::Mat& image : observation.images)
    text.append(reinterpret_cast<const char*>(image.data), image.total() * image.elemSize());
}

/// Two chunks of each scene: of 3 targets (one piece) and of 5 (one and a padded one). Scene s is always the same
/// episode.
Seen Play(World& world, const std::vector<SceneId>& scenes) {
  Seen seen;
  for (const SceneId scene : scenes)
    Add(world.Reset(scene, SomeTask(), {"state", static_cast<std::uint64_t>(scene)}, 10 + scene).observation,
        seen[scene]);
  for (const std::size_t count : {3, 5}) {
    std::vector<ActionChunk> chunks;
    for (const SceneId scene : scenes) chunks.push_back(ChunkOf(count, 0.3 + 0.02 * scene));
    std::vector<SceneChunk> batch;
    for (std::size_t i = 0; i < scenes.size(); ++i) batch.push_back({scenes[i], &chunks[i]});
    const std::vector<Advanced> answers = world.Advance(batch);
    for (std::size_t i = 0; i < scenes.size(); ++i) {
      EXPECT_TRUE(std::holds_alternative<std::vector<WorldStep>>(answers[i]));
      const auto& steps = std::get<std::vector<WorldStep>>(answers[i]);
      EXPECT_THAT(steps, SizeIs(count));
      for (const WorldStep& step : steps) {
        EXPECT_EQ(WhatIsWrong(step.observation, SomeTask()), std::nullopt);
        EXPECT_TRUE(step.observation.arms_are_commanded);
        Add(step.observation, seen[scenes[i]]);
      }
    }
  }
  return seen;
}

TEST(EvacWorld, AnEpisodeDoesNotDependOnWhichOthersShareItsBatch) {
  EvacWorld together = SmallWorld(3);
  const Seen all = Play(together, {0, 1, 2});
  for (const SceneId scene : {0, 1, 2}) {
    EvacWorld world = SmallWorld(1);
    EXPECT_EQ(Play(world, {scene}).at(scene), all.at(scene)) << scene;
  }
  EvacWorld reversed = SmallWorld(2);
  EXPECT_EQ(Play(reversed, {2, 0, 1}), all) << "nor on their order";
  EXPECT_NE(all.at(0), all.at(1));
}

/// One chunk of one scene.
std::string PlayShortly(int threads) {
  EvacWorld world(SmallImaginer(), FirstOf, {.name = "evac", .threads = threads, .all_threads_per_scene = true});
  world.Reset(0, SomeTask(), {"state", 1}, 1);
  const ActionChunk chunk = ChunkOf(3, 0.3);
  const SceneChunk batch[] = {{0, &chunk}};
  const std::vector<Advanced> answers = world.Advance(batch);
  std::string seen;
  for (const WorldStep& step : std::get<std::vector<WorldStep>>(answers.front())) Add(step.observation, seen);
  return seen;
}

TEST(EvacWorld, OneThreadCountTwiceGivesTheSameBitsAndAnotherAGreyLevelAtMost) {
  const std::string two = PlayShortly(2), one = PlayShortly(1);
  EXPECT_EQ(PlayShortly(2), two);
  ASSERT_EQ(one.size(), two.size());
  int most = 0;
  for (std::size_t i = 0; i < one.size(); ++i)
    most = std::max(most, std::abs(static_cast<unsigned char>(one[i]) - static_cast<unsigned char>(two[i])));
  EXPECT_LE(most, 1);
}

TEST(EvacWorld, AResetSceneForgetsWhatItImagined) {
  EvacWorld world = SmallWorld(2);
  const Seen first = Play(world, {0});
  EXPECT_EQ(Play(world, {0}), first);
}

TEST(EvacWorld, StartsFromTheRealRunsFirstFrame) {
  EvacWorld world = SmallWorld(1);
  const WorldStep step = world.Reset(0, SomeTask(), {"state", 4}, 1);
  const InitialScene scene = SomeScene(4);
  ASSERT_THAT(step.observation.images, SizeIs(2));
  for (std::size_t v = 0; v < 2; ++v) EXPECT_EQ(cv::norm(step.observation.images[v], scene.images[v], cv::NORM_INF), 0);
  EXPECT_TRUE(step.observation.arms_are_commanded);
}

std::string RefusalOf(World& world, const Task& task) {
  try {
    world.Reset(0, task, {"41-0007", 1}, 1);
  } catch (const Error& error) {
    return error.what();
  }
  return "";
}

TEST(EvacWorld, WhatItCannotStartFromIsRefused) {
  EvacWorld world = SmallWorld(1);
  EXPECT_EQ(RefusalOf(world, SomeTask()), "");
  Task slow = SomeTask();
  slow.period_s = 0.2;
  EXPECT_THAT(RefusalOf(world, slow), HasSubstr("frames are 0.1 s apart, those of task push 0.2 s"));
  Task two_arms = SomeTask();
  two_arms.arms = {"left", "right"};
  EXPECT_THAT(RefusalOf(world, two_arms), HasSubstr("shows 1 arms, wanted 2"));
  EXPECT_THAT(RefusalOf(world, SomeTask(1)),
              HasSubstr("world evac: task push has 1 cameras, the network imagines 2 views"));
  Task renamed = SomeTask();
  renamed.cameras[0].name = "hand_left";
  EXPECT_THAT(RefusalOf(world, renamed), HasSubstr("not taken by the task's cameras"));
  EvacWorld unseen(SmallImaginer(),
                   [](const Task&, const InitialState& initial) -> InitialScene {
                     throw InvalidInput("nobody has seen {}", initial.id);
                   },
                   {});
  EXPECT_EQ(RefusalOf(unseen, SomeTask()), "nobody has seen 41-0007");
}

/// Hashed weights but for one, which is no number.
class BrokenWeights final : public nn::ParameterSource {
 public:
  explicit BrokenWeights(std::string broken) : broken_(std::move(broken)) {}
  nn::Tensor Take(const std::string& key, at::IntArrayRef shape) override {
    const nn::Tensor tensor = hashed_.Take(key, shape);
    return key == broken_ ? tensor * std::numeric_limits<float>::quiet_NaN() : tensor;
  }

 private:
  nn::HashWeights hashed_;
  std::string broken_;
};

Failure FailureWith(const std::string& key) {
  BrokenWeights weights(key);
  Imaginer imaginer(std::make_unique<const nn::EvacModel>(weights, SmallConfig()), FewSteps());
  EvacWorld world(std::move(imaginer), FirstOf, {.name = "evac", .threads = 2});
  world.Reset(0, SomeTask(), {"state", 1}, 1);
  const ActionChunk chunk = ChunkOf(3, 0.3);
  const SceneChunk batch[] = {{0, &chunk}};
  const std::vector<Advanced> answers = world.Advance(batch);
  EXPECT_TRUE(std::holds_alternative<Failure>(answers.front())) << key;
  return std::get<Failure>(answers.front());
}

TEST(EvacWorld, WeightsThatAreNoNumbersFailTheEpisodeAndNothingElse) {
  const Failure denoiser = FailureWith("model.diffusion_model.out.2.bias");
  EXPECT_EQ(denoiser.stop, StopReason::kDiverged);
  EXPECT_THAT(denoiser.message, HasSubstr("not finite"));
  const Failure codec = FailureWith("first_stage_model.decoder.conv_out.bias");
  EXPECT_EQ(codec.stop, StopReason::kWorldError);
  EXPECT_THAT(codec.message, HasSubstr("codec"));
}

TEST(EvacWorld, OneSceneThatFailsDoesNotStopTheOthers) {
  EvacWorld world = SmallWorld(2);
  const std::string alone = Play(world, {1}).at(1);
  std::string together;
  for (const SceneId scene : {0, 1}) {
    together.clear();  // scene 1's is kept
    Add(world.Reset(scene, SomeTask(), {"state", static_cast<std::uint64_t>(scene)}, 10 + scene).observation, together);
  }
  const ActionChunk three_arms{.targets = {ArmsAt(0.3, 3)}}, good = ChunkOf(3, 0.32);
  const SceneChunk batch[] = {{0, &three_arms}, {1, &good}};
  const std::vector<Advanced> answers = world.Advance(batch);
  ASSERT_TRUE(std::holds_alternative<Failure>(answers[0]));
  EXPECT_EQ(std::get<Failure>(answers[0]).stop, StopReason::kWorldError);
  ASSERT_TRUE(std::holds_alternative<std::vector<WorldStep>>(answers[1]));
  const auto& steps = std::get<std::vector<WorldStep>>(answers[1]);
  ASSERT_THAT(steps, SizeIs(3));
  for (const WorldStep& step : steps) Add(step.observation, together);
  ASSERT_LT(together.size(), alone.size());
  EXPECT_TRUE(alone.starts_with(together)) << "the frames that it has alone";
}

ImaginerOptions Cached(const fs::path& folder, int& steps) {
  ImaginerOptions options = FewSteps();
  options.identity = "hashed weights";
  options.cache = ChunkCacheOptions{.folder = folder};
  options.sampler.on_step = [&steps] { ++steps; };
  return options;
}

TEST(ChunkCache, WhatItKnowsIsNotImaginedAgainAndIsTheSame) {
  const TempFolder folder;
  int steps = 0;
  EvacWorld plain = SmallWorld(1), first = SmallWorld(1, Cached(folder.path(), steps));
  const Seen wanted = Play(plain, {0});
  EXPECT_EQ(Play(first, {0}), wanted);
  const int asked = std::exchange(steps, 0);
  EXPECT_GT(asked, 0);
  EvacWorld second = SmallWorld(1, Cached(folder.path(), steps));
  EXPECT_EQ(Play(second, {0}), wanted);
  EXPECT_EQ(steps, 0);
  EvacWorld others = SmallWorld(1, Cached(folder.path(), steps));
  Play(others, {1});
  EXPECT_EQ(steps, asked) << "another episode is another";
}

std::vector<fs::path> FilesBelow(const fs::path& folder) {
  std::vector<fs::path> files;
  for (const auto& entry : fs::recursive_directory_iterator(folder))
    if (entry.is_regular_file()) files.push_back(entry.path());
  std::sort(files.begin(), files.end());
  return files;
}

TEST(ChunkCache, ABrokenEntryIsImaginedAgain) {
  const TempFolder folder;
  int steps = 0;
  EvacWorld world = SmallWorld(1, Cached(folder.path(), steps));
  const Seen wanted = Play(world, {0});
  const std::vector<fs::path> files = FilesBelow(folder.path());
  ASSERT_THAT(files, SizeIs(3)) << "one piece, then two";
  fs::resize_file(files[0], fs::file_size(files[0]) / 2);
  std::fstream(files[1], std::ios::in | std::ios::out | std::ios::binary).seekp(-1, std::ios::end).put('\x55');
  std::ofstream(files[2], std::ios::trunc) << "nothing";
  steps = 0;
  testing::internal::CaptureStderr();
  EXPECT_EQ(Play(world, {0}), wanted);
  EXPECT_THAT(testing::internal::GetCapturedStderr(), HasSubstr("warning: chunk cache"));
  EXPECT_GT(steps, 0);
  steps = 0;
  EXPECT_EQ(Play(world, {0}), wanted);
  EXPECT_EQ(steps, 0) << "and mended";
}

TEST(ChunkCache, StaysBelowItsLimitAndForgetsTheOldestFirst) {
  const TempFolder folder;
  CachedChunk chunk{{std::vector<float>(1000, 1.0F)}, {{cv::Mat(10, 10, CV_8UC3, cv::Scalar(1, 2, 3))}}};
  ChunkCache cache({.folder = folder.path(), .limit_gb = 50e-6});
  const auto key = [](int i) { return std::string(62, 'a') + std::to_string(10 + i); };
  for (int i = 0; i < 30; ++i) {
    cache.Keep(key(i), chunk);
    fs::last_write_time(FilesBelow(folder.path()).back(),
                        fs::file_time_type::clock::now() - std::chrono::hours(30 - i));
  }
  std::uintmax_t total = 0;
  for (const fs::path& file : FilesBelow(folder.path())) total += fs::file_size(file);
  EXPECT_LE(total, 50000u);
  EXPECT_GT(total, 30000u);
  EXPECT_FALSE(cache.Find(key(0)));
  const std::optional<CachedChunk> newest = cache.Find(key(29));
  ASSERT_TRUE(newest);
  EXPECT_EQ(newest->latents, chunk.latents);
  EXPECT_EQ(cv::norm(newest->pictures[0][0], chunk.pictures[0][0], cv::NORM_INF), 0);
}

CachedChunk ChunkNumber(int i) {
  return {{std::vector<float>(1000, static_cast<float>(i))}, {{cv::Mat(10, 10, CV_8UC3, cv::Scalar::all(i))}}};
}

/// Looks for chunks, keeps those that are not there, in a folder that holds a few. @returns how many were not what was
/// kept
int UseCache(const fs::path& folder, std::uint64_t seed) {
  ChunkCache cache({.folder = folder, .limit_gb = 40e-6});
  SplitMix64 random(seed);
  int wrong = 0;
  for (int round = 0; round < 100; ++round) {
    const int i = static_cast<int>(random.Below(16));
    const std::string key = std::string(62, 'a') + std::to_string(10 + i);
    const std::optional<CachedChunk> found = cache.Find(key);
    if (found) wrong += found->latents != ChunkNumber(i).latents;
    if (!found) cache.Keep(key, ChunkNumber(i));
  }
  return wrong;
}

TEST(ChunkCache, SeveralProcessesMayShareAFolder) {
  const TempFolder folder;
  std::vector<pid_t> children;
  for (std::uint64_t child = 0; child < 3; ++child) {
    const pid_t pid = ::fork();
    if (pid == 0) ::_exit(UseCache(folder.path(), child));
    children.push_back(pid);
  }
  for (const pid_t child : children) {
    int status = 0;
    ::waitpid(child, &status, 0);
    EXPECT_TRUE(WIFEXITED(status) && WEXITSTATUS(status) == 0);
  }
  const auto files = FilesBelow(folder.path());
  EXPECT_FALSE(files.empty());
  for (const fs::path& file : files) EXPECT_EQ(file.extension(), ".safetensors") << "nothing half done";
}

TEST(ChunkCache, WantsToKnowWhichNetworkItIsFor) {
  const TempFolder folder;
  ImaginerOptions options = FewSteps();
  options.cache = ChunkCacheOptions{.folder = folder.path()};
  EXPECT_THROW(SmallImaginer(2, options), Error);
}

}  // namespace
}  // namespace evac
