#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "apps/networks/fidelity.h"
#include "apps/networks/fidelity_plans.h"
#include "tests/support/temp_folder.h"

/// Actions replayed in worlds that are made up here.
namespace evac {
namespace {

using testing::AllOf;
using testing::Each;
using testing::HasSubstr;
using testing::ThrowsMessage;

constexpr int kChunk = 4;

/// The arms go where they are told to; where they are only commanded, nobody measures that they did.
class ObedientWorld : public World {
 public:
  ObedientWorld(std::string name, bool commanded_only) : name_(std::move(name)), commanded_only_(commanded_only) {}

  std::string Name() const override { return name_; }

  WorldStep Reset(SceneId, const Task&, const InitialState&, std::uint64_t) override { return Step(Arms(1), true); }

  std::vector<Advanced> Advance(std::span<const SceneChunk> batch) override {
    std::vector<Advanced> answers;
    for (const SceneChunk& asked : batch) {
      std::vector<WorldStep> steps;
      for (const Arms& target : asked.chunk->targets) steps.push_back(Step(target, &target == &asked.chunk->targets.back()));
      answers.push_back(std::move(steps));
    }
    return answers;
  }

 private:
  WorldStep Step(const Arms& arms, bool is_seen) const {
    WorldStep step;
    if (is_seen) step.observation.images = {cv::Mat(16, 32, CV_8UC3, cv::Scalar(10, 120, 200))};
    step.observation.arms = arms;
    step.observation.arms_are_commanded = commanded_only_;
    return step;
  }

  std::string name_;
  bool commanded_only_;
};

/// Starts nothing.
class ClosedWorld final : public ObedientWorld {
 public:
  using ObedientWorld::ObedientWorld;
  WorldStep Reset(SceneId, const Task&, const InitialState&, std::uint64_t) override { throw InvalidInput("nobody has seen it"); }
};

SuiteWorld Unfilmed(const std::string& name, bool is_real) {
  SuiteWorld world;
  world.name = name;
  world.type = "mujoco";
  world.is_real = is_real;
  world.film = false;
  return world;
}

/// One episode's actions: they move, and rest at the end.
std::vector<Arms> MovesThenRests(int moving, int resting) {
  std::vector<Arms> actions;
  Arms arms(1);
  for (int k = 0; k < moving + resting; ++k) {
    if (k < moving) arms[0].base_from_gripper.translation().x() += 0.01;
    actions.push_back(arms);
  }
  return actions;
}

class Replays : public testing::Test {
 protected:
  Replays() {
    Task task;
    task.id = "take";
    task.max_chunks = 5;
    task.cameras = {{.name = "head", .width_px = 32, .height_px = 16}};
    suite_.path = "suite.yaml";
    suite_.hash = "5417e";
    suite_.tasks = {task};
    suite_.chunk_size = kChunk;
  }

  ReplayRun Run(const std::string& folder, const std::string& rule) const {
    ReplayRun run{suite_, folder_ / folder, "horizon", ToTheLastAction(suite_.tasks, suite_),
                  {Unfilmed("real", true), Unfilmed("model", false)}, rule};
    run.make = [](const SuiteWorld& world) { return std::make_unique<ObedientWorld>(world.name, !world.is_real); };
    return run;
  }

  std::vector<Replay> Of(const std::vector<Arms>& actions) const {
    return {{{"take", "1-0000", "p", "1", 1}, &suite_.tasks[0], {"1-0000", 1}, actions}};
  }

  /// How many actions were executed in each world, and why it ended there.
  static std::vector<std::pair<std::size_t, StopReason>> Ends(const Store& store) {
    std::vector<std::pair<std::size_t, StopReason>> ends;
    for (Episode& episode : store.Episodes()) {
      store.LoadSteps(episode);
      ends.emplace_back(episode.commands.size(), episode.stop);
    }
    return ends;
  }

