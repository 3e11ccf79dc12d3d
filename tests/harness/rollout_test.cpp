#include "harness/rollout.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <fstream>
#include <map>

#include "core/error.h"
#include "core/hash.h"
#include "core/recording.h"
#include "core/seed.h"
#include "core/store_sqlite.h"
#include "tests/support/temp_folder.h"
#include "worldmodel/echo_world.h"

namespace evac {
namespace {

using ::testing::HasSubstr;

constexpr int kChunk = 4;

Recording StillLife() {
  Recording recording;
  recording.id = "still_life";
  recording.period_s = .1;
  recording.arm_names = {"right"};
  recording.arms = {Arms(1)};
  recording.cameras = {Camera{.name = "head", .width_px = 32, .height_px = 16, .fx_px = 30, .fy_px = 30, .cx_px = 16, .cy_px = 8}};
  recording.first_images = {cv::Mat(16, 32, CV_8UC3, cv::Scalar(10, 120, 200))};
  return recording;
}

/// Walks at random: its noise is a function of the episode's seed and the request, as a policy's must be.
class WalkingPolicy : public Policy {
 public:
  std::string Name() const override { return "walk"; }
  void Reset(SceneId scene, const Task&, std::uint64_t seed) override { walks_[scene] = {seed, 0}; }
  std::vector<Acted> Act(std::span<const SceneObservation> batch) override {
    std::vector<Acted> answers;
    for (const SceneObservation& asked : batch) answers.push_back(Answer(asked));
    return answers;
  }

 protected:
  struct Walk {
    std::uint64_t seed = 0;
    std::uint64_t request = 0;
  };
  virtual Acted Answer(const SceneObservation& asked) {
    Walk& walk = walks_.at(asked.scene);
    SplitMix64 random(SeedFor(walk.seed, walk.request++));
    ActionChunk chunk;
    Arms arms = asked.observation->arms;
    for (int k = 0; k < kChunk; ++k) {
      arms[0].base_from_gripper.translation() += .02 * Eigen::Vector3d(random.Normal(), random.Normal(), random.Normal());
      chunk.targets.push_back(arms);
    }
    return chunk;
  }
  std::map<SceneId, Walk> walks_;
};

/// Does as told with the plain answer.
class FaultyPolicy : public WalkingPolicy {
 public:
  using Fault = std::function<Acted(Acted plain, std::uint64_t request)>;
  explicit FaultyPolicy(Fault fault) : fault_(std::move(fault)) {}

 private:
  Acted Answer(const SceneObservation& asked) override {
    const std::uint64_t request = walks_.at(asked.scene).request;
    return fault_(WalkingPolicy::Answer(asked), request);
  }
  Fault fault_;
};

/// A world that remembers how often it was asked.
class CountedWorld : public World {
 public:
  explicit CountedWorld(World& world) : world_(world) {}
  std::string Name() const override { return world_.Name(); }
  WorldStep Reset(SceneId scene, const Task& task, const InitialState& initial, std::uint64_t seed) override {
    ++resets;
    return world_.Reset(scene, task, initial, seed);
  }
  std::vector<Advanced> Advance(std::span<const SceneChunk> batch) override {
    ++advances;
    return world_.Advance(batch);
  }
  int resets = 0, advances = 0;

 private:
  World& world_;
};

/// One that asks the store where its episodes begin, as an imagining world does.
class SeeingWorld : public CountedWorld {
 public:
  SeeingWorld(World& world, const Store& store) : CountedWorld(world), store_(store) {}
  WorldStep Reset(SceneId scene, const Task& task, const InitialState& initial, std::uint64_t seed) override {
    store_.LoadInitialScene(task.id, initial.id);
    return CountedWorld::Reset(scene, task, initial, seed);
  }

 private:
  const Store& store_;
};

class Rollout : public ::testing::Test {
 protected:
  Rollout() : world_(StillLife()), task_(TaskFromRecording(StillLife())) {
    task_.max_chunks = 5;
    task_.workspace_m = Eigen::AlignedBox3d(Eigen::Vector3d::Constant(-9), Eigen::Vector3d::Constant(9));
    options_.lane.chunk_size = options_.lane.policy_chunk_size = kChunk;
    options_.failures_left = 100;
  }

