#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <functional>
#include <iterator>
#include <string>
#include <utility>
#include <vector>

#include "tests/support/temp_folder.h"
#include "tests/train/regression.h"
#include "worldmodel/train/trainer.h"

/// Numbers that are none, or not yet known, and options that make no training.
namespace evac::train {
namespace {

TEST(Trainer, HoldoutsThatAreNoNumbersAreNobodysBest) {
  struct Ended {
    TrainerSummary summary;
    Tensor measured, shown;  ///< the weights of the last hold-out, and those that are exported
  };
  const auto run = [](const TempFolder& folder, std::int64_t until) {
    Regression regression;
    TrainerOptions options = QuickTrainer(9);
    options.holdout_every = 3;
    Ended ended;
    Trainer trainer(regression.Parameters(), options, folder.path());
    ended.summary = trainer.Run({.loss = [&](const StepPlace& place) { return regression.Loss(place); },
                                 .holdout =
                                     [&] {
                                       ended.measured = regression.All();
                                       return std::nan("");
                                     },
                                 .interrupted = [&] { return trainer.step() >= until; }});
    trainer.WithBest([&] { ended.shown = regression.All(); });
    return ended;
  };
  const TempFolder whole_folder, killed_folder;
  const Ended whole = run(whole_folder, 1000);
  EXPECT_EQ(whole.summary.why, "done");
  EXPECT_FALSE(whole.summary.best);
  EXPECT_EQ(whole.summary.holdouts_since_best, 3);
  EXPECT_TRUE(at::equal(whole.shown, whole.measured)) << "the averaged of the last step, not of the first hold-out";
  run(killed_folder, 4);
  const Ended killed = run(killed_folder, 1000);
  EXPECT_EQ(killed.summary.steps_now, 5);
  EXPECT_FALSE(killed.summary.best);
  EXPECT_EQ(killed.summary.holdouts_since_best, 3) << "that before the kill counts";
  EXPECT_TRUE(at::equal(whole.shown, killed.shown));
}

/// As earlier versions wrote them: a best that is no number, and no word of steps left out.
TEST(Trainer, ABestOfAnEarlierVersionThatIsNoNumberIsNone) {
  const TempFolder folder;
  const std::filesystem::path path = folder / "training.safetensors";
  const auto run = [&](std::int64_t steps, double score) {
    Regression regression;
    TrainerOptions options = QuickTrainer(steps);
    options.holdout_every = 2;
    return Trainer(regression.Parameters(), options, folder.path())
        .Run({.loss = [&](const StepPlace& place) { return regression.Loss(place); }, .holdout = [&] { return score; }});
  };
  ASSERT_EQ(run(2, 7).best, 7);
  {
    const TensorFile file = TensorFile::Open(path);
    TensorMetadata metadata = file.metadata();
    metadata["best_score"] = "nan";
    metadata.erase("left_out");
    WriteTensorFile(folder / "earlier.safetensors", file.tensors(), metadata);
  }
  std::filesystem::rename(folder / "earlier.safetensors", path);
  EXPECT_FALSE(run(2, 7).best) << "it is done, and has none";
  const TrainerSummary summary = run(4, 9);
  EXPECT_EQ(summary.best, 9);
  EXPECT_EQ(summary.best_step, 4);
  EXPECT_EQ(summary.left_out, 0);
}

TEST(Trainer, PatienceEndsATrainingWhoseHoldoutsAreNoNumbersAfterAnyKill) {
  const TempFolder folder;
  TrainerOptions options = QuickTrainer(100);
  options.holdout_every = 2;
  options.patience = 3;
  const auto run = [&](std::int64_t until) {
    Regression regression;
    Trainer trainer(regression.Parameters(), options, folder.path());
    return trainer.Run({.loss = [&](const StepPlace& place) { return regression.Loss(place); },
                        .holdout = [] { return std::nan(""); },
                        .interrupted = [&] { return trainer.step() >= until; }});
  };
  EXPECT_EQ(run(4).why, "interrupted");
  const TrainerSummary summary = run(1000);
  EXPECT_EQ(summary.why, "no better for 3 hold-outs");
  EXPECT_EQ(summary.step, 6);
}

/// Every third step of 30 moves nothing, whatever the process that did it.
TEST(Trainer, StepsThatAreLeftOutAreCountedAndTold) {
  const TempFolder folder;
  const auto run = [&](std::int64_t until) {
    Regression regression;
    std::string line;
    Trainer trainer(regression.Parameters(), QuickTrainer(30), folder.path());
    const TrainerSummary summary = trainer.Run({.loss =
                                                    [&](const StepPlace& place) {
                                                      const Tensor loss = regression.Loss(place);
                                                      return place.step % 3 == 1 ? loss * std::nan("") : loss;
                                                    },
                                                .interrupted = [&] { return trainer.step() >= until; },
                                                .on_progress = [&](const TrainerProgress& at) { line = at.Line(); }});
    return std::pair(summary.left_out, line);
  };
  EXPECT_EQ(run(1).first, 0);
  EXPECT_EQ(run(11).first, 4);
  const auto [left_out, line] = run(1000);
  EXPECT_EQ(left_out, 10);
  EXPECT_THAT(line, testing::HasSubstr(", 10 left out: not finite"));
}

TEST(Trainer, AHundredStepsLeftOutInARowBlameDataToo) {
  const TempFolder folder;
  Regression regression;
  Trainer trainer(regression.Parameters(), QuickTrainer(200), folder.path());
  EXPECT_THAT([&] { trainer.Run({.loss = [&](const StepPlace& p) { return regression.Loss(p) * std::nan(""); }}); },
              testing::ThrowsMessage<TensorError>(testing::AllOf(testing::HasSubstr("100 steps in a row, at step 99"),
                                                                 testing::HasSubstr("the data hold what is no number"),
                                                                 testing::HasSubstr("learning_rate"))));
}

TEST(Trainer, BeforeMinutesArePlannedThePagesStepsMeanNothing) {
  const TempFolder folder;
  Regression regression;
  TrainerOptions options = QuickTrainer(5);
  options.minutes = 0.01;
  options.warmup_steps = 2;
  std::int64_t planned_after = 0;
  double most_done = 0, now_s = 0;
  Trainer(regression.Parameters(), options, folder.path())
      .Run({.loss =
                [&](const StepPlace& place) {
                  if (planned_after == 0) most_done = std::max(most_done, place.done);
                  now_s += 0.01;
                  return regression.Loss(place);
                },
            .on_progress =
                [&](const TrainerProgress& at) {
                  if (planned_after == 0 && at.steps > 0) planned_after = at.step;
                },
            .clock_s = [&] { return now_s; }});
  ASSERT_GT(planned_after, 5) << "or nothing is tested: the page says 5 steps";
  EXPECT_LT(most_done, 1e-6);
  std::ifstream rows(folder / "metrics.csv");
  std::string row;
  std::getline(rows, row);
  for (std::int64_t step = 0; step < planned_after; ++step) {
    ASSERT_TRUE(std::getline(rows, row));
    const std::size_t loss = row.find(','), rate = row.find(',', loss + 1);
    EXPECT_NEAR(std::stod(row.substr(rate + 1)), step == 0 ? 0.025 : 0.05, 1e-9) << row;
  }
}

/// The checkpoint of four steps with a best, in memory: what is written in its place does not change it.
TensorFile WholeCheckpoint(const std::filesystem::path& folder) {
  Regression regression;
  TrainerOptions options = QuickTrainer(4);
  options.holdout_every = 2;
  Trainer(regression.Parameters(), options, folder)
      .Run({.loss = [&](const StepPlace& place) { return regression.Loss(place); }, .holdout = [] { return 7.0; }});
  std::ifstream file(folder / "training.safetensors", std::ios::binary);
  return TensorFile::Parse({std::istreambuf_iterator<char>(file), {}}, "whole");
}

std::int64_t StepOf(const std::filesystem::path& folder) {
  Regression regression;
  return Trainer(regression.Parameters(), QuickTrainer(4), folder).step();
}

/// A step of "12x" was 12, one of "abc" none, one of 2^63 the end of all numbers, to which another was added.
TEST(Trainer, ACheckpointWhoseNumbersAreNoneIsRefusedByName) {
  const TempFolder folder;
  const TensorFile whole = WholeCheckpoint(folder.path());
  const std::string path = (folder / "training.safetensors").string();
  const auto write = [&](const char* key, const std::string& value) {
    TensorMetadata metadata = whole.metadata();
    metadata[key] = value;
    WriteTensorFile(path, whole.tensors(), metadata);
  };
  const auto refused = [&](const char* key, const std::string& value, const std::string& wanted) {
    write(key, value);
    EXPECT_THAT([&] { StepOf(folder.path()); },
                testing::ThrowsMessage<TensorError>(testing::HasSubstr(path + ": its metadata's '" + key + "' is '" +
                                                                       value + "', wanted " + wanted)));
  };
  for (const char* value : {"", "abc", "12x", " 3", "-1", "1.5", "1e3", "1099511627777", "9223372036854775808"})
    refused("step", value, "a whole number from 0 to 2^40");
  for (const char* key : {"not_finite", "left_out", "holdouts_since_best", "best_step"})
    refused(key, "-3", "a whole number from 0 to 2^40");
  for (const char* key : {"smooth_loss", "best_score"}) {
    refused(key, "", "a number");
    refused(key, "0x1p+1 or so", "a number");
  }
  for (const char* loss : {"nan", "-nan", "inf", "0x1.8p-2"}) {
    write("smooth_loss", loss);
    EXPECT_EQ(StepOf(folder.path()), 4) << loss;
  }
}

/// Of one number all weights became that number; of any other size the process ended as by its own fault.
TEST(Trainer, ABestOfAnotherSizeIsRefused) {
  const TempFolder folder;
  const TensorFile whole = WholeCheckpoint(folder.path());
  std::vector<TensorView> tensors = whole.tensors();
  const auto best = std::ranges::find(tensors, std::string("best"), &TensorView::name);
  ASSERT_NE(best, tensors.end());
  for (const std::int64_t size : {1, 3}) {
    best->shape = {size};
    best->bytes = whole.Get("best").bytes.first(best->ByteCount());
    WriteTensorFile(folder / "training.safetensors", tensors, whole.metadata());
    EXPECT_THAT([&] { StepOf(folder.path()); },
                testing::ThrowsMessage<TensorError>(
                    testing::HasSubstr("training.safetensors: best is [" + std::to_string(size) + "], wanted [4]")));
  }
}

TEST(Trainer, OptionsThatDoNothingOrAreNoNumberAreRefused) {
  const auto refused = [](const std::function<void(TrainerOptions&)>& change, const std::string& complaint) {
    const TempFolder folder;
    Regression regression;
    TrainerOptions options = QuickTrainer(3);
    change(options);
    EXPECT_THAT([&] { Trainer(regression.Parameters(), options, folder / "out"); },
                testing::ThrowsMessage<TensorError>(testing::HasSubstr(complaint)));
    EXPECT_FALSE(std::filesystem::exists(folder / "out"));
  };
  refused([](TrainerOptions& o) { o.patience = 3; }, "patience is 3.000000, wanted 0 where holdout_every is 0");
  refused([](TrainerOptions& o) { o.patience = -1; }, "patience is -1.000000, wanted at least 0");
  refused([](TrainerOptions& o) { o.holdout_every = -1; }, "holdout_every is -1.000000, wanted at least 0");
  refused([](TrainerOptions& o) { o.warmup_steps = -1; }, "warmup_steps is -1.000000, wanted at least 0");
  refused([](TrainerOptions& o) { o.clip_norm = std::nan(""); }, "clip_norm is nan, wanted at least 0");
  refused([](TrainerOptions& o) { o.clip_norm = -1; }, "clip_norm is -1.000000, wanted at least 0");
  refused([](TrainerOptions& o) { o.adamw.weight_decay = -0.1; }, "weight_decay is -0.100000, wanted at least 0");
  refused([](TrainerOptions& o) { o.adamw.epsilon = 0; }, "epsilon is 0.000000, wanted a number above 0");
  refused([](TrainerOptions& o) { o.checkpoint_every_s = -1; }, "checkpoint_every_s is -1.000000, wanted at least 0");
}

}  // namespace
}  // namespace evac::train
