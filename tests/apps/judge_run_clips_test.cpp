#include "apps/networks/judge_run_clips.h"

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <set>

#include "apps/networks/judge_tables.h"
#include "apps/networks/train_judge.h"
#include "core/store.h"
#include "core/video.h"
#include "core/weight_file.h"
#include "judges/classifier_judge.h"
#include "judges/judge_episodes.h"
#include "tests/support/temp_folder.h"

/// Clips of a run, judged by somebody, become a classifier.
namespace evac {
namespace {

using testing::AllOf;
using testing::Each;
using testing::HasSubstr;
using testing::ThrowsMessage;

/// A run of 40 initial states, two clips of each: a square that goes to the right (success) or stays; a judge "people"
/// said so of all but the last state.
class LabelledRun : public testing::Test {
 protected:
  LabelledRun() { FillIn(store_, 24); }

  static void FillIn(Store& store, int width_px, const std::string& instruction = "") {
    Task task;
    task.id = "carry";
    task.instruction = instruction;
    task.cameras = {{.name = "head", .width_px = width_px, .height_px = 16}};
    task.rubric.version = "1";
    store.AddTask(task);
    store.AddWorld({.name = "real", .type = "mujoco", .is_real = true, .profile_hash = ""});
    for (const char* checkpoint : {"1", "2"})
      store.AddPolicy({.name = "p", .checkpoint = checkpoint, .declaration = "{}"});
    for (int state = 0; state < kStates; ++state) {
      AddClip(store, width_px, state, true);
      AddClip(store, width_px, state, false);
    }
  }

  static void AddClip(Store& store, int width_px, int state, bool success) {
    const char* checkpoint = success ? "1" : "2";
    EpisodeRecord record;
    Episode& episode = record.episode;
    episode.key = {{"carry", fmt::format("5-{:04d}", state), "p", checkpoint, 1}, "real"};
    episode.stop = StopReason::kStill;
    episode.observations.resize(1);
    episode.observations[0].arms.resize(1);
    VideoWriter writer(store.VideoPath(episode.key), {.period_s = 0.1, .scale = 2});
    for (int t = 0; t < 30; ++t) {
      cv::Mat view(16, width_px, CV_8UC3, cv::Scalar::all(50 + state));
      view(cv::Rect(2 + (success ? t / 2 : 0), 4 + state % 7, 5, 5)).setTo(cv::Scalar(240, 60, 60));
      writer.Append(view);
    }
    record.video = writer.Finish();
    store.Add(record);
    if (state + 1 == kStates) return;
    Verdict verdict;
    verdict.episode_id = episode.key.Id();
    verdict.judge = "people";
    verdict.label = success ? Label::kSuccess : Label::kFailure;
    store.AddVerdict(verdict);
  }

  LabelledRuns Options() const {
    return {.runs = {folder_ / "run"}, .truth = "people", .height_px = 16, .width_px = 24, .holdout = 0.3, .least = 15};
  }
  LabelledClips Read(const LabelledRuns& options) {
    return ReadLabelledClips(options, [this](const std::string& sentence) { said_.push_back(sentence); });
  }

