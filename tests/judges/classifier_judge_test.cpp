#include "judges/classifier_judge.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <deque>
#include <limits>
#include <map>

#include "core/error.h"
#include "core/seed.h"
#include "core/store.h"
#include "core/tensor_file.h"
#include "core/video.h"
#include "judges/classifier_net.h"
#include "judges/judge_episodes.h"
#include "tests/support/temp_folder.h"

namespace evac {
namespace {

namespace fs = std::filesystem;
using testing::HasSubstr;
using testing::StartsWith;
using testing::ThrowsMessage;

const TensorMetadata kCard = {{"format", "evac-classifier 1"},
                              {"tasks", "take_bottle,take_toast"},
                              {"cameras", "head,hand_right"},
                              {"frames", "8"},
                              {"height_px", "16"},
                              {"width_px", "24"},
                              {"temperature", "1.5"},
                              {"threshold", "0.4"},
                              {"unsure", "0.05"}};

/// Weights that no training made, as a file, with that card.
/// @param furthest  no number is further from 0
fs::path Weights(const fs::path& path, const TensorMetadata& card = kCard, double furthest = 0.2) {
  std::deque<std::vector<float>> numbers;
  std::vector<TensorView> views;
  SplitMix64 random(3);
  const TakeParameter take = [&](const std::string& key, const std::vector<std::int64_t>& shape) {
    TensorView view{{key, TensorType::kF32, shape}, {}};
    std::vector<float>& values = numbers.emplace_back(view.ByteCount() / sizeof(float));
    for (float& value : values) value = static_cast<float>(random.Uniform(-furthest, furthest));
    view.bytes = std::as_bytes(std::span(values));
    views.push_back(view);
    return at::Tensor();
  };
  ClassifierNet({{"take_bottle", "take_toast"}, {"head", "hand_right"}, 16, 24}, take);
  WriteTensorFile(path, views, card);
  return path;
}

Task BottleTask() {
  Task task;
  task.id = "take_bottle";
  task.cameras = {{.name = "head", .width_px = 24, .height_px = 16},
                  {.name = "hand_right", .width_px = 24, .height_px = 16}};
  task.rubric.version = "3";
  return task;
}

class ClassifierJudgeTest : public testing::Test {
 protected:
  /// A stored episode with a clip of `frames` grey frames.
  Episode Stored(const std::string& state, int grey) {
    Episode episode;
    episode.key = {{"take_bottle", state, "p", "c", 1}, "real"};
    episode.stop = StopReason::kStill;
    episode.observations.resize(1);
    episode.observations[0].arms.resize(1);
    VideoWriter writer(store_.VideoPath(episode.key), {.period_s = 0.1, .scale = 2});
    for (int i = 0; i < 12; ++i) {
      const cv::Mat view(16, 24, CV_8UC3, cv::Scalar::all(grey + i));
      writer.Append(SideBySide({view, view}));
    }
    store_.Add({.episode = episode, .privileged = {}, .video = writer.Finish(), .thumbnail_jpeg = ""});
    return store_.Episodes().back();
  }

