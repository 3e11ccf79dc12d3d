#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>

#include "apps/networks/judge_shard_clips.h"
#include "apps/networks/learners.h"
#include "apps/networks/train_judge.h"
#include "core/error.h"
#include "core/file.h"
#include "core/weight_file.h"
#include "judges/judge_card.h"
#include "tests/apps/learning_shards.h"
#include "tests/apps/printed.h"
#include "tests/support/temp_folder.h"

/// What becomes of a judge's card where another one goes on from it, and what calibrating refuses.
namespace evac {
namespace {

using testing::HasSubstr;
using testing::ThrowsMessage;

class CalibrateJudgeTest : public testing::Test {
 protected:
  static std::filesystem::path Written(const std::filesystem::path& folder) {
    WriteLearningShards(folder, {});
    return folder;
  }
  train::JobPlace Place(const std::string& out) const {
    train::JobPlace place;
    place.shards = {shards_};
    place.out = folder_ / out;
    return place;
  }
  static TensorMetadata CardOfNone() {
    return {{"format", kClassifierFormat}, {"tasks", "carry"},    {"cameras", "head,hand_right"},
            {"frames", "8"},               {"height_px", "16"},   {"width_px", "24"},
            {"temperature", "1"},          {"threshold", "0.5"},  {"unsure", "0.1"}};
  }
  /// A judge that was never trained. @param more  of its card
  std::filesystem::path Given(const TensorMetadata& more) const {
    const Learners<ClassifierNet> learners(ClassifierShape{{"carry"}, {"head", "hand_right"}, 16, 24}, 3, 1);
    TensorMetadata card = CardOfNone();
    card.insert(more.begin(), more.end());
    learners.Write(folder_ / "given.safetensors", card);
    return folder_ / "given.safetensors";
  }
  TensorMetadata CardOf(const std::string& out) const {
    return WeightFile(folder_ / out / "judge.safetensors", kClassifierFormat).card();
  }
  void Calibrate(const std::string& out, const JudgeClipSource& learn, const std::filesystem::path& judge,
                 const JudgeTrainingOptions& options = {}) const {
    CalibrateJudge(Place(out), options, {learn, holdout_, judge});
  }
  ShardClips Learn() const { return ShardClips({shards_}, train::Split::kTrain, nullptr); }