  const TempFolder folder_;
  Suite suite_;
};

/// A rule that measures the arms of one world and not of the other ended them a chunk apart.
TEST_F(Replays, GoToTheLastActionInEveryWorld) {
  const auto ends = Ends(RunReplays(Run("run", kToTheLastAction), Of(MovesThenRests(8, 12))));
  ASSERT_EQ(ends.size(), 2u);
  EXPECT_THAT(ends, Each(std::pair<std::size_t, StopReason>(20, StopReason::kRecordingEnd)));
}

TEST_F(Replays, GoToTheLastActionAlsoWhereALatencyMadeTheEpisodeLonger) {
  suite_.latency = {.kind = PolicyLatency::Kind::kFixed, .fixed_s = 0.3};
  const int longest = suite_.tasks[0].max_chunks * (kChunk + 3);
  const auto ends = Ends(RunReplays(Run("run", kToTheLastAction), Of(MovesThenRests(longest, 0))));
  ASSERT_EQ(ends.size(), 2u);
  EXPECT_THAT(ends, Each(std::pair<std::size_t, StopReason>(longest, StopReason::kRecordingEnd)));
}

TEST_F(Replays, OfAnEarlierRuleAreNotGoneOnWith) {
  RunReplays(Run("run", ""), Of(MovesThenRests(4, 0)));
  EXPECT_NO_THROW(RequireSameReplays(Run("run", "")));
  EXPECT_NO_THROW(RequireSameReplays(Run("another", kToTheLastAction))) << "nothing is there";
  EXPECT_THAT([&] { RequireSameReplays(Run("run", kToTheLastAction)); },
              ThrowsMessage<Error>(AllOf(HasSubstr((folder_ / "run").string()), HasSubstr("by another rule, wanted to the last action"),
                                         HasSubstr("remove that folder"))));
}

TEST_F(Replays, OfAnotherLengthSayHowLongTheyAre) {
  const auto long_rollouts = [&](std::size_t frames) {
    ReplayRun run = Run("run", fmt::format("after {} frames", frames));
    run.frames = frames;
    run.frames_per_chunk = 2;
    return run;
  };
  RunReplays(long_rollouts(8), Of(MovesThenRests(8, 0)));
  EXPECT_NO_THROW(RequireSameReplays(long_rollouts(8)));
  EXPECT_THAT([&] { RequireSameReplays(long_rollouts(20)); },
              ThrowsMessage<Error>(HasSubstr("--horizon-chunks: found 4 (8 frames), wanted 10 (20 frames)")));
}

/// What reality came to when replays ended by another rule is no answer to these.
TEST_F(Replays, OfAnotherRuleAreNotTakenOverFromAnEarlierReality) {
  const auto taken_over = [&](const std::string& out, const std::string& rule) {
    ReplayRun run = Run(out, rule);
    run.reality = folder_ / "earlier/horizon";
    testing::internal::CaptureStderr();
    EXPECT_EQ(RunReplays(run, Of(MovesThenRests(4, 0))).Episodes().size(), 2u);
    return testing::internal::GetCapturedStderr();
  };
  Store::CreateOrContinue(folder_ / "earlier/closed", {.suite_text = "", .suite_hash = suite_.hash, .suite_path = "", .evac_version = ""});
  RunReplays(Run("earlier/horizon", ""), Of(MovesThenRests(4, 0)));
  EXPECT_THAT(taken_over("same", ""), HasSubstr("2 episodes taken over"));
  EXPECT_THAT(taken_over("other", kToTheLastAction),
              AllOf(HasSubstr("earlier/horizon: an earlier evac ended its replays by another rule"), HasSubstr("not taken over"),
                    testing::Not(HasSubstr("episodes taken over"))));
}

/// A policy whose latency is measured acts otherwise in every run.
TEST_F(Replays, OfOtherActionsAreNeitherGoneOnWithNorTakenOver) {
  RunReplays(Run("run", kToTheLastAction), Of(MovesThenRests(4, 0)));
  EXPECT_THAT([&] { RunReplays(Run("run", kToTheLastAction), Of(MovesThenRests(5, 0))); }, testing::Not(testing::Throws<Error>()))
      << "a rule may have ended the first";
  EXPECT_THAT([&] { RunReplays(Run("run", kToTheLastAction), Of(MovesThenRests(3, 1))); },
              ThrowsMessage<Error>(AllOf(HasSubstr("played other actions than its episode has now"), HasSubstr("remove that folder"))));

  Store::CreateOrContinue(folder_ / "earlier/closed", {.suite_text = "", .suite_hash = suite_.hash, .suite_path = "", .evac_version = ""});
  RunReplays(Run("earlier/horizon", kToTheLastAction), Of(MovesThenRests(4, 0)));
  ReplayRun run = Run("other", kToTheLastAction);
  run.reality = folder_ / "earlier/horizon";
  testing::internal::CaptureStderr();
  const auto ends = Ends(RunReplays(run, Of(MovesThenRests(2, 3))));
  EXPECT_THAT(testing::internal::GetCapturedStderr(),
              AllOf(HasSubstr("2 of its episodes played other actions than these: not taken over"), testing::Not(HasSubstr("episodes taken"))));
  ASSERT_EQ(ends.size(), 2u);
  EXPECT_THAT(ends, Each(std::pair<std::size_t, StopReason>(5, StopReason::kRecordingEnd)));
}

TEST_F(Replays, ThatWereBegunAndNeverCameToAnEpisodeAreBegunAnew) {
  RunReplays(Run("run", "after 8 frames"), {});
  EXPECT_NO_THROW(RequireSameReplays(Run("run", kToTheLastAction)));
  EXPECT_EQ(RunReplays(Run("run", kToTheLastAction), Of(MovesThenRests(4, 0))).Episodes().size(), 2u);
}

/// Fails at the chunk that it is told to.
class FailingWorld final : public ObedientWorld {
 public:
  explicit FailingWorld(int fails_at) : ObedientWorld("model", true), fails_at_(fails_at) {}
  std::vector<Advanced> Advance(std::span<const SceneChunk> batch) override {
    std::vector<Advanced> answers = ObedientWorld::Advance(batch);
    if (++calls_ == fails_at_) answers.back() = Failure{StopReason::kDiverged, "a latent is no number"};
    return answers;
  }

