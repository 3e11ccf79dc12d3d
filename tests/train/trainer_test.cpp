#include "worldmodel/train/trainer.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <array>
#include <atomic>
#include <cmath>
#include <fstream>
#include <iterator>

#include "tests/support/temp_folder.h"
#include "tests/train/regression.h"
#include "worldmodel/train/curves.h"

namespace evac::train {
namespace {

Tensor Line(std::int64_t count, double from, double to) {
  return at::arange(count, at::kFloat) * ((to - from) / static_cast<double>(count - 1)) + from;
}

/// AdamW as its paper writes it, in double, one number.
struct WrittenOut {
  double w, m = 0, v = 0;
  void Step(double gradient, int t, const AdamWOptions& o, double rate) {
    m = o.beta1 * m + (1 - o.beta1) * gradient;
    v = o.beta2 * v + (1 - o.beta2) * gradient * gradient;
    const double m_hat = m / (1 - std::pow(o.beta1, t)), v_hat = v / (1 - std::pow(o.beta2, t));
    w = w - rate * o.weight_decay * w - rate * m_hat / (std::sqrt(v_hat) + o.epsilon);
  }
};

TEST(AdamW, TakesTheStepsThatItsPaperWrites) {
  const AdamWOptions options{.beta1 = 0.8, .beta2 = 0.95, .epsilon = 1e-6, .weight_decay = 0.1};
  AdamWState state{Line(5, -2, 2), at::zeros({5}), at::zeros({5}), at::zeros({5}), {}};
  std::vector<WrittenOut> wanted;
  for (int i = 0; i < 5; ++i) wanted.push_back({state.values[i].item<double>()});
  for (int t = 1; t <= 20; ++t) {
    for (int i = 0; i < 5; ++i) {
      const double gradient = std::sin(t * 1.3 + i) * (i + 1);
      state.gradients[i] = gradient;
      wanted[static_cast<std::size_t>(i)].Step(gradient * 0.5, t, options, 0.01 * t);
    }
    StepAdamW(state, options, {t - 1, 0.01 * t, 0.5, 0});
  }
  for (int i = 0; i < 5; ++i) EXPECT_NEAR(state.values[i].item<double>(), wanted[static_cast<std::size_t>(i)].w, 2e-6);
  EXPECT_EQ(state.gradients.abs().max().item<double>(), 0) << "gradients are ready for the next step";
}

TEST(AdamW, TheAverageFollowsTheValues) {
  AdamWState state{at::full({3}, 1.0), at::zeros({3}), at::zeros({3}), at::zeros({3}), at::zeros({3})};
  AdamWOptions still;
  still.weight_decay = 0;
  StepAdamW(state, still, {0, 0.1, 1, 0.75});
  EXPECT_NEAR(state.average[0].item<double>(), 0.25, 1e-6);
}

TEST(Norm, IsThatOfAllNumbers) {
  const Tensor flat = Line(100'000, -3, 3);
  EXPECT_NEAR(Norm(flat), flat.to(at::kDouble).norm().item<double>(), 1e-6);
}

TEST(LearningRate, RisesStaysAndFallsToNothing) {
  TrainerOptions options;
  options.learning_rate = 2;
  options.warmup_steps = 4;
  options.decay_from = 0.5;
  EXPECT_DOUBLE_EQ(LearningRateAt(options, 0, 100), 0.5);
  EXPECT_DOUBLE_EQ(LearningRateAt(options, 3, 100), 2);
  EXPECT_DOUBLE_EQ(LearningRateAt(options, 50, 100), 2);
  EXPECT_DOUBLE_EQ(LearningRateAt(options, 75, 100), 1);
  EXPECT_NEAR(LearningRateAt(options, 99, 100), 0.04, 1e-12);
}

TEST(Dice, EveryDrawIsAFunctionOfItsPlace) {
  Dice one({7, 3, 0, 0}, 1), same({7, 3, 0, 0.5}, 1), later({7, 4, 0, 0}, 1), other({7, 3, 0, 0}, 2), part({7, 3, 1, 0}, 1);
  const double first = one.Uniform();
  EXPECT_EQ(first, same.Uniform());
  EXPECT_NE(first, later.Uniform());
  EXPECT_NE(first, other.Uniform());
  EXPECT_NE(first, part.Uniform());
  EXPECT_TRUE(at::equal(one.Normal({5}), same.Normal({5})));
  EXPECT_FALSE(at::equal(one.Normal({5}), one.Normal({5}))) << "two draws in a row are two";
}

TEST(Dice, IsFair) {
  Dice dice({1, 0, 0, 0}, 5);
  std::array<int, 4> counts{};
  for (int i = 0; i < 4000; ++i) ++counts[static_cast<std::size_t>(dice.Below(4))];
  for (const int count : counts) EXPECT_NEAR(count, 1000, 120);
  EXPECT_NEAR(dice.Normal({10000}).std().item<double>(), 1, 0.03);
}

TEST(Trainer, LearnsWhatTheLossSays) {
  const TempFolder folder;
  Regression regression;
  Trainer trainer(regression.Parameters(), QuickTrainer(400), folder.path());
  const TrainerSummary summary = trainer.Run({.loss = [&](const StepPlace& place) { return regression.Loss(place); }});
  EXPECT_EQ(summary.why, "done");
  EXPECT_NEAR(regression.weight[1].item<double>(), -2, 0.05);
  EXPECT_NEAR(regression.bias[0].item<double>(), 3, 0.05);
}

std::size_t Occurrences(const std::string& text, const std::string& part) {
  std::size_t count = 0;
  for (std::size_t at = text.find(part); at != std::string::npos; at = text.find(part, at + 1)) ++count;
  return count;
}

TEST(Trainer, DrawsHowItWent) {
  const TempFolder folder;
  Regression regression;
  TrainerOptions options = QuickTrainer(60);
  options.holdout_every = 20;
  double score = 4;
  Trainer(regression.Parameters(), options, folder.path())
      .Run({.loss = [&](const StepPlace& place) { return regression.Loss(place); },
            .holdout = [&] { return score = score == 2 ? 3 : score - 1; }});
  std::ifstream file(folder / "curves.svg");
  const std::string svg{std::istreambuf_iterator<char>(file), {}};
  EXPECT_EQ(svg, CurvesSvg(folder.path()));
  EXPECT_NE(svg.find("best 2 at step 40"), std::string::npos);
  EXPECT_EQ(Occurrences(svg, "r=\"2\""), 3U) << "a dot for each hold-out";
  EXPECT_EQ(Occurrences(svg, "nan"), 0U);
  EXPECT_EQ(Occurrences(svg, "inf"), 0U);
}

TEST(Curves, OfNothingOrOfOneNumberAreStillAPicture) {
  const TempFolder folder;
  EXPECT_NE(CurvesSvg(folder.path()).find("</svg>"), std::string::npos);
  std::ofstream(folder / "metrics.csv") << "step,loss\n0,nan\n1,-3\nrubbish\n";
  const std::string svg = CurvesSvg(folder.path());
  EXPECT_NE(svg.find("loss, by step"), std::string::npos);
  EXPECT_EQ(Occurrences(svg, "nan"), 0U);
}

TEST(Curves, ARowOfAStepBelowZeroIsLeftOut) {
  const TempFolder folder;
  std::ofstream(folder / "metrics.csv") << "step,loss\n1,3\n20,2\n";
  const std::string svg = CurvesSvg(folder.path());
  std::ofstream(folder / "metrics.csv", std::ios::app) << "-5,4\n";
  EXPECT_EQ(CurvesSvg(folder.path()), svg);
}

TEST(Trainer, GoesOnAfterAnyKillAsIfNothingHadHappened) {
  const TempFolder whole_folder, killed_folder;
  Regression whole;
  Trainer(whole.Parameters(), QuickTrainer(60), whole_folder.path()).Run({.loss = [&](const StepPlace& p) { return whole.Loss(p); }});
  struct Killed {};
  Tensor last;
  std::int64_t reached = 0;
  for (const std::int64_t kill_at : {7, 20, 21, 59, 1000}) {
    Regression killed;  // as a new process: nothing is left but the folder
    TrainerOptions options = QuickTrainer(60);
    options.checkpoint_every_s = 0;
    Trainer trainer(killed.Parameters(), options, killed_folder.path());
    EXPECT_EQ(trainer.step(), reached) << "what was done before is not done again";
    reached = kill_at;
    try {
      trainer.Run({.loss = [&](const StepPlace& place) {
        if (place.step == kill_at) throw Killed();
        return killed.Loss(place);
      }});
    } catch (const Killed&) {
    }
    last = killed.All();
  }
  EXPECT_TRUE(at::equal(last, whole.All()));
}

std::string Text(const std::filesystem::path& path) {
  std::ifstream file(path);
  return {std::istreambuf_iterator<char>(file), {}};
}

/// It was cut to its header.
TEST(Trainer, RefusesATableOfSomebodysWhereNothingWasTrainedYet) {
  for (const char* name : {"metrics.csv", "holdout.csv"}) {
    const TempFolder folder;
    std::ofstream(folder / name) << "week,sales\n1,2\n";
    Regression regression;
    EXPECT_THAT([&] { Trainer(regression.Parameters(), QuickTrainer(10), folder.path()); },
                testing::ThrowsMessage<TensorError>(testing::HasSubstr((folder / name).string())));
    EXPECT_EQ(Text(folder / name), "week,sales\n1,2\n");
  }
}

/// Whose checkpoint was thrown away or lost: a new training cut it to its header.
TEST(Trainer, RefusesATableOfATrainingWhoseCheckpointIsGone) {
  TrainerOptions options = QuickTrainer(4);
  options.holdout_every = 2;
  for (const auto& [name, other] : {std::pair("metrics.csv", "holdout.csv"), std::pair("holdout.csv", "metrics.csv")}) {
    const TempFolder folder;
    Regression trained, refused, anew;
    Trainer(trained.Parameters(), options, folder.path())
        .Run({.loss = [&](const StepPlace& place) { return trained.Loss(place); }, .holdout = [] { return 1.0; }});
    for (const char* gone : {"training.safetensors", other}) ASSERT_TRUE(std::filesystem::remove(folder / gone));
    const std::string table = (folder / name).string(), rows = Text(table);
    EXPECT_THAT([&] { Trainer(refused.Parameters(), options, folder.path()); },
                testing::ThrowsMessage<TensorError>(
                    testing::AllOf(testing::HasSubstr(table), testing::HasSubstr("move it away to begin anew"))));
    EXPECT_EQ(Text(table), rows);
    std::filesystem::rename(table, folder / "kept.csv");
    EXPECT_EQ(Trainer(anew.Parameters(), options, folder.path()).step(), 0);
  }
}

TEST(Trainer, GoesOnFromItsTablesWhereItWasKilledBeforeItsFirstCheckpoint) {
  const TempFolder folder;
  struct Killed {};
  TrainerOptions options = QuickTrainer(10);
  options.checkpoint_every_s = 1e9;
  Regression killed;
  EXPECT_THROW(Trainer(killed.Parameters(), options, folder.path()).Run({.loss = [&](const StepPlace& place) {
                 if (place.step == 3) throw Killed();
                 return killed.Loss(place);
               }}),
               Killed);
  ASSERT_FALSE(std::filesystem::exists(folder / "training.safetensors"));
  ASSERT_THAT(Text(folder / "metrics.csv"), testing::HasSubstr("\n2,"));
  std::ofstream(folder / "holdout.csv") << "";  // of a power cut
  Regression regression;
  Trainer(regression.Parameters(), QuickTrainer(10), folder.path());
  EXPECT_EQ(Text(folder / "metrics.csv"), "step,loss,learning_rate,gradient_norm,seconds\n");
  EXPECT_EQ(Text(folder / "holdout.csv"), "step,holdout\n");
}

TEST(Trainer, KeepsTheBestOfTheHoldoutAndStopsWhenItGetsNoBetter) {
  const TempFolder folder;
  Regression regression;
  TrainerOptions options = QuickTrainer(1000);
  options.holdout_every = 10;
  options.patience = 3;
  int asked = 0;
  Tensor at_best;
  Trainer trainer(regression.Parameters(), options, folder.path());
  const TrainerSummary summary = trainer.Run({.loss = [&](const StepPlace& place) { return regression.Loss(place); },
                                              .holdout =
                                                  [&] {
                                                    if (++asked == 4) at_best = regression.All();
                                                    return std::abs(asked - 4.0);
                                                  }});
  EXPECT_EQ(summary.best_step, 40);
  EXPECT_EQ(summary.step, 70);
  EXPECT_EQ(summary.why, "no better for 3 hold-outs");
  const Tensor before = regression.All();
  trainer.WithBest([&] { EXPECT_TRUE(at::equal(regression.All(), at_best)); });
  EXPECT_TRUE(at::equal(regression.All(), before)) << "the weights in training are put back";
  EXPECT_THAT(Text(folder / "holdout.csv"), testing::HasSubstr("\n40,0\n"));
}

TEST(Trainer, StopsWhenAskedToAndSavesWhatItHas) {
  const TempFolder folder;
  Regression regression;
  Trainer trainer(regression.Parameters(), QuickTrainer(100), folder.path());
  const TrainerSummary summary = trainer.Run({.loss = [&](const StepPlace& place) { return regression.Loss(place); },
                                              .interrupted = [&] { return trainer.step() >= 12; }});
  EXPECT_EQ(summary.why, "interrupted");
  Regression again;
  EXPECT_EQ(Trainer(again.Parameters(), QuickTrainer(100), folder.path()).step(), 12);
}

TEST(Trainer, AccumulatedPartsAreOneStepOfTheirMean) {
  const TempFolder one, two;
  Regression whole, parts;
  const auto data = [](const Regression& r, const StepPlace& place) { return r.Loss({place.seed, place.step, 0, 0}); };
  TrainerOptions options = QuickTrainer(5);
  Trainer(whole.Parameters(), options, one.path()).Run({.loss = [&](const StepPlace& p) { return data(whole, p); }});
  options.accumulate = 2;
  Trainer(parts.Parameters(), options, two.path()).Run({.loss = [&](const StepPlace& p) { return data(parts, p); }});
  EXPECT_TRUE(at::allclose(whole.All(), parts.All(), 1e-5, 1e-6));
}

TEST(Trainer, PartsOfAStepSideBySideAreThoseOneAfterTheOther) {
  const TempFolder one, two;
  TrainerOptions options = QuickTrainer(20);
  options.accumulate = 2;
  Regression alone, first, second;
  Trainer(alone.Parameters(), options, one.path()).Run({.loss = [&](const StepPlace& p) { return alone.Loss(p); }});
  Trainer both(first.Parameters(), options, two.path());
  std::atomic<int> by_replica = 0;
  both.AddReplica({second.Parameters(), [&](const StepPlace& p) {
                     ++by_replica;
                     return second.Loss(p);
                   }});
  both.Run({.loss = [&](const StepPlace& p) { return first.Loss(p); }});
  EXPECT_EQ(by_replica, 20);
  EXPECT_TRUE(at::equal(alone.All(), first.All()));
  EXPECT_TRUE(at::equal(first.All(), second.All())) << "they share one vector of values";
}

TEST(Trainer, ReplicasOfOtherParametersAreRefused) {
  const TempFolder folder;
  Regression regression;
  Trainer trainer(regression.Parameters(), QuickTrainer(3), folder.path());
  EXPECT_THROW(trainer.AddReplica({{{"weight", at::zeros({3, 1})}}, {}}), TensorError);
}

TEST(Trainer, RefusesTheCheckpointOfAnotherTraining) {
  const TempFolder folder;
  Regression regression;
  Trainer(regression.Parameters(), QuickTrainer(3), folder.path()).Run({.loss = [&](const StepPlace& p) { return regression.Loss(p); }});
  TrainerOptions other = QuickTrainer(3);
  other.learning_rate = 0.1;
  Regression again;
  using testing::HasSubstr;
  using testing::ThrowsMessage;
  EXPECT_THAT([&] { Trainer(again.Parameters(), other, folder.path()); },
              ThrowsMessage<TensorError>(
                  HasSubstr("is a training with other options: learning_rate is 0.05 there, 0.1 here: another folder")));
  EXPECT_THAT([&] { Trainer({{"weight", at::zeros({3, 1})}}, QuickTrainer(3), folder.path()); },
              ThrowsMessage<TensorError>(HasSubstr("is a training of other parameters")));
}

TEST(Trainer, AStepWhoseLossIsNotFiniteMovesNothing) {
  const TempFolder folder;
  Regression regression;
  Trainer trainer(regression.Parameters(), QuickTrainer(30), folder.path());
  std::vector<Tensor> before;  // each step
  trainer.Run({.loss = [&](const StepPlace& place) {
    before.push_back(regression.All());
    const Tensor loss = regression.Loss(place);
    return place.step % 3 == 1 ? loss / 0.0 : loss;
  }});
  ASSERT_EQ(before.size(), 30U);
  for (std::size_t step = 0; step + 1 < before.size(); ++step)
    EXPECT_EQ(at::equal(before[step + 1], before[step]), step % 3 == 1) << step;
  TrainerOptions hopeless = QuickTrainer(200);
  const TempFolder other;
  Regression second;
  Trainer in_vain(second.Parameters(), hopeless, other.path());
  EXPECT_THAT([&] { in_vain.Run({.loss = [&](const StepPlace& place) { return second.Loss(place) / 0.0; }}); },
              testing::ThrowsMessage<TensorError>(testing::HasSubstr("loss or gradient is not finite for ")));
}

TEST(Trainer, CountsTheStepsThatFitIntoTheMinutesOnceAndKeepsThem) {
  const TempFolder folder;
  TrainerOptions options = QuickTrainer(100000);
  options.minutes = 0.01;
  Regression first;
  Trainer trainer(first.Parameters(), options, folder.path());
  const TrainerSummary summary = trainer.Run({.loss = [&](const StepPlace& place) { return first.Loss(place); }});
  EXPECT_EQ(summary.step, summary.steps);
  EXPECT_LT(summary.steps, 100000);
  Regression again;
  const TrainerSummary same = Trainer(again.Parameters(), options, folder.path()).Run({.loss = [&](const StepPlace& p) { return again.Loss(p); }});
  EXPECT_EQ(same.steps, summary.steps);
  EXPECT_TRUE(at::equal(first.All(), again.All()));
}

/// Steps of two minutes took eighteen of five: nine were done whatever they took, and four were not counted.
TEST(Trainer, AStepThatWouldEndBehindTheMinutesIsNotBegunAndAKillChangesNothingOfThat) {
  TrainerOptions options = QuickTrainer(100000);
  options.minutes = 5;
  const auto train = [&](const TempFolder& at, double step_s, Regression& regression) {
    double now_s = 1000;
    return Trainer(regression.Parameters(), options, at.path())
        .Run({.loss =
                  [&](const StepPlace& place) {
                    now_s += step_s;
                    return regression.Loss(place);
                  },
              .clock_s = [&] { return now_s; }});
  };
  for (const auto& [step_s, steps] : {std::pair(600, 1), std::pair(151, 1), std::pair(120, 2), std::pair(40, 7),
                                      std::pair(30, 10), std::pair(1, 300)}) {
    const TempFolder folder;
    Regression first, again;
    const TrainerSummary summary = train(folder, step_s, first);
    EXPECT_EQ(summary.why, "done") << step_s;
    EXPECT_EQ(summary.step, steps) << step_s;
    EXPECT_EQ(summary.steps, steps) << step_s;
    EXPECT_EQ(train(folder, 1, again).steps_now, 0) << "the plan stands, however fast it goes on: " << step_s;
    EXPECT_TRUE(at::equal(first.All(), again.All())) << step_s;
  }
}

TEST(Trainer, InterruptedBeforeItsMinutesArePlannedDoesNotSayThePagesSteps) {
  const TempFolder folder;
  TrainerOptions options = QuickTrainer(1300);
  options.minutes = 60;
  Regression regression;
  const TrainerSummary summary =
      Trainer(regression.Parameters(), options, folder.path())
          .Run({.loss = [&](const StepPlace& place) { return regression.Loss(place); },
                .interrupted = [asked = 0]() mutable { return ++asked > 1; }});
  EXPECT_EQ(summary.step, 1);
  EXPECT_EQ(summary.steps, 0);
}

TEST(Trainer, OtherMinutesThanItIsPlannedForAreRefusedAndMoreStepsGoOn) {
  const TempFolder folder, by_steps;
  TrainerOptions options = QuickTrainer(100000);
  options.minutes = 0.01;
  const auto train = [](const TrainerOptions& given, const TempFolder& at) {
    Regression regression;
    return Trainer(regression.Parameters(), given, at.path()).Run({.loss = [&](const StepPlace& place) {
      return regression.Loss(place);
    }});
  };
  const TrainerSummary first = train(options, folder);
  EXPECT_EQ(first.steps_now, first.steps);
  EXPECT_EQ(train(options, folder).steps_now, 0);
  const std::string steps = std::to_string(first.steps), planned = "is planned for " + steps + " steps and has done " + steps;
  options.minutes = 0.02;
  EXPECT_THAT([&] { train(options, folder); }, testing::ThrowsMessage<TensorError>(testing::HasSubstr(planned)));
  options.minutes = 0;
  options.steps = first.steps + 3;
  EXPECT_EQ(train(options, folder).steps_now, 3);

  train(QuickTrainer(5), by_steps);
  options.minutes = 0.01;
  EXPECT_THAT([&] { train(options, by_steps); },
              testing::ThrowsMessage<TensorError>(testing::HasSubstr("is planned for 5 steps and has done 5")));
}

TEST(Trainer, AStepThatIsToBeKeptIsNotBehindTheLast) {
  const auto kept = [](const TrainerOptions& options, const std::vector<std::int64_t>& steps) {
    const TempFolder folder;
    Regression regression;
    std::vector<std::int64_t> found;
    Trainer(regression.Parameters(), options, folder.path())
        .Run({.loss = [&](const StepPlace& place) { return regression.Loss(place); },
              .keep_steps = steps,
              .keep = [&](std::int64_t step) { found.push_back(step); }});
    return found;
  };
  EXPECT_THAT(kept(QuickTrainer(10), {4, 10}), testing::ElementsAre(4, 10));
  EXPECT_THAT([&] { kept(QuickTrainer(10), {4, 11}); },
              testing::ThrowsMessage<TensorError>(testing::HasSubstr("step 11 is to be kept, wanted 1 to 10")));
  EXPECT_THROW(kept(QuickTrainer(10), {0}), TensorError);
  TrainerOptions by_minutes = QuickTrainer(10);
  by_minutes.minutes = 0.01;
  EXPECT_THROW(kept(by_minutes, {1'000'000'000}), TensorError) << "as soon as it is planned";
}

TEST(Trainer, TheSmoothedLossOutlivesStepsWhoseLossIsNotFinite) {
  const TempFolder folder;
  Regression regression;
  std::vector<double> said;
  Trainer(regression.Parameters(), QuickTrainer(6), folder.path())
      .Run({.loss =
                [&](const StepPlace& place) {
                  const Tensor loss = regression.Loss(place);
                  return place.step == 0 || place.step == 3 ? loss / 0.0 : loss;
                },
            .on_progress = [&](const TrainerProgress& progress) { said.push_back(progress.loss); }});
  ASSERT_EQ(said.size(), 6U);
  EXPECT_FALSE(std::isfinite(said[0])) << "there is no other yet";
  for (std::size_t i = 1; i < said.size(); ++i) EXPECT_TRUE(std::isfinite(said[i])) << i;
  EXPECT_EQ(said[3], said[2]);
  EXPECT_NE(said[4], said[3]);
}

TEST(Trainer, AFiniteHoldoutIsBetterThanOneThatIsNone) {
  const TempFolder folder;
  Regression regression;
  TrainerOptions options = QuickTrainer(4);
  options.holdout_every = 1;
  std::vector<double> scores = {std::nan(""), 5, std::nan(""), 7};
  std::size_t asked = 0;
  const TrainerSummary summary =
      Trainer(regression.Parameters(), options, folder.path())
          .Run({.loss = [&](const StepPlace& place) { return regression.Loss(place); },
                .holdout = [&] { return scores.at(asked++); }});
  EXPECT_EQ(summary.best, 5);
  EXPECT_EQ(summary.best_step, 2);
}

}  // namespace
}  // namespace evac::train