  const TempFolder folder_;
  const std::filesystem::path shards_ = Written(folder_ / "shards");
  const ShardClips holdout_{{shards_}, train::Split::kHoldout, nullptr};
};

/// It said how long the clips were that it was calibrated with, though the weights had learned from longer ones.
TEST_F(CalibrateJudgeTest, ItMaySeeClipsAsLongAsBefore) {
  const ShardClips learn = Learn();
  Calibrate("long", learn, Given({{"longest_frames", "340"}}));
  EXPECT_EQ(CardOf("long").at("longest_frames"), "340");
  Calibrate("short", learn, Given({{"longest_frames", "7"}}));
  EXPECT_EQ(CardOf("short").at("longest_frames"), "7");
  Calibrate("unknown", learn, Given({}));
  EXPECT_FALSE(CardOf("unknown").contains("longest_frames"));
}

/// The judge that ships looks at three places, the page that ships says one: "wanted at most 1".
TEST_F(CalibrateJudgeTest, ItLooksAtAsManyPlacesAsItsCardSaysAndNotAsThePage) {
  const ShardClips learn = Learn();
  for (const std::int64_t looks : {1, 3}) {
    const Learners<ClassifierNet> learners(ClassifierShape{{"carry"}, {"head", "hand_right"}, 16, 24, looks}, 3, 1);
    const std::filesystem::path judge = folder_ / ("looks_" + std::to_string(looks) + ".safetensors");
    TensorMetadata card = CardOfNone();
    if (looks > 1) card["looks"] = std::to_string(looks);
    learners.Write(judge, card);
    for (const std::int64_t of_page : {1, 2, 4}) {
      JudgeTrainingOptions options;
      options.looks = of_page;
      Calibrate("out", learn, judge, options);
      EXPECT_EQ(CardOf("out").contains("looks") ? CardOf("out").at("looks") : "1", std::to_string(looks)) << of_page;
      EXPECT_FALSE(std::filesystem::exists(folder_ / "out" / "begin.safetensors")) << of_page;
    }
  }
}

TEST_F(CalibrateJudgeTest, GoneOnWithItMaySeeClipsAsLongAsEitherLearnedFrom) {
  JudgeTrainingOptions options;
  options.batch = 4;
  options.calibration = 0.3;
  options.job.trainer.steps = options.job.trainer.holdout_every = 1;
  options.job.trainer.seed = 3;
  const ShardClips learn = Learn();
  TrainJudge(Place("long"), options, {learn, holdout_, Given({{"longest_frames", "340"}})});
  EXPECT_EQ(CardOf("long").at("longest_frames"), "340");
  TrainJudge(Place("short"), options, {learn, holdout_, Given({{"longest_frames", "7"}})});
  EXPECT_EQ(CardOf("short").at("longest_frames"), std::to_string(LearningShards{}.frames));
}

/// Without any its temperature was just under 20 and its `longest_frames` 0, and it was called calibrated.
TEST_F(CalibrateJudgeTest, ClipsOfOneOutcomeOrOfNoneAreRefused) {
  const std::filesystem::path judge = Given({});
  const auto refused = [&](const ShardClips& learn, const char* why) {
    EXPECT_THAT([&] { Calibrate("out", learn, judge); }, ThrowsMessage<Error>(HasSubstr(why))) << why;
  };
  ShardClips none = Learn(), successes = Learn(), failures = Learn();
  none.clips.clear();
  for (PackedClip& clip : successes.clips) clip.outcome = 1;
  for (PackedClip& clip : failures.clips) clip.outcome = 0;
  refused(none, "0 of 0 clips to calibrate with are successes, wanted some of both kinds");
  refused(successes, "24 of 24 clips to calibrate with are successes");
  refused(failures, "0 of 24 clips to calibrate with are successes");
  EXPECT_FALSE(std::filesystem::exists(folder_ / "out"));
}

/// It was calibrated and written, and no command judged by it.
TEST_F(CalibrateJudgeTest, ClipsWhoseSidesAreNoMultiplesOfEightAreRefused) {
  WriteLearningShards(folder_ / "odd", {.clips = 8, .height_px = 20});
  const ShardClips learn({folder_ / "odd"}, train::Split::kTrain, nullptr),
      holdout({folder_ / "odd"}, train::Split::kHoldout, nullptr);
  const Learners<ClassifierNet> learners(ClassifierShape{{"carry"}, {"head", "hand_right"}, 20, 24}, 3, 1);
  TensorMetadata card = CardOfNone();
  card["height_px"] = "20";
  learners.Write(folder_ / "odd.safetensors", card);
  EXPECT_THAT([&] { CalibrateJudge(Place("out"), {}, {learn, holdout, folder_ / "odd.safetensors"}); },
              ThrowsMessage<Error>(HasSubstr("pictures are 24x20, wanted multiples of 8")));
  EXPECT_FALSE(std::filesystem::exists(folder_ / "out"));
}

/// Each clip was measured as often as its folder was named, and the card said twice the clips.
TEST_F(CalibrateJudgeTest, ClipsOfAFolderThatIsNamedTwiceAreMeasuredOnce) {
  const ShardClips once = Learn(), twice({shards_, shards_ / ""}, train::Split::kTrain, nullptr);
  ASSERT_EQ(twice.clips.size(), 2 * once.clips.size());
  JudgeTrainingOptions options;
  options.calibration = 0.3;
  options.job.trainer.seed = 3;
  const JudgeSplit of_one = SplitForJudge(once.clips, options), of_two = SplitForJudge(twice.clips, options);
  EXPECT_EQ(of_two.fit.size(), 2 * of_one.fit.size()) << "drawn from twice as often";
  EXPECT_EQ(of_two.calibration.size(), of_one.calibration.size());
  Printed(AddTrain, {"train", "judge", shards_.string(), (shards_ / "").string(), "--init", Given({}).string(),
                     "--calibrate-only", "--out", (folder_ / "out").string()});
  EXPECT_EQ(std::ranges::count(ReadFile(folder_ / "out" / "judged.csv"), '\n'),
            1 + std::ssize(once.clips) + std::ssize(holdout_.clips));
  EXPECT_EQ(CardOf("out").at("holdout_clips"), std::to_string(holdout_.clips.size()));
}

TEST_F(CalibrateJudgeTest, OptionsOutOfRangeAreRefusedAsByTraining) {
  const ShardClips learn = Learn();
  const std::filesystem::path judge = Given({});
  for (const double unsure : {-1.0, 2.0}) {
    JudgeTrainingOptions options;
    options.unsure = unsure;
    EXPECT_THAT([&] { Calibrate("out", learn, judge, options); },
                ThrowsMessage<TensorError>(HasSubstr("judge training: unsure is ")));
  }
  JudgeTrainingOptions options;
  options.longest = 0.5;
  EXPECT_THAT([&] { Calibrate("out", learn, judge, options); },
              ThrowsMessage<Error>(HasSubstr("longest is 0.5, wanted at least 1")));
  EXPECT_FALSE(std::filesystem::exists(folder_ / "out"));
}

}  // namespace
}  // namespace evac
