#include "judges/oracle_judge.h"

#include <gmock/gmock.h>

#include <numbers>

#include "core/error.h"
#include "core/store_sqlite.h"
#include "judges/judge_episodes.h"
#include "judges/rubric.h"
#include "tests/support/temp_folder.h"

namespace evac {
namespace {

using testing::AllOf;
using testing::HasSubstr;

/// A track that a test builds frame by frame: a bottle, a gripper, a table and how hard they touch.
class TrackMaker {
 public:
  TrackMaker& Frame(const Eigen::Vector3d& bottle_m, double grip_n = 0, double tilt_rad = 0) {
    PrivilegedFrame frame;
    Eigen::Isometry3d bottle = Eigen::Translation3d(bottle_m) * Eigen::AngleAxisd(tilt_rad, Eigen::Vector3d::UnitX());
    frame.bodies = {{"bottle", bottle},
                    {"gripper", Eigen::Isometry3d(Eigen::Translation3d(0, 0, 0.1))},
                    {"table", Eigen::Isometry3d::Identity()}};
    if (grip_n > 0) frame.contacts = {{"bottle", "gripper", grip_n}};
    track_.push_back(frame);
    return *this;
  }
  TrackMaker& Repeat(int times) {
    for (int i = 0; i < times; ++i) track_.push_back(PrivilegedFrame(track_.back()));
    return *this;
  }
  const PrivilegedTrack& track() const { return track_; }

 private:
  PrivilegedTrack track_;
};

Condition Make(const std::string& kind, std::optional<double> above, std::optional<double> below,
               const std::string& b = "") {
  return {kind, "bottle", b, above, below};
}

Stage MakeStage(const std::string& name, std::vector<Condition> all_of, double hold_s = 0, bool at_end = false) {
  return {name, "", std::move(all_of), hold_s, at_end};
}

Task LiftTask() {
  Task task;
  task.id = "lift";
  task.period_s = 0.1;
  task.max_chunks = 4;
  task.rubric.version = "7";
  task.rubric.stages = {MakeStage("grasp", {Make("contact", 0.5, std::nullopt, "gripper")}, 0.2),
                        MakeStage("lift", {Make("height_gain", 0.05, std::nullopt)}),
                        MakeStage("release", {Make("contact", std::nullopt, 0.05, "gripper")}, 0, true)};
  return task;
}

/// A store with one task, and episodes whose tracks the test chooses.
class OracleJudgeTest : public testing::Test {
 protected:
  OracleJudgeTest()
      : store_(Store::InMemory(folder_.path(),
                               {.suite_text = "", .suite_hash = "h", .suite_path = "", .evac_version = ""})) {
    store_.AddWorld({.name = "real", .type = "mujoco", .is_real = true, .profile_hash = ""});
    store_.AddPolicy({"hold", "a", ""});
  }

  /// @returns the episode's id.
  std::string Add(const Task& task, const PrivilegedTrack& track, StopReason stop = StopReason::kStill) {
    store_.AddTask(task);
    EpisodeRecord record;
    PairKey& pair = record.episode.key.pair;
    pair.task = task.id;
    pair.initial_state = fmt::format("1-{:04}", ++count_);
    pair.policy = "hold";
    pair.checkpoint = "a";
    record.episode.key.world = "real";
    record.episode.stop = stop;
    const std::size_t steps = std::max<std::size_t>(1, track.size());
    for (std::size_t k = 0; k < steps; ++k) record.episode.observations.push_back({{}, {ArmState{}}, false});
    for (std::size_t k = 1; k < steps; ++k) record.episode.commands.push_back({ArmState{}});
    if (IsFailure(stop)) record.episode.failure = "it hung";
    record.privileged = track;
    store_.Add(record);
    return record.episode.key.Id();
  }

  Verdict Rate(const Task& task, const PrivilegedTrack& track) {
    const std::string id = Add(task, track);
    for (Episode& episode : store_.Episodes()) {
      if (episode.key.Id() == id) return OracleJudge(store_).Rate(task, episode);
    }
    throw std::logic_error("the episode was not stored");
  }

