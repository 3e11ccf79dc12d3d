#include <gmock/gmock.h>

#include <filesystem>
#include <iterator>

#include "core/tensor_file.h"
#include "tests/apps/train_command.h"
#include "tests/support/command.h"

/// What `evac train` says when it refuses, and what it leaves behind.
namespace evac {
namespace {

namespace fs = std::filesystem;
using testing::AllOf;
using testing::HasSubstr;
using testing::Not;
using testing::ThrowsMessage;

class TrainRefusals : public TrainCommand {
 protected:
  /// Of a world model, with the codec of TrainCodec; the shards have no latents.
  std::string TrainWorld(const std::string& out, const std::vector<std::string>& more = {}) const {
    std::vector<std::string> words = {"world", Path("shards"), "--config", Path("page.yaml"),
                                      "--codec", Path("codec/codec.safetensors"), "--out", out};
    words.insert(words.end(), more.begin(), more.end());
    return Train(words);
  }
};

/// They left `lock` and `begun_by` in a folder that was made for them, and in one of somebody's.
TEST_F(TrainRefusals, LeaveNothingBehind) {
  TrainCodec();
  const std::string somebodys = Path("somebody");
  MakeFolders(somebodys);
  WriteFileAtomically(Path("somebody/notes.txt"), "mine");
  for (const std::string& out : {Path("new/below"), somebodys}) {
    for (const char* option : {"drop=4", "view_weights=1", "strip_steps=1", "batch=2"})  // the last has no latents
      EXPECT_THROW(TrainWorld(out, {"--set", option}), TensorError) << option;
    EXPECT_THROW(Train({"codec", Path("shards"), "--config", Path("page.yaml"), "--set", "map_share=2", "--out", out}),
                 TensorError);
    EXPECT_THROW(Train({"forecast", Path("shards"), "--config", Path("page.yaml"), "--out", out}), TensorError);
    EXPECT_ANY_THROW(Train({"judge", Path("shards"), "--set", "jitter=2", "--out", out}));
    EXPECT_ANY_THROW(Train({"judge", Path("shards"), "--init", Path("page.yaml"), "--calibrate-only", "--out", out}));
    EXPECT_ANY_THROW(Train({"policy", Path("shards"), "--set", "arm_noise_m=-1", "--out", out}));
  }
  EXPECT_FALSE(fs::exists(Path("new")));
  EXPECT_EQ(std::distance(fs::directory_iterator(somebodys), {}), 1);
}

/// What a training had written before would have gone with what the refusal removes.
TEST_F(TrainRefusals, LeaveATrainingThatHasBegunAsItIs) {
  TrainCodec();
  EXPECT_THROW(TrainCodec({"--set", "seed=9"}), TensorError);
  for (const char* file : {"lock", "begun_by", "training.safetensors", "metrics.csv", "codec.safetensors"})
    EXPECT_TRUE(fs::exists(folder_ / "codec" / file)) << file;
}

/// evac-train made OUT before it looked at the shards.
TEST_F(TrainRefusals, ElsewhereLeaveNothingBehindEither) {
  Train({"codec", Path("shards"), "--config", Path("page.yaml"), "--job", Path("job")});
  Replace("job", "map_share 0", "map_share 9");
  const CommandResult there = RunCommand({Binary("evac-train"), Path("job"), Path("shards"), "--out", Path("there")});
  EXPECT_EQ(there.exit_code, 2) << there.err;
  EXPECT_THAT(there.err, HasSubstr("map_share is 9"));
  EXPECT_FALSE(fs::exists(Path("there")));
}

/// The option was named, and neither the page, its line, nor its section.
TEST_F(TrainRefusals, SayWhereAnOptionWasGiven) {
  TrainCodec();
  WriteFileAtomically(Path("training.yaml"),
                      "codec: {map_share: 0.5}\nworld:\n  batch: 4\n  closing_share: 4\n  view_weights: '1'\n");
  const std::vector<std::string> with_page = {"--training", Path("training.yaml")};
  const auto train = [&](std::vector<std::string> more) {
    more.insert(more.begin(), with_page.begin(), with_page.end());
    return [this, more] { TrainWorld(Path("out"), more); };
  };
  EXPECT_THAT(train({"--set", "closing_share=0.5"}),
              ThrowsMessage<TensorError>(AllOf(HasSubstr(Path("training.yaml") + ":5: field world.view_weights: "),
                                               HasSubstr("view_weights has 1 numbers, wanted 2: one per view"))));
  EXPECT_THAT(train({"--set", "view_weights='1,1'", "--set", "first_image=true"}),
              ThrowsMessage<TensorError>(AllOf(
                  HasSubstr(Path("training.yaml") + ":4: field world.closing_share: "),
                  HasSubstr("world training: closing_share is 4, wanted 0 to 1"))));
  EXPECT_THAT([&] { TrainCodec({"--training", Path("training.yaml"), "--set", "map_share=3"}); },
              ThrowsMessage<TensorError>(AllOf(HasSubstr("--set"), HasSubstr("field map_share: "),
                                               HasSubstr("map_share is 3"), Not(HasSubstr("training.yaml")))));
  EXPECT_THAT([&] { TrainCodec({"--set", "accumulate=0"}); },
              ThrowsMessage<TensorError>(AllOf(HasSubstr("--set"), HasSubstr("field accumulate: training: "))));
}

/// "[1432, 2, 16, 24, 3], wanted [-1, 1, 16, 24, 3]" named neither a folder nor a field of the page.
TEST_F(TrainRefusals, SayWhichShardsAndWhichFieldsOfThePageDoNotFit) {
  Replace("page.yaml", "views: 2\n", "views: 1\n");
  EXPECT_THAT([&] { TrainCodec(); },
              ThrowsMessage<TensorError>(AllOf(
                  HasSubstr(Path("shards") + ": its pictures have views: 2, image_height_px: 16"),
                  HasSubstr("the page of sizes wants views: 1, image_height_px: 16, image_width_px: 24"))));
}

/// Some 95 lines in which the one difference had to be found: all options twice, numbers in hex, hashes without names.
TEST_F(TrainRefusals, ToGoOnSayWhatIsAnotherAlone) {
  TrainCodec({"--threads", "1"});
  const auto refused = [&](const std::vector<std::string>& more, const std::string& difference) {
    std::vector<std::string> words = {"--threads", "1"};
    if (!more.empty() && more.front() == "--threads") words.clear();
    words.insert(words.end(), more.begin(), more.end());
    EXPECT_THAT([&] { TrainCodec(words); },
                ThrowsMessage<TensorError>(HasSubstr("is a training with other options: " + difference)));
  };
  refused({"--set", "learning_rate=.001"}, "learning_rate is 5e-05 there, 0.001 here: another folder");
  refused({"--threads", "2"}, "--threads is 1 there, 2 here: another folder");
  refused({"--init", Path("codec/codec.safetensors")}, "--init, by SHA-256, is none there, ");
  Replace("page.yaml", "steps: 1000", "steps: 900");
  refused({}, "the page of sizes, by hash, is ");
}

}  // namespace
}  // namespace evac
