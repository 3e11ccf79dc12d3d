#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <unistd.h>

#include <functional>
#include <thread>

#include "apps/networks/packed_clips.h"
#include "apps/networks/train_arguments.h"
#include "apps/networks/training_page.h"
#include "core/file.h"
#include "core/store_lock.h"
#include "core/version.h"
#include "tests/apps/train_command.h"
#include "tests/support/command.h"
#include "worldmodel/evac_config.h"
#include "worldmodel/nn/weights.h"

/// What `evac train` and `evac judge train` take and refuse, before and when they go on.
namespace evac {
namespace {

using testing::AllOf;
using testing::HasSubstr;
using testing::Not;
using testing::ThrowsMessage;

TEST_F(TrainCommand, GoesOnWithTheSamePageAndFilesAlone) {
  TrainCodec();
  const std::string codec = Path("codec/codec.safetensors");
  const auto refused = ThrowsMessage<TensorError>(HasSubstr("is a training with other options"));
  EXPECT_THAT([&] { TrainCodec({"--init", codec}); }, refused);
  const std::string more = std::to_string(std::thread::hardware_concurrency() + 1);
  EXPECT_THAT([&] { TrainCodec({"--threads", more}); }, refused) << "they share what a step of one part computes";
  Replace("page.yaml", "chunk: 2\n", "chunk: 2  # of frames\n");
  testing::internal::CaptureStderr();
  EXPECT_THAT(TrainCodec(), HasSubstr("done after 1 steps"));
  EXPECT_THAT(testing::internal::GetCapturedStderr(),
              HasSubstr("is planned for 1 steps and has done them; more --steps go on"));
  Replace("page.yaml", "steps: 1000", "steps: 900");  // no shape depends on it
  EXPECT_THAT([&] { TrainCodec(); }, refused);
}

TEST_F(TrainCommand, SaysThatAnotherVersionOfEvacBeganTheTraining) {
  const auto note = [&] {
    testing::internal::CaptureStderr();
    TrainCodec();
    return testing::internal::GetCapturedStderr();
  };
  EXPECT_THAT(note(), Not(HasSubstr("was begun by")));
  EXPECT_THAT(note(), Not(HasSubstr("was begun by"))) << "this one did";
  WriteFileAtomically(Path("codec/begun_by"), "0.0.1\n");
  EXPECT_THAT(note(), HasSubstr("evac: note: " + Path("codec") + " was begun by evac 0.0.1; evac "));
  std::filesystem::remove(Path("codec/begun_by"));
  EXPECT_THAT(note(), HasSubstr("was begun by an evac that did not write down its version"));
}

/// Its sampler takes two or more, and said so when everything was loaded.
TEST_F(TrainCommand, ImaginingInOneStepIsRefused) {
  const auto steps = [&](const char* number) {
    Printed(AddEncode, {"encode", Path("shards"), "--config", Path("page.yaml"), "--codec", Path("page.yaml"),
                        "--imagined", Path("imagined"), "--steps", number});
  };
  EXPECT_THROW(steps("1"), CLI::ValidationError);
  EXPECT_THROW(steps("2"), TensorError) << "that page is no codec";
  EXPECT_FALSE(std::filesystem::exists(Path("imagined")));
}

/// Nothing said which version had made half of the latents.
TEST_F(TrainCommand, EncodingSaysThatAnotherVersionOfEvacBeganIt) {
  TrainCodec();
  const auto note = [&] {
    testing::internal::CaptureStderr();
    Printed(AddEncode, {"encode", Path("shards"), "--config", Path("page.yaml"), "--codec", Path("codec/codec.safetensors")});
    return testing::internal::GetCapturedStderr();
  };
  EXPECT_THAT(note(), Not(HasSubstr("was begun by")));
  EXPECT_THAT(note(), Not(HasSubstr("was begun by"))) << "this one did";
  WriteFileAtomically(Path("shards/latents_begun_by"), "0.0.1\n");
  EXPECT_THAT(note(), HasSubstr("evac: note: what is encoded in " + Path("shards") + " was begun by evac 0.0.1; evac "));
  std::filesystem::remove(Path("shards/latents_begun_by"));
  EXPECT_THAT(note(), HasSubstr("was begun by an evac that did not write down its version"));
  for (const char* latents : {"shards/latents_00000.safetensors", "shards/latents_00001.safetensors"})
    std::filesystem::remove(Path(latents));
  EXPECT_THAT(note(), Not(HasSubstr("was begun by"))) << "begun anew";
  EXPECT_EQ(ReadFile(Path("shards/latents_begun_by")), EVAC_VERSION "\n");
}

/// It wrote beside a packing or another encoding that went on there.
TEST_F(TrainCommand, EncodingIsRefusedWhereAnotherProcessWritesUnlessAllIsThere) {
  TrainCodec();
  const auto encode = [&](const std::vector<std::string>& more = {}) {
    std::vector<std::string> words = {"encode", Path("shards"), "--config", Path("page.yaml"), "--codec", Path("codec/codec.safetensors")};
    words.insert(words.end(), more.begin(), more.end());
    return Printed(AddEncode, words);
  };
  const auto refused =
      ThrowsMessage<Error>(HasSubstr("process " + std::to_string(::getpid()) + " is writing here; wait for it"));
  {
    const RunLock lock(Path("shards/lock"));
    EXPECT_THAT([&] { encode(); }, refused);
    EXPECT_FALSE(std::filesystem::exists(Path("shards/latents_00000.safetensors")));
  }
  EXPECT_THAT(encode(), HasSubstr("latents of 2 shards, 2 of them new"));
  const RunLock lock(Path("shards/lock"));
  EXPECT_THAT(encode(), HasSubstr("latents of 2 shards, 0 of them new")) << "nothing is written: the folder may be read-only";
}

TEST_F(TrainCommand, AFolderThatAnotherTrainingWritesIsRefusedWithItsProcess) {
  const auto refused =
      ThrowsMessage<Error>(HasSubstr("process " + std::to_string(::getpid()) + " is writing here; wait for it"));
  for (const char* out : {"codec", "judge", "policy"}) MakeFolders(Path(out));
  {
    const RunLock codec(Path("codec/lock")), judge(Path("judge/lock")), policy(Path("policy/lock"));
    EXPECT_THAT([&] { TrainCodec(); }, refused);
    EXPECT_FALSE(std::filesystem::exists(Path("codec/metrics.csv")));
    for (const std::string learner : {"judge", "policy"})
      EXPECT_THAT([&] { Train({learner, Path("shards"), "--steps", "1", "--out", Path(learner)}); }, refused) << learner;
    EXPECT_THAT([&] {
      Train({"judge", Path("shards"), "--init", Path("page.yaml"), "--calibrate-only", "--out", Path("judge")});
    },
                refused);
  }
  EXPECT_THAT(TrainCodec(), HasSubstr("done after 1 steps")) << "the lock went with its holder";
}

TEST_F(TrainCommand, TheEndSaysWhatWasNoNumber) {
  const auto end = [](const train::TrainerSummary& summary) {
    testing::internal::CaptureStdout();
    EXPECT_EQ(End(summary, "out", "codec.safetensors"), ExitCode::kOk);
    return testing::internal::GetCapturedStdout();
  };
  train::TrainerSummary summary;
  summary.step = summary.steps = summary.steps_now = 30;
  summary.why = "done";
  EXPECT_EQ(end(summary), "out/codec.safetensors: done after 30 steps\n");
  summary.left_out = 10;
  summary.holdouts_since_best = 3;
  EXPECT_THAT(end(summary), AllOf(HasSubstr("no hold-out was a number"),
                                  HasSubstr("10 steps left out: their loss or gradient was not finite")));
  summary.best = 0.5;
  EXPECT_THAT(end(summary), AllOf(HasSubstr("best hold-out 0.5"), Not(HasSubstr("was a number"))));
}

/// More --steps did nothing, and what was said was what the training had said when it ended.
TEST_F(TrainCommand, TheEndSaysThatPatienceHasEndedATrainingThatIsGoneOnWith) {
  train::TrainerSummary summary;
  summary.step = summary.steps_now = 30;
  summary.steps = 100;
  summary.why = "no better for 5 hold-outs";
  const auto end = [&] {
    testing::internal::CaptureStderr();
    EXPECT_EQ(End(summary, "out", "codec.safetensors"), ExitCode::kOk);
    return testing::internal::GetCapturedStderr();
  };
  EXPECT_EQ(end(), "");
  summary.steps_now = 0;
  EXPECT_THAT(end(), AllOf(HasSubstr("nothing was left to do"), HasSubstr("after 30 steps, no better for 5 hold-outs"),
                           HasSubstr("--set patience=N"), Not(HasSubstr("--steps"))));
}

TEST_F(TrainCommand, KnowsWhatEachTrainingIsBegunWith) {
  const auto begun_with = [&](const std::function<void(TrainArguments&)>& change) {
    TrainArguments arguments;
    arguments.config = Path("page.yaml");
    arguments.init = Path("shards/shard_00000.safetensors");
    change(arguments);
    TrainingProgress progress(stderr);
    return PlaceOf(arguments, progress).begun_with;
  };
  const std::string other = Path("shards/shard_00001.safetensors"), plain = begun_with([](TrainArguments&) {});
  EXPECT_EQ(plain, begun_with([](TrainArguments&) {}));
  EXPECT_NE(plain, begun_with([&](TrainArguments& a) { a.init = other; }));
  EXPECT_NE(plain, begun_with([&](TrainArguments& a) { a.forecast = other; }));
  EXPECT_NE(plain, begun_with([](TrainArguments& a) { a.init_widen = true; }));
  EXPECT_NE(plain, begun_with([](TrainArguments& a) { a.init_except = {"embedder."}; }));
}

TEST_F(TrainCommand, WhatOneFolderHoldsOutAnotherMayNotLearnFrom) {
  WriteLearningShards(folder_ / "more", {.clips = 8, .frames = 6});
  const train::ShardFolders folders = {folder_ / "shards", folder_ / "more"};
  EXPECT_NO_THROW(CheckHoldouts(folders));
  Replace("more/shards.json", "\"unseen-", "\"kept-");
  Replace("more/shards.json", "\"seen-", "\"unseen-");  // more states than the other folder has
  const std::string both = Path("more") + ": 2 of the 2 initial states that " + Path("shards") + " holds out";
  const auto refused = ThrowsMessage<Error>(
      AllOf(HasSubstr(both), HasSubstr("unseen-0"), HasSubstr("one --seed and one --holdout")));
  EXPECT_THAT([&] { CheckHoldouts(folders); }, refused);
  EXPECT_NO_THROW(CheckHoldouts({folder_ / "more", folder_ / "more"}));
  EXPECT_THAT([&] { TrainCodec({Path("more")}); }, refused);
  for (const char* learner : {"judge", "policy"}) {
    const std::vector<std::string> words = {learner, Path("shards"), Path("more"), "--steps", "1", "--out", Path("out")};
    EXPECT_THAT([&] { Train(words); }, refused) << learner;
  }
}

/// --set and --keep-steps took the folders behind them for further values.
TEST_F(TrainCommand, AnOptionTakesItsOwnValueAndNotTheFoldersBehindIt) {
  EXPECT_THAT(Train({"codec", "--config", Path("page.yaml"), "--steps", "1", "--set", "batch=2", "--set", "seed=4",
                     Path("shards"), "--out", Path("codec")}),
              HasSubstr("done after 1 steps"));
  MakeFolders(Path("policy"));
  const RunLock lock(Path("policy/lock"));
  const auto is_read = ThrowsMessage<Error>(HasSubstr("is writing here; wait for it"));
  for (const char* steps : {"1", "1,2"})
    EXPECT_THAT([&] { Train({"policy", "--out", Path("policy"), "--keep-steps", steps, Path("shards"), "--steps", "2"}); },
                is_read)
        << steps;
}

/// It was looked at when copies of the network were there: of no parts there is none, and the first was asked.
TEST_F(TrainCommand, AStepOfNoPartsIsRefusedBeforeTheFolderIsMade) {
  for (const char* kind : {"codec", "forecast", "judge", "policy"}) {
    std::vector<std::string> words = {kind, Path("shards"), "--set", "accumulate=0", "--out", Path("out")};
    if (*kind == 'c' || *kind == 'f') words.insert(words.end(), {"--config", Path("page.yaml")});
    EXPECT_THAT([&] { Train(words); },
                ThrowsMessage<TensorError>(HasSubstr("training: accumulate is 0.000000, wanted at least 1"))) << kind;
    EXPECT_FALSE(std::filesystem::exists(Path("out"))) << kind;
  }
}

TEST_F(TrainCommand, OptionsThatDoNothingAreRefused) {
  const auto world = [&](std::vector<std::string> more) {
    more.insert(more.begin(), {"world", Path("shards"), "--config", Path("page.yaml"), "--codec", Path("page.yaml"),
                               "--out", Path("out")});
    return Train(more);
  };
  EXPECT_THROW(world({"--init-except", "embedder."}), CLI::RequiresError);
  EXPECT_THROW(world({"--init-widen"}), CLI::RequiresError);
  EXPECT_THROW(world({"--steps", "3", "--minutes", "2"}), CLI::ExcludesError);
  train::ForecastOptions options;
  for (const char* option : {"bf16=true", "holdout_size=8"})
    EXPECT_THAT([&] { ReadTrainingPage("", "forecast", {option}, SettingsOf(options)); },
                ThrowsMessage<Error>(HasSubstr("there is no such option")))
        << option;
}

/// What --job wrote of it was refused where it was carried to: a text's second line stood for an option of its own.
TEST_F(TrainCommand, AnOptionsTextThatIsNotInOneLineIsRefused) {
  train::WorldOptions options;
  const auto refused = ThrowsMessage<Error>(
      HasSubstr("field optimiser: found a line's end in a text, wanted it in one line"));
  EXPECT_THAT([&] { ReadTrainingPage("", "world", {"optimiser=\"muon\\noption batch 9\""}, SettingsOf(options)); },
              refused);
  WriteFileAtomically(Path("training.yaml"), "world:\n  optimiser: |\n    muon\n");
  EXPECT_THAT([&] { ReadTrainingPage(Path("training.yaml"), "world", {}, SettingsOf(options)); },
              ThrowsMessage<Error>(HasSubstr("field world.optimiser: found a line's end in a text")));
  EXPECT_EQ(options.job.trainer.optimiser, "adamw");
  WriteFileAtomically(Path("training.yaml"), "world:\n  optimiser: |-\n    muon\n");
  ReadTrainingPage(Path("training.yaml"), "world", {}, SettingsOf(options));
  EXPECT_EQ(options.job.trainer.optimiser, "muon");
}

/// The trained judge was replaced, and its training put it back uncalibrated.
TEST_F(TrainCommand, CalibratingTakesNoStepsAndNoFolderOfATraining) {
  const std::vector<std::string> words = {"judge",            Path("shards"), "--init",     Path("page.yaml"),
                                          "--calibrate-only", "--out",        Path("judge")};
  for (const std::vector<std::string>& option : {std::vector<std::string>{"--steps", "5"}, {"--minutes", "5"}}) {
    std::vector<std::string> more = words;
    more.insert(more.end(), option.begin(), option.end());
    EXPECT_THROW(Train(more), CLI::ExcludesError) << option.front();
  }
  MakeFolders(Path("judge"));
  for (const char* file : {"judge/training.safetensors", "judge/judge.safetensors"})
    WriteFileAtomically(Path(file), "trained");
  EXPECT_THAT([&] { Train(words); },
              ThrowsMessage<Error>(AllOf(HasSubstr("--out: " + Path("judge") + " holds a training"),
                                         HasSubstr("wanted another folder"))));
  EXPECT_EQ(ReadFile(Path("judge/judge.safetensors")), "trained");
}

TEST_F(TrainCommand, ASideThatIsNoMultipleOfEightIsSaidToBeNone) {
  const auto judge = [&](const char* option, const char* side) {
    const std::vector<std::string> words = {"train", Path("shards"), option, side, "--out", Path("out")};
    return [words] { Printed(AddJudgeTrain, words); };
  };
  for (const char* option : {"--height-px", "--width-px"}) {
    for (const char* side : {"abc", "60", "64px", "99999999999999999999"})
      EXPECT_THAT(judge(option, side),
                  ThrowsMessage<CLI::ValidationError>(
                      AllOf(HasSubstr(option), HasSubstr("found " + std::string(side) + ", wanted a multiple of 8"))));
  }
}

TEST_F(TrainCommand, AJobThatIsCarriedElsewhereTrainsTheSameWeights) {
  // The program itself: it tells OpenBLAS the processor, as evac-train does, and these tests do not.
  const CommandResult here = RunCommand({Binary("evac"), "train", "codec", Path("shards"), "--config", Path("page.yaml"),
                                         "--out", Path("codec"), "--set", "batch=2", "--steps", "1", "--threads", "1"});
  ASSERT_EQ(here.exit_code, 0) << here.err;
  EXPECT_THAT(Train({"codec", Path("shards"), "--config", Path("page.yaml"), "--job", Path("job"), "--set", "batch=2", "--steps", "1"}),
              HasSubstr("There: evac-train job SHARDS --out OUT"));
  EXPECT_FALSE(std::filesystem::exists(Path("job.tmp")));
  const auto there = [&](const std::vector<std::string>& more) {
    std::vector<std::string> words = {Binary("evac-train"), Path("job"), Path("shards"), "--threads", "1"};
    words.insert(words.end(), more.begin(), more.end());
    return RunCommand(words);
  };
  const CommandResult trained = there({"--out", Path("there")});
  EXPECT_EQ(trained.exit_code, 0) << trained.err;
  EXPECT_THAT(trained.out, HasSubstr("there/codec.safetensors: done after 1 steps"));
  EXPECT_TRUE(ReadFile(Path("there/codec.safetensors")) == ReadFile(Path("codec/codec.safetensors")));

  const auto refused = [&](const std::vector<std::string>& more, const std::string& why) {
    const CommandResult result = there(more);
    EXPECT_EQ(result.exit_code, 2) << why;
    EXPECT_THAT(result.err, HasSubstr("evac-train: " + why));
  };
  refused({}, "--out is missing");
  refused({"--out", Path("x"), "--init", Path("codec/codec.safetensors")}, "--init: the job was written without it");
  refused({"--out", Path("x"), "--device", "gpu"}, "--device: found 'gpu', wanted cpu, cuda or cuda:N");
  refused({"--out", Path("x"), "--steps", "0"}, "--steps: found '0', wanted 1 to ");
  refused({"--out", Path("there"), "--steps", "2", "--threads", "2"}, Path("there/training.safetensors") + " is a training with other options");
}

/// It held a file of its own, so both could write into one OUT, and wrote no begun_by, so each later one had a note.
TEST_F(TrainCommand, AJobThatIsCarriedElsewhereHoldsItsFolderAndSaysItsVersionAsTrainingsDo) {
  Train({"codec", Path("shards"), "--config", Path("page.yaml"), "--job", Path("job"), "--set", "batch=2", "--steps", "1"});
  const auto there = [&] {
    return RunCommand({Binary("evac-train"), Path("job"), Path("shards"), "--threads", "1", "--out", Path("there")});
  };
  MakeFolders(Path("there"));
  {
    const RunLock lock(Path("there/lock"));
    const CommandResult refused = there();
    EXPECT_EQ(refused.exit_code, 2) << refused.err;
    EXPECT_THAT(refused.err, HasSubstr("process " + std::to_string(::getpid()) + " is writing here; wait for it"));
  }
  EXPECT_FALSE(std::filesystem::exists(Path("there/metrics.csv")));
  EXPECT_THAT(there().err, Not(HasSubstr("was begun by")));
  EXPECT_EQ(ReadFile(Path("there/begun_by")), EVAC_VERSION "\n");
  WriteFileAtomically(Path("there/begun_by"), "0.0.1\n");
  EXPECT_THAT(there().err, HasSubstr("evac-train: note: " + Path("there") + " was begun by evac 0.0.1; evac " EVAC_VERSION));
  WriteFileAtomically(Path("there/lock"), "mine: do not touch\n");
  const CommandResult somebodys = there();
  EXPECT_EQ(somebodys.exit_code, 2) << somebodys.err;
  EXPECT_EQ(ReadFile(Path("there/lock")), "mine: do not touch\n");
}

/// A codec that was trained anew, or another checkpoint: it was learned from, and said to be what the job names.
TEST_F(TrainCommand, AJobThatIsCarriedElsewhereTakesTheFilesThatItWasWrittenForAlone) {
  TrainCodec();
  const std::string own = Path("codec/codec.safetensors"), other = Path("other.safetensors"), config = Path("page.yaml");
  Encode();
  const std::string told = Path("told.yaml"), whole = Path("whole.safetensors");
  WriteFileAtomically(told, std::string(kPage) + "object_forecast: true\npose_map: {scaled: true}\n");
  Replace("told.yaml", "in_channels: 31", "in_channels: 32");
  nn::RandomWeights random(1);
  nn::SaveWeights(whole, random, ReadEvacConfig(told));
  std::string bytes = ReadFile(own);
  bytes[bytes.size() - 4] ^= 1;  // the last digit of its last number
  WriteFileAtomically(other, bytes);
  const auto there = [&](std::vector<std::string> more) {
    more.insert(more.begin(), {Binary("evac-train"), Path("job"), Path("shards"), "--threads", "1", "--out", Path("there")});
    return RunCommand(more);
  };
  const auto refused = [&](const std::vector<std::string>& more, const std::string& option) {
    const CommandResult result = there(more);
    EXPECT_EQ(result.exit_code, 2) << option;
    EXPECT_THAT(result.err, HasSubstr("evac-train: " + option + ": " + other + " is another one than the job was written for"));
    EXPECT_FALSE(std::filesystem::exists(Path("there"))) << option;
  };
  const std::string job = Path("job");
  EXPECT_THAT(Train({"world", Path("shards"), "--config", told, "--codec", own, "--init", whole, "--forecast", whole,
                     "--set", "first_image=true", "--job", job}),
              HasSubstr("There: evac-train job SHARDS --codec codec.safetensors --init whole.safetensors --forecast "
                        "whole.safetensors --out OUT\n"));
  refused({"--codec", other, "--init", whole, "--forecast", whole}, "--codec");
  refused({"--codec", own, "--init", other, "--forecast", whole}, "--init");
  refused({"--codec", own, "--init", whole, "--forecast", other}, "--forecast");

  Train({"codec", Path("shards"), "--config", config, "--init", own, "--job", job, "--set", "batch=2", "--steps", "1"});
  refused({"--init", other}, "--init");
  const std::string text = ReadFile(job);
  const std::size_t line = text.find("init_sha256 ");
  ASSERT_NE(line, std::string::npos);
  WriteFileAtomically(job, text.substr(0, line) + text.substr(text.find('\n', line) + 1));
  const CommandResult of_an_earlier_version = there({"--init", other});
  EXPECT_EQ(of_an_earlier_version.exit_code, 0) << of_an_earlier_version.err;
}

/// Of packings that nobody had compared, one learned from what another held out.
TEST_F(TrainCommand, AJobThatIsCarriedElsewhereTakesTheShardsThatItWasWrittenForAlone) {
  const std::string job = Path("job"), shards = Path("shards");
  Train({"codec", shards, "--config", Path("page.yaml"), "--job", job, "--set", "batch=2", "--steps", "1"});
  const auto there = [&](std::vector<std::string> words) {
    words.insert(words.begin(), {Binary("evac-train"), job});
    words.insert(words.end(), {"--threads", "1", "--out", Path("there")});
    return RunCommand(words);
  };
  const CommandResult twice = there({shards, shards});
  EXPECT_EQ(twice.exit_code, 2) << twice.err;
  EXPECT_THAT(twice.err, HasSubstr("evac-train: SHARDS: they are others than the job was written for, or in another "
                                   "order: recipe carry,carry, wanted carry\n"));
  EXPECT_FALSE(std::filesystem::exists(Path("there")));
  EXPECT_EQ(there({shards}).exit_code, 0);
  std::filesystem::remove_all(Path("there"));
  Replace("job", "recipe carry\n", "");
  EXPECT_EQ(there({shards, shards}).exit_code, 0) << "of an earlier version, it is not asked";
}

/// The job was written, and refused on the other machine.
TEST_F(TrainCommand, WhatATrainingWouldRefuseIsRefusedBeforeItsJobIsWritten) {
  TrainCodec();
  const std::string codec = Path("codec/codec.safetensors"), job = Path("job");
  const auto refused = [&](std::vector<std::string> words, const std::string& why) {
    words.insert(words.begin() + 1, {Path("shards"), "--config", Path("page.yaml"), "--job", job});
    EXPECT_THAT([&] { Train(words); }, ThrowsMessage<TensorError>(HasSubstr(why)));
    EXPECT_FALSE(std::filesystem::exists(job)) << why;
  };
  refused({"codec", "--set", "map_share=2"}, "codec training: map_share is 2, wanted 0 to 1");
  refused({"codec", "--set", "holdout_size=0"}, "holdout_size is 0, wanted at least 1");
  refused({"codec", "--init", Path("shards/shard_00000.safetensors")}, "first_stage_model");
  Replace("page.yaml", "vae: {channels: 32", "vae: {channels: 64");
  refused({"codec", "--init", codec}, codec + ": first_stage_model");
  Replace("page.yaml", "vae: {channels: 64", "vae: {channels: 32");
  refused({"world", "--codec", codec}, "shard_00000.safetensors has no latents");
  Encode();
  refused({"world", "--codec", codec}, "the page's pose_map wants 'radius_px=50 thickness_px=8'");
  Replace("page.yaml", "views: 2\n", "views: 2\npose_map: {scaled: true}\n");
  refused({"world", "--codec", codec, "--set", "step_weight=fast"}, "step_weight is 'fast'");
  refused({"world", "--codec", codec, "--set", "view_weights=1,1,1"}, "view_weights has 3 numbers, wanted 2");
  refused({"world", "--codec", codec, "--set", "strip_steps=1"}, "strip_steps is 1, wanted 2 to 1000");
  refused({"world", "--codec", codec, "--set", "learning_rate=0"}, "learning_rate is 0");
  refused({"world", "--codec", codec, "--set", "drop=2"}, "world training: drop is 2, wanted 0 to 1");
  refused({"world", "--codec", codec, "--init", codec}, "does not fit the page of sizes");
  refused({"world", "--codec", codec, "--forecast", codec}, "object_forecast: false, wanted true, or no --forecast");
  EXPECT_THAT(Train({"world", Path("shards"), "--config", Path("page.yaml"), "--codec", codec, "--job", job}),
              HasSubstr("There: evac-train job SHARDS --codec codec.safetensors --out OUT\n"));
}

TEST_F(TrainCommand, WantsAFolderToWriteOrAJobAndNotBoth) {
  const std::vector<std::string> codec = {"codec", Path("shards"), "--config", Path("page.yaml")};
  EXPECT_THAT([&] { Train(codec); }, ThrowsMessage<Error>(HasSubstr("--out is required")));
  std::vector<std::string> both = codec;
  both.insert(both.end(), {"--out", Path("out"), "--job", Path("job")});
  EXPECT_THROW(Train(both), CLI::ExcludesError);
  EXPECT_FALSE(std::filesystem::exists(Path("out")));
  EXPECT_FALSE(std::filesystem::exists(Path("job")));
}

}  // namespace
}  // namespace evac