  std::vector<Job> Jobs(int count) {
    std::vector<Job> jobs;
    for (int i = 0; i < count; ++i) {
      const std::string id = fmt::format("1-{:04d}", i);
      jobs.push_back({&task_, {id, static_cast<std::uint64_t>(i)}, {{task_.id, id, "walk", "a", 1}, "echo"}});
    }
    return jobs;
  }
  Store NewStore(const std::string& name) {
    return Store::CreateOrContinue(folder_ / name, {.suite_text = "suite: t", .suite_hash = "h", .suite_path = "", .evac_version = "0"});
  }
  Store NewDeclaredStore(const std::string& name) {
    Store store = NewStore(name);
    store.AddTask(task_);
    store.AddWorld({.name = "echo", .type = "echo", .is_real = false, .profile_hash = ""});
    store.AddPolicy({"walk", "a", "{}"});
    return store;
  }
  Summary Run(Policy& policy, std::vector<Job> jobs, Store& store) {
    JobQueue queue(std::move(jobs));
    return RunEpisodes(policy, world_, queue, store, options_);
  }
  Episode OnlyEpisode(FaultyPolicy::Fault fault) {
    FaultyPolicy policy(std::move(fault));
    Store store = NewDeclaredStore("only");
    Run(policy, Jobs(1), store);
    Episode episode = store.Episodes().at(0);
    store.LoadSteps(episode);
    return episode;
  }