  static constexpr int kStates = 40;
  const TempFolder folder_;
  Store store_ = Store::CreateOrContinue(
      folder_ / "run", {.suite_text = "suite: test\n", .suite_hash = "h", .suite_path = "", .evac_version = "0"});
  std::vector<std::string> said_;
};

TEST_F(LabelledRun, IsSplitByInitialStateAndHoldsWhatWasJudgedAlone) {
  const LabelledClips clips = Read(Options());
  EXPECT_EQ(clips.learn->clips.size() + clips.holdout->clips.size(), 2U * (kStates - 1));
  std::set<std::string> learned;
  for (const PackedClip& clip : clips.learn->clips) learned.insert(clip.state);
  for (const PackedClip& clip : clips.holdout->clips) EXPECT_FALSE(learned.contains(clip.state)) << clip.state;
  EXPECT_GT(clips.holdout->clips.size(), 8U);
  EXPECT_FALSE(clips.learn->KnowsObjects());
}

TEST_F(LabelledRun, BesideAnotherOfTheSameTaskByLargerCamerasBothAreReadWhole) {
  Store other = Store::CreateOrContinue(
      folder_ / "other", {.suite_text = "suite: test\n", .suite_hash = "o", .suite_path = "", .evac_version = "0"});
  FillIn(other, 36);
  LabelledRuns options = Options();
  options.runs = {folder_ / "run", folder_ / "other"};
  const LabelledClips clips = Read(options);
  EXPECT_THAT(said_, testing::IsEmpty());
  EXPECT_EQ(clips.learn->clips.size() + clips.holdout->clips.size(), 4U * (kStates - 1));
  EXPECT_EQ(clips.learn->tasks, std::vector<std::string>{"carry"});
}

/// Recordings of pour/held_out and stack/held_out were one task, held_out, and nobody said so.
TEST_F(LabelledRun, OfTwoRunsWhoseTaskOfOneNameIsToldOtherwiseItIsSaid) {
  Store other = Store::CreateOrContinue(
      folder_ / "other", {.suite_text = "suite: test\n", .suite_hash = "o", .suite_path = "", .evac_version = "0"});
  FillIn(other, 24, "Stack the cups.");
  LabelledRuns options = Options();
  options.runs = {folder_ / "run", folder_ / "other"};
  Read(options);
  ASSERT_EQ(said_.size(), 1U);
  EXPECT_THAT(said_.front(), AllOf(HasSubstr("warning: task carry is '' in " + (folder_ / "run").string()),
                                   HasSubstr("and 'Stack the cups.' in " + (folder_ / "other").string())));
}

/// Each row of judged.csv said recording 0, and which clips the judge takes wrongly could not be looked at.
TEST_F(LabelledRun, EachRowSaysTheRunAndTheEpisodeThatItsClipIsOf) {
  const LabelledClips clips = Read(Options());
  const auto rows = [](const JudgeClipSource& source) {
    const JudgedClips judged{"hold-out", "recorded", &source.clips, std::vector<double>(source.clips.size(), 1)};
    return JudgedCsv({judged}, ClassifierCard{}, source.tasks);
  };
  const std::string all = rows(*clips.learn) + rows(*clips.holdout);
  const std::string run = (folder_ / "run").string();
  EXPECT_THAT(all, HasSubstr("hold-out,recorded,carry," + run + "/real/carry/p@1/5-0003-s1,carry/5-0003,,,1,"));
  EXPECT_THAT(all, HasSubstr("hold-out,recorded,carry," + run + "/real/carry/p@2/5-0003-s1,carry/5-0003,,,0,"));
}

TEST_F(LabelledRun, BecomesAClassifierThatJudgesOthersAndNotWhatItLearnedFrom) {
  const LabelledClips clips = Read(Options());
  JudgeTrainingOptions options;
  options.batch = 8;
  options.calibration = 0.3;
  options.job.trainer.steps = 120;
  options.job.trainer.learning_rate = 2e-3;
  options.job.trainer.clip_norm = 1;
  options.job.trainer.holdout_every = 60;
  train::JobPlace place;
  place.out = folder_ / "judge";
  TrainJudge(place, options, {*clips.learn, *clips.holdout});
  const std::filesystem::path weights = folder_ / "judge" / "judge.safetensors";
  const WeightFile file(weights, "evac-classifier 1");
  EXPECT_GT(file.Number("kappa"), 0.8);
  EXPECT_FALSE(file.card().contains("kappa_masked")) << "nobody knows where the object is";

  ClassifierJudge judge(weights, folder_ / "run");
  JudgeEpisodes(judge, store_, {});
  std::size_t refused = 0, judged = 0;
  for (const Verdict& verdict : store_.Verdicts()) {
    if (verdict.judge != judge.Name()) continue;
    refused += verdict.label == Label::kInvalid && verdict.reason.find("learned from this clip") != std::string::npos;
    judged += verdict.label != Label::kInvalid;
  }
  EXPECT_EQ(refused, clips.learn->clips.size());
  EXPECT_EQ(judged, clips.holdout->clips.size() + 2) << "and the two that nobody had judged";
}

TEST_F(LabelledRun, WithTooFewLabelsOfOneKindIsRefusedWithTheirNumbers) {
  LabelledRuns options = Options();
  options.least = 35;
  EXPECT_THAT([&] { Read(options); }, ThrowsMessage<Error>(HasSubstr("wanted at least 35 of each")));
  options = Options();
  options.truth = "nobody";
  EXPECT_THAT([&] { Read(options); }, ThrowsMessage<Error>(HasSubstr("success or failure by 'nobody'")));
  options = Options();
  options.worlds = {"evac"};
  EXPECT_THAT([&] { Read(options); }, ThrowsMessage<Error>(HasSubstr("no clip")));
}

/// It learned for hours, measured "AUROC nan", wrote that on the card and ended with 0.
TEST_F(LabelledRun, WithNothingOrOneKindAloneToMeasureWithIsRefusedBeforeItLearns) {
  LabelledRuns options = Options();
  options.holdout = 1e-9;
  EXPECT_THAT([&] { Read(options); },
              ThrowsMessage<Error>(HasSubstr("0 successes and 0 failures in 0 of 39 initial states with a label")));
  const LabelledClips clips = Read(Options());
  std::set<std::string> held_out;
  for (const PackedClip& clip : clips.holdout->clips) held_out.insert(clip.state);
  const auto verdicts = store_.CurrentVerdicts();
  for (const Episode& episode : store_.Episodes()) {  // "hopeful" has seen no failure in any of these states
    const auto said = verdicts.find(episode.key.Id());
    if (said == verdicts.end()) continue;
    Verdict verdict = said->second.at("people");
    verdict.judge = "hopeful";
    const bool is_held_out = held_out.contains("carry/" + episode.key.pair.initial_state);
    if (!is_held_out || verdict.label == Label::kSuccess) store_.AddVerdict(verdict);
  }
  options = Options();
  options.truth = "hopeful";
  const std::string counts = fmt::format("{0} successes and 0 failures in {0} of 39 initial states", held_out.size());
  EXPECT_THAT([&] { Read(options); }, ThrowsMessage<Error>(HasSubstr(counts)));
}

/// A name with a slip in it was a world without clips, beside another one that was learned from alone.
TEST_F(LabelledRun, AWorldThatNoRunHasIsRefusedWithThoseThatThereAre) {
  LabelledRuns options = Options();
  options.worlds = {"real", "sym"};
  EXPECT_THAT([&] { Read(options); },
              ThrowsMessage<Error>(HasSubstr("--worlds: no clip is of world 'sym', wanted some of: real")));
}

TEST_F(LabelledRun, AClipThatCannotBeReadIsLeftOutAndNamed) {
  const std::filesystem::path video = folder_ / "run" / store_.Episodes().front().video;
  std::filesystem::resize_file(video, 300);
  const LabelledClips clips = Read(Options());
  EXPECT_EQ(clips.learn->clips.size() + clips.holdout->clips.size(), 2U * (kStates - 1) - 1);
  ASSERT_EQ(said_.size(), 1U);
  EXPECT_THAT(said_, Each(HasSubstr("left out: ")));
  EXPECT_THAT(said_, Each(HasSubstr(video.filename().string())));
}

}  // namespace
}  // namespace evac