  const TempFolder folder_;
  Store store_ = [this] {
    Store store = Store::InMemory(
        folder_.path(), {.suite_text = "suite: test\n", .suite_hash = "h", .suite_path = "", .evac_version = "0"});
    store.AddTask(BottleTask());
    store.AddWorld({.name = "real", .type = "mujoco", .is_real = true, .profile_hash = ""});
    store.AddPolicy({.name = "p", .checkpoint = "c", .declaration = "{}"});
    return store;
  }();
};

TEST_F(ClassifierJudgeTest, RatesAClipWithAProbabilityAndTheLabelOfItsCard) {
  ClassifierJudge judge(Weights(folder_ / "w.safetensors"), folder_.path());
  const Episode episode = Stored("1-0000", 40);
  const Verdict verdict = judge.Rate(BottleTask(), episode);
  EXPECT_THAT(verdict.judge, StartsWith("classifier:"));
  EXPECT_EQ(verdict.judge.size(), std::string("classifier:").size() + 12);
  ASSERT_TRUE(verdict.probability);
  EXPECT_EQ(verdict.label, LabelOf(*verdict.probability, judge.card()));
  EXPECT_EQ(verdict.rubric_version, "3");
  EXPECT_EQ(judge.Rate(BottleTask(), episode).probability, verdict.probability) << "the same clip again";
}

TEST_F(ClassifierJudgeTest, AnOffsetOfTheCardIsTakenFromTheLogit) {
  TensorMetadata card = kCard;
  card["offset"] = "3";
  const Episode episode = Stored("1-0000", 40);
  const auto logit = [&](const fs::path& weights) {
    const double p = *ClassifierJudge(weights, folder_.path()).Rate(BottleTask(), episode).probability;
    return std::log(p / (1 - p));
  };
  EXPECT_NEAR(logit(Weights(folder_ / "plain.safetensors")) - logit(Weights(folder_ / "offset.safetensors", card)), 3 / 1.5, 1e-5);
}

TEST_F(ClassifierJudgeTest, SeesTheClipAndNothingElseOfTheEpisode) {
  ClassifierJudge judge(Weights(folder_ / "w.safetensors"), folder_.path());
  Episode episode = Stored("1-0000", 40);
  const std::optional<double> first = judge.Rate(BottleTask(), episode).probability;
  episode.observations.resize(5);
  episode.commands.resize(4, Arms(1));
  EXPECT_EQ(judge.Rate(BottleTask(), episode).probability, first);
  EXPECT_NE(judge.Rate(BottleTask(), Stored("1-0001", 150)).probability, first);
}

TEST_F(ClassifierJudgeTest, AClipThatCannotBeReadIsAnErrorRowAndNoFailure) {
  Stored("1-0000", 40);
  const Episode broken = Stored("1-0001", 90);
  fs::resize_file(folder_.path() / broken.video, 300);
  ClassifierJudge judge(Weights(folder_ / "w.safetensors"), folder_.path());
  const JudgeSummary summary = JudgeEpisodes(judge, store_, {});
  EXPECT_EQ(summary.rated, 2);
  EXPECT_EQ(summary.labels.at(Label::kInvalid), 1);
  const Verdict verdict = store_.CurrentVerdicts().at(broken.key.Id()).at(judge.Name());
  EXPECT_EQ(verdict.label, Label::kInvalid);
  EXPECT_THAT(verdict.reason, HasSubstr(".mp4"));
}

TEST_F(ClassifierJudgeTest, AnAnswerThatIsNotFiniteIsAnErrorRowAndNoFailure) {
  const Episode episode = Stored("1-0000", 40);
  ClassifierJudge judge(Weights(folder_ / "w.safetensors", kCard, 1e30), folder_.path());  // finite, what they make is not
  const JudgeSummary summary = JudgeEpisodes(judge, store_, {});
  EXPECT_EQ(summary.labels, (std::map<Label, int>{{Label::kInvalid, 1}}));
  const Verdict verdict = store_.CurrentVerdicts().at(episode.key.Id()).at(judge.Name());
  EXPECT_THAT(verdict.reason, HasSubstr("wanted a finite number"));
  EXPECT_FALSE(verdict.probability);
}

TEST_F(ClassifierJudgeTest, WeightsWithNumbersThatAreNoneAreRefused) {
  EXPECT_THAT(
      [&] {
        ClassifierJudge(Weights(folder_ / "w.safetensors", kCard, std::numeric_limits<double>::infinity()), "");
      },
      ThrowsMessage<Error>(HasSubstr("wanted a finite one")));
}

TEST_F(ClassifierJudgeTest, AClipLongerThanAnyItLearnedFromIsNotJudged) {
  const Episode episode = Stored("1-0000", 40);  // 12 frames
  TensorMetadata card = kCard;
  card["longest_frames"] = "12";
  ClassifierJudge fits(Weights(folder_ / "fits.safetensors", card), folder_.path());
  EXPECT_TRUE(fits.Rate(BottleTask(), episode).probability);
  card["longest_frames"] = "11";
  ClassifierJudge judge(Weights(folder_ / "w.safetensors", card), folder_.path());
  JudgeEpisodes(judge, store_, {});
  const Verdict verdict = store_.CurrentVerdicts().at(episode.key.Id()).at(judge.Name());
  EXPECT_EQ(verdict.label, Label::kInvalid);
  EXPECT_THAT(verdict.reason, HasSubstr("12 frames, wanted at most 11"));
}

TEST_F(ClassifierJudgeTest, RefusesTasksAndCamerasThatItDidNotLearn) {
  const ClassifierJudge judge(Weights(folder_ / "w.safetensors"), folder_.path());
  Task task = BottleTask();
  EXPECT_NO_THROW(judge.CheckKnows({&task, 1}));
  task.id = "take_ham";
  EXPECT_THAT(
      [&] {
        judge.CheckKnows({&task, 1});
      },
      ThrowsMessage<Error>(HasSubstr("task take_ham is none it learned, wanted one of take_bottle, take_toast")));
  task = BottleTask();
  task.cameras[1].name = "hand_left";
  EXPECT_THAT([&] { judge.CheckKnows({&task, 1}); }, ThrowsMessage<Error>(HasSubstr("has a camera hand_left")));
  task.cameras = {BottleTask().cameras[1]};
  EXPECT_THAT([&] { judge.CheckKnows({&task, 1}); }, ThrowsMessage<Error>(HasSubstr("has no camera head")));
  task.cameras = {BottleTask().cameras[0]};
  EXPECT_NO_THROW(judge.CheckKnows({&task, 1})) << "the first view alone is enough";
}

TEST_F(ClassifierJudgeTest, WeightsThatDoNotFitAreRefusedWithWhatDiffers) {
  const auto complaint = [&](const char* field, const std::string& value) {
    TensorMetadata card = kCard;
    card[field] = value;
    try {
      ClassifierJudge(Weights(folder_ / "bad.safetensors", card), folder_.path());
    } catch (const Error& error) {
      return std::string(error.what());
    }
    return std::string("nothing");
  };
  EXPECT_THAT(complaint("format", "evac-policy-learned 1"), HasSubstr("wanted 'evac-classifier 1'"));
  EXPECT_THAT(complaint("frames", "16"), HasSubstr("a classifier of 16 pictures, wanted 8"));
  EXPECT_THAT(complaint("height_px", "20"), HasSubstr("wanted multiples of 8"));
  EXPECT_THAT(complaint("tasks", "take_bottle"), HasSubstr("wanted F32 [1, 48]"));
  EXPECT_THAT(complaint("cameras", "head"), HasSubstr("wanted F32"));
  EXPECT_THAT(complaint("threshold", "1.5"), HasSubstr("threshold 1.5"));
  EXPECT_THAT(complaint("offset", "far"), HasSubstr("offset"));
  EXPECT_THAT(complaint("looks", "0"), HasSubstr("looks"));
  EXPECT_THAT(complaint("looks", "3"), HasSubstr("where1.embedding")) << "weights of one look";
}

TEST(ClassifierCard, SaysCannotTellNearItsThreshold) {
  const ClassifierCard card{1, 0.4, 0.1};
  EXPECT_EQ(LabelOf(0.1, card), Label::kFailure);
  EXPECT_EQ(LabelOf(0.35, card), Label::kCannotTell);
  EXPECT_EQ(LabelOf(0.45, card), Label::kCannotTell);
  EXPECT_EQ(LabelOf(0.9, card), Label::kSuccess);
  EXPECT_EQ(LabelOf(0.4, {1, 0.4, 0}), Label::kSuccess);
}

}  // namespace
}  // namespace evac