  TempFolder folder_;
  EchoWorld world_;
  Task task_;
  RolloutOptions options_;
};

TEST_F(Rollout, AnEpisodeDoesNotDependOnLanesCompanyOrOrder) {
  WalkingPolicy policy;
  std::map<std::string, std::string> wanted;
  for (const int lanes : {1, 2, 5}) {
    options_.lanes = lanes;
    std::vector<Job> jobs = Jobs(5);
    if (lanes == 2) std::reverse(jobs.begin(), jobs.end());
    Store store = NewDeclaredStore(fmt::format("lanes{}", lanes));
    const Summary summary = Run(policy, jobs, store);
    EXPECT_EQ(summary.done, 5);
    for (Episode& episode : store.Episodes()) {
      store.LoadSteps(episode);
      std::string result = episode.video_sha256 + episode.stop_reason;
      for (const Arms& arms : episode.commands) {
        const auto& m = arms[0].base_from_gripper.matrix();
        result += Sha256Hex({reinterpret_cast<const char*>(m.data()), sizeof(double) * 16});
      }
      const auto [known, fresh] = wanted.emplace(episode.key.Id(), result);
      EXPECT_EQ(known->second, result) << episode.key.Id() << " with " << lanes << " lanes";
    }
  }
}

TEST_F(Rollout, AWorldThatShowsWhatNobodyAskedForIsAWorldError) {
  options_.lane.film = false;
  WalkingPolicy policy;
  Store store = NewDeclaredStore("unfilmed");
  Run(policy, Jobs(1), store);
  const Episode episode = store.Episodes().at(0);
  EXPECT_EQ(episode.stop, StopReason::kWorldError);
  EXPECT_THAT(episode.failure, HasSubstr("chunk 1, step 1: the observation has 1 images, wanted none"));
  EXPECT_EQ(episode.video, "");
}

TEST_F(Rollout, ObservationsAreCommandsPlusOneAndTheLimitIsAStopReason) {
  task_.still.enabled = true;
  const Episode episode = OnlyEpisode([](Acted plain, std::uint64_t) { return plain; });
  EXPECT_EQ(episode.stop, StopReason::kMaxChunks);
  EXPECT_EQ(episode.stop_reason, "still moving after 5 chunks, the task's limit");
  EXPECT_EQ(episode.chunks, 5);
  EXPECT_EQ(episode.commands.size(), 5u * kChunk);
  EXPECT_EQ(episode.observations.size(), episode.commands.size() + 1);
  EXPECT_TRUE(episode.failure.empty());
}

TEST_F(Rollout, APolicyThatGoesSilentFailsItsOwnEpisodeAlone) {
  FaultyPolicy policy([n = 0](Acted plain, std::uint64_t request) mutable -> Acted {
    if (request == 2 && n++ == 1) return Failure{StopReason::kPolicyTimeout, "no answer within 1 s"};
    return plain;
  });
  Store store = NewDeclaredStore("silent");
  options_.lanes = 3;
  const Summary summary = Run(policy, Jobs(6), store);
  EXPECT_EQ(summary.done, 6);
  EXPECT_EQ(summary.failed, 1);
  int failed = 0;
  for (const Episode& episode : store.Episodes()) {
    if (!IsFailure(episode.stop)) continue;
    ++failed;
    EXPECT_EQ(episode.stop, StopReason::kPolicyTimeout);
    EXPECT_EQ(episode.failure, "no answer within 1 s");
    EXPECT_EQ(episode.stop_reason, "after 2 chunks: no answer within 1 s");
    EXPECT_EQ(episode.chunks, 2);
  }
  EXPECT_EQ(failed, 1);
}

TEST_F(Rollout, ATargetThatIsNotFiniteIsAPolicyErrorThatSaysWhich) {
  const Episode episode = OnlyEpisode([](Acted plain, std::uint64_t request) {
    if (request == 1) std::get<ActionChunk>(plain).targets[2][0].base_from_gripper.translation().y() = std::nan("");
    return plain;
  });
  EXPECT_EQ(episode.stop, StopReason::kPolicyError);
  EXPECT_THAT(episode.failure, AllOf(HasSubstr("chunk 2"), HasSubstr("target 2 of 4"), HasSubstr("not finite")));
  EXPECT_EQ(episode.chunks, 1);
}

TEST_F(Rollout, ATargetOutsideTheWorkspaceIsAPolicyErrorWithTheNumbers) {
  const Episode episode = OnlyEpisode([](Acted plain, std::uint64_t) {
    std::get<ActionChunk>(plain).targets[0][0].base_from_gripper.translation().x() = 12.5;
    return plain;
  });
  EXPECT_THAT(episode.failure, AllOf(HasSubstr("outside the workspace"), HasSubstr("12.5")));
}

TEST_F(Rollout, AnAnswerWithTheWrongNumberOfTargetsOrArmsIsAPolicyError) {
  EXPECT_THAT(OnlyEpisode([](Acted, std::uint64_t) { return ActionChunk{}; }).failure, HasSubstr("has 0 targets"));
  const Episode two_arms = [&] {
    FaultyPolicy policy([](Acted plain, std::uint64_t) {
      std::get<ActionChunk>(plain).targets[1].resize(2);
      return plain;
    });
    Store store = NewDeclaredStore("two_arms");
    Run(policy, Jobs(1), store);
    return store.Episodes().at(0);
  }();
  EXPECT_THAT(two_arms.failure, HasSubstr("has 2 arms, the task 1"));
}

TEST_F(Rollout, AStillPolicyEndsItsEpisodeWithTheNumbers) {
  task_.still = {.enabled = true, .dwell_chunks = 2, .min_chunks = 1};
  const Episode episode = OnlyEpisode([](Acted plain, std::uint64_t) {
    for (Arms& arms : std::get<ActionChunk>(plain).targets) arms = Arms(1);
    return plain;
  });
  EXPECT_EQ(episode.stop, StopReason::kStill);
  EXPECT_EQ(episode.chunks, 1);
  EXPECT_EQ(episode.stop_reason,
            "still for 2 chunks: the commanded gripper moves at most 0.0 mm, 0.000 rad, closure 0.000, the observed "
            "one is not measured (limits 5.0 mm, 0.050 rad, closure 0.050), after 1 chunks");
}

TEST_F(Rollout, ALongerChunkIsCutToWhatTheWorldExecutes) {
  options_.lane.policy_chunk_size = 8;
  const Episode episode = OnlyEpisode([](Acted plain, std::uint64_t) {
    auto& targets = std::get<ActionChunk>(plain).targets;
    targets.insert(targets.end(), 4, targets.back());
    return plain;
  });
  EXPECT_EQ(episode.commands.size(), 5u * kChunk);
}

TEST_F(Rollout, ARecordingEndsTheEpisodeWithAllItsSteps) {
  const Episode episode = OnlyEpisode([](Acted plain, std::uint64_t request) {
    auto& chunk = std::get<ActionChunk>(plain);
    if (request == 2) chunk.targets.resize(3), chunk.ends_recording = true;
    return plain;
  });
  EXPECT_EQ(episode.stop, StopReason::kRecordingEnd);
  EXPECT_EQ(episode.stop_reason, "the recording ended after 11 steps in 3 chunks");
  EXPECT_EQ(episode.commands.size(), 2u * kChunk + 3);
}

TEST_F(Rollout, WhenNothingWorksTheErrorBudgetEndsTheRun) {
  FaultyPolicy policy([](Acted, std::uint64_t) -> Acted { throw InternalError("the link is gone"); });
  Store store = NewDeclaredStore("budget");
  options_.lanes = 2;
  options_.failures_left = 3;
  const Summary summary = Run(policy, Jobs(50), store);
  EXPECT_TRUE(summary.budget_spent);
  EXPECT_EQ(summary.done, 4);
  EXPECT_THAT(summary.last_failure, HasSubstr("the link is gone"));
}

TEST_F(Rollout, AnInterruptedRunKeepsWhatIsFinishedAndTheRestRunsLater) {
  WalkingPolicy policy;
  Store store = NewDeclaredStore("interrupted");
  options_.lanes = 2;
  options_.interrupted = [chunks = 0]() mutable { return ++chunks > 20; };
  const Summary first = Run(policy, Jobs(5), store);
  EXPECT_TRUE(first.interrupted);
  EXPECT_EQ(first.done, 2);
  EXPECT_EQ(store.Episodes().size(), 2u);

  options_.interrupted = nullptr;
  std::vector<Job> rest = Jobs(5);
  std::erase_if(rest, [&](const Job& job) { return store.Has(job.key); });
  EXPECT_EQ(Run(policy, rest, store).done, 3);
}

/// All that were to run again were removed at once: after an interrupt, also the reasons of those not tried yet.
TEST_F(Rollout, AFailedEpisodeThatRunsAgainKeepsItsRowUntilTheNewTryIsOver) {
  FaultyPolicy sick([](Acted, std::uint64_t) -> Acted { return Failure{StopReason::kPolicyError, "it broke"}; });
  Store store = NewDeclaredStore("again");
  Run(sick, Jobs(5), store);
  const auto reasons = [&] {
    std::vector<std::string> found;
    for (const Episode& episode : store.Episodes()) {
      found.push_back(episode.failure);
      EXPECT_EQ(Sha256HexOfFile(store.folder() / episode.video), episode.video_sha256) << episode.key.Id();
    }
    return found;
  };
  WalkingPolicy policy;
  options_.lanes = 2;
  options_.interrupted = [chunks = 0]() mutable { return ++chunks > 20; };
  EXPECT_EQ(Run(policy, Jobs(5), store).done, 2);
  EXPECT_THAT(reasons(), testing::ElementsAre("", "", "it broke", "it broke", "it broke"));
  options_.interrupted = nullptr;
  std::vector<Job> rest = Jobs(5);
  rest.erase(rest.begin(), rest.begin() + 2);
  EXPECT_EQ(Run(policy, rest, store).done, 3);
  EXPECT_THAT(reasons(), testing::Each(""));
  EXPECT_THROW(Run(policy, Jobs(1), store), Error) << "one that has not failed stays";
}

TEST_F(Rollout, WhatTheDiskRefusesEndsTheRunAndIsNoEpisodesFailure) {
  WalkingPolicy policy;
  Store store = NewDeclaredStore("full");
  Run(policy, Jobs(1), store);
  std::filesystem::remove_all(store.folder() / "videos");
  std::ofstream(store.folder() / "videos") << "no folder any more";
  std::vector<Job> rest = Jobs(3);
  rest.erase(rest.begin());
  EXPECT_THROW(Run(policy, rest, store), Error);
  EXPECT_EQ(store.Episodes().size(), 1u);
}

TEST_F(Rollout, WhatTheStoreRefusesWhereAnEpisodeBeginsIsNoFailureOfItsWorld) {
  WalkingPolicy policy;
  Store store = NewDeclaredStore("unreadable");
  SeeingWorld world(world_, store);
  JobQueue first(Jobs(1)), others(Jobs(3));
  EXPECT_EQ(RunEpisodes(policy, world, first, store, options_).failed, 0);
  others.Next();
  sqlite::Connection::OpenReadWrite(store.folder() / "evac.sqlite").Run("DROP TABLE initial_scenes");
  EXPECT_THAT([&] { RunEpisodes(policy, world, others, store, options_); },
              testing::ThrowsMessage<Error>(HasSubstr("initial_scenes")));
  EXPECT_EQ(store.Episodes().size(), 1u);
}

TEST_F(Rollout, APolicyThatIsAnotherThanWasGreetedEndsTheRunAndNothingOfItIsKept) {
  Store store = NewDeclaredStore("run");
  WalkingPolicy policy;
  int answers = 0;
  options_.check_policy = [&] {
    if (++answers == 2 * task_.max_chunks) throw InvalidInput("weights: it is another file");
  };
  options_.lanes = 1;
  EXPECT_THAT([&] { Run(policy, Jobs(3), store); }, testing::ThrowsMessage<Error>(HasSubstr("another file")));
  EXPECT_EQ(store.Episodes().size(), 1u) << "the first was over, the second's last answer was the wrong one's";
}

TEST_F(Rollout, WhoeverWasSentAwayByAnInterruptIsNotStoredAsFailed) {
  bool wants_an_end = false;
  FaultyPolicy policy([&](Acted plain, std::uint64_t request) -> Acted {
    if (request < 2) return plain;
    wants_an_end = true;
    return Failure{StopReason::kPolicyError, "interrupted"};
  });
  Store store = NewDeclaredStore("sent_away");
  options_.interrupted = [&] { return wants_an_end; };
  CountedWorld world(world_);
  JobQueue queue(Jobs(3));
  const Summary summary = RunEpisodes(policy, world, queue, store, options_);
  EXPECT_TRUE(summary.interrupted);
  EXPECT_EQ(world.advances, 2) << "a chunk of a large world model takes minutes: nobody waits for one more";
  EXPECT_EQ(summary.failed, 0);
  EXPECT_TRUE(store.Episodes().empty());
}

/// All lanes were filled first: of a large world model, minutes.
TEST_F(Rollout, AnInterruptWhileLanesAreFilledBeginsNoFurtherEpisode) {
  WalkingPolicy policy;
  Store store = NewDeclaredStore("filling");
  CountedWorld world(world_);
  options_.lanes = 8;
  options_.interrupted = [&] { return world.resets > 0; };
  JobQueue queue(Jobs(8));
  EXPECT_TRUE(RunEpisodes(policy, world, queue, store, options_).interrupted);
  EXPECT_EQ(world.resets, 1);
  EXPECT_EQ(world.advances, 0);
  EXPECT_TRUE(store.Episodes().empty());
}

TEST_F(Rollout, WhileASlowPolicyThinksTheWorldMovesOn) {
  options_.lane.latency = {.kind = PolicyLatency::Kind::kFixed, .fixed_s = .2};
  const Episode episode = OnlyEpisode([](Acted plain, std::uint64_t) { return plain; });
  EXPECT_EQ(episode.chunks, 5);
  EXPECT_EQ(episode.commands.size(), 5u * (2 + kChunk));
  EXPECT_EQ(episode.observations.size(), episode.commands.size() + 1);
}

/// Its physics blows up as it settles, before there is a frame.
class RestlessWorld : public CountedWorld {
 public:
  using CountedWorld::CountedWorld;
  WorldStep Reset(SceneId, const Task&, const InitialState&, std::uint64_t) override {
    throw InternalError("physics diverged before 0.10 s").Called("diverged");
  }
};

/// It was counted among the worlds' errors.
TEST_F(Rollout, AnEpisodeWhosePhysicsDivergesAsItBeginsHasDiverged) {
  WalkingPolicy policy;
  RestlessWorld world(world_);
  Store store = NewDeclaredStore("restless");
  JobQueue queue(Jobs(1));
  EXPECT_EQ(RunEpisodes(policy, world, queue, store, options_).failed, 1);
  const Episode episode = store.Episodes().at(0);
  EXPECT_EQ(episode.stop, StopReason::kDiverged);
  EXPECT_EQ(episode.failure, "physics diverged before 0.10 s");
}

TEST_F(Rollout, AnEpisodeThatCannotBeginIsARowToo) {
  task_.cameras[0].width_px = 31;  // the world's pictures are 32 wide
  WalkingPolicy policy;
  Store store = NewDeclaredStore("begin");
  Run(policy, Jobs(1), store);
  const Episode episode = store.Episodes().at(0);
  EXPECT_EQ(episode.stop, StopReason::kWorldError);
  EXPECT_FALSE(episode.failure.empty());
  EXPECT_TRUE(episode.video.empty());
}

}  // namespace
}  // namespace evac