 private:
  int fails_at_, calls_ = 0;
};

TEST_F(Replays, OfAWorldModelThatFailsHaveNoSpeed) {
  const std::vector<Replay> replays = Of(MovesThenRests(4, 0));
  for (const int fails_at : {1, 2}) {
    FailingWorld failing(fails_at);
    const Number seconds = SecondsPerChunk(failing, replays, kChunk);
    ASSERT_FALSE(seconds);
    EXPECT_THAT(seconds.reason(), HasSubstr("a latent is no number"));
  }
  ClosedWorld closed("model", true);
  EXPECT_THAT(SecondsPerChunk(closed, replays, kChunk).reason(), HasSubstr("nobody has seen it"));
  ObedientWorld obedient("model", true);
  EXPECT_GE(*SecondsPerChunk(obedient, replays, kChunk), 0);
}

TEST_F(Replays, ThatFailedAreSaidAndCountedAndTriedAgainByTheNextCall) {
  ReplayRun run = Run("run", kToTheLastAction);
  const auto obedient = run.make;
  run.make = [&](const SuiteWorld& world) -> std::unique_ptr<World> {
    return world.is_real ? obedient(world) : std::make_unique<ClosedWorld>(world.name, true);
  };
  testing::internal::CaptureStderr();
  const PartEpisodes failed = EpisodesOf("open", RunReplays(run, Of(MovesThenRests(4, 0))));
  EXPECT_THAT(testing::internal::GetCapturedStderr(), HasSubstr("1 replays failed; the last: model/take/p@1/1-0000-s1: nobody has seen it"));
  EXPECT_EQ(failed.part, "open");
  EXPECT_EQ(failed.episodes, 2);
  EXPECT_EQ(failed.failed, 1);
  EXPECT_THAT(failed.last_failure, HasSubstr("nobody has seen it"));

  run.make = obedient;
  const Store store = RunReplays(run, Of(MovesThenRests(4, 0)));
  EXPECT_EQ(EpisodesOf("open", store).failed, 0);
  const auto ends = Ends(store);
  ASSERT_EQ(ends.size(), 2u);
  EXPECT_THAT(ends, Each(std::pair<std::size_t, StopReason>(4, StopReason::kRecordingEnd)));
}

TEST_F(Replays, OfACallThatAskedForMoreAreNotCountedByTheNext) {
  std::vector<Replay> replays = Of(MovesThenRests(4, 0));
  replays.push_back(replays.front());
  replays.back().pair.checkpoint = "2";
  RunReplays(Run("run", kToTheLastAction), replays);
  replays.pop_back();
  const Store store = RunReplays(Run("run", kToTheLastAction), replays);
  EXPECT_EQ(EpisodesOf("horizon", store).episodes, 4);
  EXPECT_EQ(EpisodesOf("horizon", store, replays).episodes, 2);
}

}  // namespace
}  // namespace evac