  TempFolder folder_;
  Store store_;
  int count_ = 0;
};

TEST_F(OracleJudgeTest, AnEpisodeThatReachesEveryStageInOrderSucceeds) {
  TrackMaker made;
  made.Frame({0, 0, 0}).Frame({0, 0, 0}, 2).Repeat(2).Frame({0, 0, 0.06}, 2).Frame({0, 0, 0.06});
  const Verdict verdict = Rate(LiftTask(), made.track());
  EXPECT_EQ(verdict.label, Label::kSuccess) << verdict.reason;
  EXPECT_EQ(verdict.judge, "oracle");
  EXPECT_EQ(verdict.rubric_version, "7");
  EXPECT_EQ(verdict.stages, (std::map<std::string, bool>{{"grasp", true}, {"lift", true}, {"release", true}}));
  EXPECT_THAT(verdict.reason,
              AllOf(HasSubstr("grasp at 0.3 s"), HasSubstr("lift at 0.4 s"), HasSubstr("release at 0.5 s")));
}

TEST_F(OracleJudgeTest, AFailureSaysWhichStageAndHowNearItCame) {
  TrackMaker made;
  made.Frame({0, 0, 0}, 2).Repeat(3).Frame({0, 0, 0.034}, 2).Frame({0, 0, 0.01}, 2);
  const Verdict verdict = Rate(LiftTask(), made.track());
  EXPECT_EQ(verdict.label, Label::kFailure);
  EXPECT_THAT(verdict.reason, AllOf(HasSubstr("stage lift was not reached; nearest at 0.4 s"),
                                    HasSubstr("0.034 m, wanted above 0.05"), HasSubstr("before it: grasp at 0.2 s")));
  EXPECT_EQ(verdict.stages, (std::map<std::string, bool>{{"grasp", true}, {"lift", false}, {"release", false}}));
}

TEST_F(OracleJudgeTest, AStageThatHeldTooShortIsNotReached) {
  TrackMaker made;
  made.Frame({0, 0, 0}, 2).Repeat(1).Frame({0, 0, 0}).Frame({0, 0, 0}, 2).Frame({0, 0, 0.1}, 0);
  const Verdict verdict = Rate(LiftTask(), made.track());
  EXPECT_EQ(verdict.label, Label::kFailure);
  EXPECT_THAT(verdict.reason, HasSubstr("stage grasp held for 0.1 s at most, wanted 0.2 s"));
}

TEST_F(OracleJudgeTest, AStageBeforeItsTurnDoesNotCount) {
  TrackMaker lifted_by_magic;
  lifted_by_magic.Frame({0, 0, 0}).Frame({0, 0, 0.2}).Frame({0, 0, 0}, 2).Repeat(4);
  EXPECT_THAT(Rate(LiftTask(), lifted_by_magic.track()).reason, HasSubstr("stage lift was not reached"));
}

TEST_F(OracleJudgeTest, WhatMustHoldAtTheEndIsLookedAtThere) {
  TrackMaker made;
  made.Frame({0, 0, 0}, 2).Repeat(2).Frame({0, 0, 0.06}).Frame({0, 0, 0.06}, 3);
  const Verdict verdict = Rate(LiftTask(), made.track());
  EXPECT_EQ(verdict.label, Label::kFailure);
  EXPECT_THAT(verdict.reason,
              AllOf(HasSubstr("stage release held at 0.3 s, but not at the end"), HasSubstr("3 N, wanted below 0.05")));
  EXPECT_FALSE(verdict.stages.at("release"));
}

TEST_F(OracleJudgeTest, WithoutATrackOrStagesItCannotTell) {
  EXPECT_EQ(Rate(LiftTask(), {}).label, Label::kCannotTell);
  Task task = LiftTask();
  task.id = "nothing";
  task.rubric.stages.clear();
  EXPECT_EQ(Rate(task, TrackMaker().Frame({0, 0, 0}).track()).label, Label::kCannotTell);
}

TEST_F(OracleJudgeTest, ARubricThatNamesWhatIsNotThereGivesAnInvalidVerdict) {
  const PrivilegedTrack track = TrackMaker().Frame({0, 0, 0}).track();
  Task task = LiftTask();
  task.rubric.stages[1].all_of[0].a = "botle";
  Verdict verdict = Rate(task, track);
  EXPECT_EQ(verdict.label, Label::kInvalid);
  EXPECT_THAT(verdict.reason, AllOf(HasSubstr("stage lift"), HasSubstr("'botle'")));
  task.id = "other";
  task.rubric = LiftTask().rubric;
  task.rubric.stages[1].all_of[0].kind = "hight";
  verdict = Rate(task, track);
  EXPECT_EQ(verdict.label, Label::kInvalid);
  EXPECT_THAT(verdict.reason, HasSubstr("'hight'"));
}

TEST_F(OracleJudgeTest, EveryEpisodeIsRatedOnceAndFailedOnesNever) {
  const PrivilegedTrack still = TrackMaker().Frame({0, 0, 0}).Repeat(3).track();
  Add(LiftTask(), still);
  Add(LiftTask(), {});
  const std::string hung = Add(LiftTask(), still, StopReason::kPolicyTimeout);
  OracleJudge oracle(store_);
  const JudgeSummary first = JudgeEpisodes(oracle, store_, {});
  EXPECT_EQ(first.rated, 2);
  EXPECT_EQ(first.failed, 1);
  EXPECT_EQ(first.labels, (std::map<Label, int>{{Label::kFailure, 1}, {Label::kCannotTell, 1}}));
  EXPECT_FALSE(store_.CurrentVerdicts().contains(hung));
  const JudgeSummary second = JudgeEpisodes(oracle, store_, {});
  EXPECT_EQ(second.rated, 0);
  EXPECT_EQ(second.already, 2);
  EXPECT_EQ(JudgeEpisodes(oracle, store_, {.again = true}).rated, 2);
  EXPECT_EQ(store_.Verdicts().size(), 4u) << "verdicts are only ever added";
}

TEST_F(OracleJudgeTest, SaysOfHowManyEpisodesItWasAsked) {
  const PrivilegedTrack still = TrackMaker().Frame({0, 0, 0}).Repeat(3).track();
  Add(LiftTask(), still);
  Add(LiftTask(), still);
  Add(LiftTask(), still, StopReason::kPolicyTimeout);
  OracleJudge oracle(store_);
  std::vector<std::pair<int, int>> said;
  JudgeOptions options{.on_asked = [&](int done, int total) { said.emplace_back(done, total); }};
  options.interrupted = [&] { return said.size() == 2; };
  EXPECT_EQ(JudgeEpisodes(oracle, store_, options).why_over, "interrupted");
  EXPECT_THAT(said, testing::ElementsAre(std::pair(0, 2), std::pair(1, 2)));
  options.interrupted = [] { return false; };
  said.clear();
  EXPECT_EQ(JudgeEpisodes(oracle, store_, options).rated, 1);
  EXPECT_THAT(said, testing::ElementsAre(std::pair(0, 1), std::pair(1, 1))) << "what has a verdict is not asked about";
  said.clear();
  JudgeEpisodes(oracle, store_, options);
  EXPECT_TRUE(said.empty()) << "nothing to say where nothing is asked";
}

TEST_F(OracleJudgeTest, AJudgeThatThrowsGivesInvalidVerdicts) {
  class Broken : public Judge {
   public:
    std::string Name() const override { return "broken"; }
    Verdict Rate(const Task&, const Episode&) override { throw std::runtime_error("no connection"); }
  };
  const std::string id = Add(LiftTask(), {});
  Broken broken;
  EXPECT_EQ(JudgeEpisodes(broken, store_, {}).labels.at(Label::kInvalid), 1);
  const Verdict verdict = store_.CurrentVerdicts().at(id).at("broken");
  EXPECT_EQ(verdict.reason, "no connection");
  EXPECT_EQ(verdict.rubric_version, "7");
}

TEST_F(OracleJudgeTest, WhatTheMachineRefusesIsNoVerdictOfAClip) {
  class Full : public Judge {
   public:
    std::string Name() const override { return "full"; }
    Verdict Rate(const Task&, const Episode&) override {
      if (has_memory) throw InternalError("no space left on device");
      throw std::bad_alloc();
    }
    bool has_memory = true;
  };
  const std::string id = Add(LiftTask(), {});
  Full full;
  EXPECT_THROW(JudgeEpisodes(full, store_, {}), Error);
  full.has_memory = false;
  EXPECT_THROW(JudgeEpisodes(full, store_, {}), std::bad_alloc);
  EXPECT_FALSE(store_.CurrentVerdicts().contains(id)) << "it can be asked about again";
}

/// It was stored as `invalid`, which nothing asks about again.
TEST_F(OracleJudgeTest, ATrackThatTheDiskDoesNotGiveIsNoVerdict) {
  store_ = Store::CreateOrContinue(folder_ / "run", {.suite_text = "", .suite_hash = "h", .suite_path = "", .evac_version = ""});
  store_.AddWorld({.name = "real", .type = "mujoco", .is_real = true, .profile_hash = ""});
  store_.AddPolicy({"hold", "a", ""});
  Add(LiftTask(), TrackMaker().Frame({0, 0, 0}).track());
  sqlite::Connection::OpenReadWrite(folder_ / "run/evac.sqlite").Run("DROP TABLE privileged");
  OracleJudge oracle(store_);
  EXPECT_THAT([&] { JudgeEpisodes(oracle, store_, {}); }, testing::ThrowsMessage<Error>(HasSubstr("privileged")));
  EXPECT_TRUE(store_.Verdicts().empty());
}

TEST(Rubric, EveryKindMeasuresWhatItsNameSays) {
  TrackMaker made;
  made.Frame({0, 0, 0.1}).Frame({0.3, 0.4, 0.3}, 2.5, std::numbers::pi / 3);
  const TrackView track{made.track(), 0.1};
  const auto value = [&](const char* kind, const char* b = "") {
    return Measure({kind, "bottle", b, 0.0, {}}, track, 1);
  };
  EXPECT_NEAR(value("distance", "gripper"), std::sqrt(0.25 + 0.04), 1e-12);
  EXPECT_NEAR(value("horizontal_distance", "gripper"), 0.5, 1e-12);
  EXPECT_NEAR(value("height"), 0.3, 1e-12);
  EXPECT_NEAR(value("height_gain"), 0.2, 1e-12);
  EXPECT_NEAR(value("displacement"), 0.5, 1e-12);
  EXPECT_NEAR(value("contact", "gripper"), 2.5, 1e-12);
  EXPECT_NEAR(value("contact", "table"), 0, 1e-12);
  EXPECT_NEAR(value("tilt"), 60, 1e-9);
  EXPECT_NEAR(value("speed"), std::sqrt(0.25 + 0.04) / 0.1, 1e-9);
  EXPECT_NEAR(Measure({"contact", "gripper", "bottle", 0.0, {}}, track, 1), 2.5, 1e-12) << "in either order of the two";
  EXPECT_EQ(Measure({"speed", "bottle", "", 0.0, {}}, track, 0), 0);
}

TEST(Rubric, BoundsAreStrictAndANanSatisfiesNone) {
  EXPECT_TRUE(Holds(Make("height", 0, 1), 0.5));
  EXPECT_FALSE(Holds(Make("height", 0, 1), 0));
  EXPECT_FALSE(Holds(Make("height", 0, 1), 1));
  EXPECT_FALSE(Holds(Make("height", std::nullopt, 1), std::nan("")));
  EXPECT_NEAR(Shortfall(Make("height", 2, std::nullopt), 1), 0.5, 1e-12);
}

TEST(Rubric, WhatIsWrongWithItIsSaidInASentence) {
  const auto wrong = [](Condition condition) {
    Rubric rubric;
    rubric.stages = {MakeStage("grasp", {std::move(condition)})};
    return WhatIsWrong(rubric).value_or("nothing");
  };
  EXPECT_EQ(wrong(Make("height", 0.1, std::nullopt)), "nothing");
  EXPECT_THAT(wrong(Make("wetness", 0.1, std::nullopt)), HasSubstr("stage grasp: unknown kind of condition 'wetness'"));
  EXPECT_THAT(wrong(Make("contact", 0.1, std::nullopt)), HasSubstr("contact needs a body b"));
  EXPECT_THAT(wrong(Make("height", 0.1, std::nullopt, "table")), HasSubstr("about one body"));
  EXPECT_THAT(wrong(Make("height", std::nullopt, std::nullopt)), HasSubstr("neither above nor below"));
  EXPECT_THAT(wrong(Make("height", 0.3, 0.2)), HasSubstr("can never hold"));
  Rubric twice;
  twice.stages = {MakeStage("a", {Make("height", 0, std::nullopt)}), MakeStage("a", {Make("height", 0, std::nullopt)})};
  EXPECT_THAT(WhatIsWrong(twice).value_or(""), HasSubstr("there twice"));
  twice.stages.pop_back();
  twice.stages[0].hold_s = -1;
  EXPECT_THAT(WhatIsWrong(twice).value_or(""), HasSubstr("hold_s is -1"));
}

}  // namespace
}  // namespace evac
