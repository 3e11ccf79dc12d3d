#include "judges/judge_balance.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <optional>
#include <string>
#include <vector>

#include "core/error.h"
#include "core/seed.h"
#include "tests/support/temp_folder.h"

namespace evac {
namespace {

using testing::HasSubstr;

/// A run of one task, one policy.
class Judged {
 public:
  Judged() {
    Task task;
    task.id = "take";
    store_.AddTask(task);
    store_.AddPolicy({"policy", "v1", "{}"});
    store_.AddWorld({"real", "mujoco", true, ""});
    store_.AddWorld({"evac", "evac", false, ""});
  }

  EpisodeKey Add(const std::string& world, int state, StopReason stop = StopReason::kStill) {
    EpisodeRecord record;
    record.episode.key = {{"take", std::to_string(state), "policy", "v1", 1}, world};
    record.episode.stop = stop;
    if (IsFailure(stop)) record.episode.failure = "gone";
    store_.Add(record);
    return record.episode.key;
  }

  void Say(const std::string& judge, const EpisodeKey& key, Label label, std::optional<double> probability = {}) {
    Verdict verdict;
    verdict.episode_id = key.Id();
    verdict.judge = judge;
    verdict.label = label;
    verdict.probability = probability;
    store_.AddVerdict(verdict);
  }

  /// What truly happened and what the judge says of the imagined clip.
  void Pair(int state, Label truth, std::optional<double> probability) {
    Say("oracle", Add("real", state), truth);
    Say("classifier:x", Add("evac", state), Label::kCannotTell, probability);
  }

  Store& store() { return store_; }

 private:
  TempFolder folder_;
  Store store_ = Store::InMemory(folder_.path(), {.suite_text = "suite: x", .suite_hash = "0", .suite_path = "x.yaml", .evac_version = "0"});
};

TEST(PairedClips, AreThoseWhosePairTrulySucceededOrFailed) {
  Judged run;
  run.Pair(0, Label::kSuccess, 0.9);
  run.Pair(1, Label::kFailure, 0.6);
  run.Pair(2, Label::kCannotTell, 0.6);   // nobody knows
  run.Pair(3, Label::kSuccess, {});       // the judge gave nothing
  run.Say("classifier:x", run.Add("evac", 4), Label::kFailure, 0.1);  // no pair
  run.Say("oracle", run.Add("real", 5, StopReason::kWorldError), Label::kSuccess);
  run.Say("classifier:x", run.Add("evac", 5), Label::kFailure, 0.1);  // an error in the real world is no failure
  run.Say("classifier:x", run.Add("evac", 6, StopReason::kPolicyTimeout), Label::kFailure, 0.1);
  const PairedClips paired = PairedClipsOf(run.store(), "classifier:x", "oracle", "");
  EXPECT_EQ(paired.world, "evac");
  ASSERT_EQ(paired.clips.size(), 2u);
  EXPECT_EQ(paired.clips[0].state, "take/0");
  EXPECT_TRUE(paired.clips[0].succeeded);
  EXPECT_DOUBLE_EQ(paired.clips[1].probability, 0.6);
  EXPECT_FALSE(paired.clips[1].succeeded);
  EXPECT_EQ(paired.left_out, 4);
}

TEST(PairedClips, OfSeveralJudgedWorldsOneMustBeNamed) {
  Judged run;
  run.Pair(0, Label::kSuccess, 0.9);
  run.store().AddWorld({"sim", "mujoco", false, ""});
  run.Say("classifier:x", run.Add("sim", 0), Label::kSuccess, 0.8);
  const auto message = [&](const std::string& world, const std::string& judge = "classifier:x") -> std::string {
    try {
      PairedClipsOf(run.store(), judge, "oracle", world);
    } catch (const Error& error) {
      return error.what();
    }
    return "";
  };
  EXPECT_THAT(message(""), HasSubstr("evac, sim: wanted one of them as --world"));
  EXPECT_THAT(message("real"), HasSubstr("is the real world"));
  EXPECT_THAT(message("mars"), HasSubstr("no verdict of world 'mars'"));
  EXPECT_THAT(message("", "classifier:y"), HasSubstr("has rated no clip"));
  EXPECT_DOUBLE_EQ(PairedClipsOf(run.store(), "classifier:x", "oracle", "sim").clips.at(0).probability, 0.8);
}

/// A judge that is too sure of itself by `optimism`; ten policies at each state.
std::vector<PairedClip> Clips(double optimism, int states) {
  SplitMix64 random(3);
  std::vector<PairedClip> clips;
  for (int state = 0; state < states; ++state) {
    for (int policy = 0; policy < 10; ++policy) {
      const bool succeeded = random.Uniform() < 0.5;
      const double probability = std::clamp((succeeded ? 0.7 : 0.3) + optimism + 0.2 * random.Normal(), 0.0, 1.0);
      clips.push_back({std::to_string(state), probability, succeeded, ""});
    }
  }
  return clips;
}

TEST(JudgeBalance, MovesTheThresholdByWhatTheJudgeIsTooKind) {
  const Estimate fair = BalanceOf(Clips(0, 100)), kind = BalanceOf(Clips(0.2, 100));
  EXPECT_NEAR(*fair.value, 0.5, 0.04);
  EXPECT_NEAR(*kind.value, 0.7, 0.04);
  const ConfusionStatistics before = StatisticsOf(ConfusionAt(Clips(0.2, 100), 0.5)),
                            after = StatisticsOf(ConfusionAt(Clips(0.2, 100), *kind.value));
  EXPECT_GT(1 - *before.specificity.value, 2 * (1 - *before.sensitivity.value));
  EXPECT_NEAR(1 - *after.specificity.value, 1 - *after.sensitivity.value, 0.02);
}

TEST(JudgeBalance, LiesWhereAJudgeThatIsTooSureNeedsIt) {
  std::vector<PairedClip> clips;
  for (int state = 0; state < 40; ++state) clips.push_back({std::to_string(state), state % 2 == 0 ? 0.99 : state % 4 == 1 ? 0.97 : 0.02, state % 2 == 0, ""});
  const Estimate sure = BalanceOf(clips);
  EXPECT_GT(*sure.value, 0.97);
  EXPECT_LE(*sure.value, 0.99);
  EXPECT_EQ(*StatisticsOf(ConfusionAt(clips, *sure.value)).accuracy, 1);
}

TEST(JudgeBalance, SaysHowFarOtherStatesCouldMoveIt) {
  const Estimate few = BalanceOf(Clips(0.1, 12)), many = BalanceOf(Clips(0.1, 200));
  ASSERT_TRUE(few.interval && many.interval);
  EXPECT_LE(many.interval->low, *many.value);
  EXPECT_GE(many.interval->high, *many.value);
  EXPECT_GT(few.interval->high - few.interval->low, many.interval->high - many.interval->low);
  EXPECT_EQ(BalanceOf(Clips(0.1, 12)).interval->low, few.interval->low) << "the same draws every time";
}

TEST(JudgeBalance, IsUndefinedWhereAllOutcomesAreAlikeOrThereIsOneState) {
  EXPECT_FALSE(BalanceOf({}).value);
  EXPECT_FALSE(BalanceOf({{"0", 0.5, true, ""}}).value);
  EXPECT_FALSE(BalanceOf({{"0", 0.5, true, ""}, {"1", 0.5, false, ""}}).value) << "all probabilities are alike";
  const Estimate one_state = BalanceOf({{"0", 0.2, false, ""}, {"0", 0.8, true, ""}});
  EXPECT_TRUE(one_state.value);
  EXPECT_FALSE(one_state.interval);
}

}  // namespace
}  // namespace evac
