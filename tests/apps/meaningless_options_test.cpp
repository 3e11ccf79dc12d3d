#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fstream>
#include <utility>

#include "apps/commands.h"
#include "core/store.h"
#include "tests/apps/printed.h"
#include "tests/reports/stored_run.h"

/// Options that could do nothing are refused, and nothing is written.
namespace evac {
namespace {

using testing::AllOf;
using testing::HasSubstr;

class MeaninglessOption : public testing::Test {
 protected:
  MeaninglessOption() { const Store closed = std::move(run_.store()); }

  std::string Run() const { return run_.folder().string(); }
  std::filesystem::path Beside(const std::string& name) const { return run_.folder().parent_path() / name; }
  std::size_t Verdicts() const { return Store::Open(run_.folder(), Store::Mode::kReadOnly).Verdicts().size(); }

  /// Judges anew whatever the options are. @returns the complaint.
  std::string Judge(std::vector<std::string> options) const {
    options.insert(options.begin(), {"judge", Run(), "--again"});
    try {
      Printed(AddJudge, options);
    } catch (const Error& error) {
      EXPECT_EQ(error.exit_code(), ExitCode::kInvalidInput);
      return error.what();
    }
    return "nothing was thrown";
  }

  StoredRun run_{"run", "sf", "fs"};
};

TEST_F(MeaninglessOption, OfAVisionLanguageModelIsRefusedOfOtherJudges) {
  const std::size_t before = Verdicts();
  for (const std::vector<std::string>& option :
       {std::vector<std::string>{"--dry-run"}, {"--offline"}, {"--retest"}, {"--config", "qwen.yaml"}}) {
    std::vector<std::string> words = option;
    EXPECT_THAT(Judge(words), AllOf(HasSubstr(option.front()), HasSubstr("wanted --judge vlm")));
    words.insert(words.end(), {"--judge", "classifier", "--weights", "judge.safetensors"});
    EXPECT_THAT(Judge(words), AllOf(HasSubstr(option.front()), HasSubstr("found --judge classifier")));
  }
  EXPECT_EQ(Verdicts(), before) << "who asked what it would cost got no verdicts";
}

TEST_F(MeaninglessOption, OfAClassifierIsRefusedOfAVisionLanguageModel) {
  EXPECT_THAT(Judge({"--judge", "vlm", "--config", "qwen.yaml", "--weights", "judge.safetensors"}),
              HasSubstr("--weights: a model server has its own"));
}

TEST_F(MeaninglessOption, ACostIsNotSaidOfAnswersThatCostNothing) {
  EXPECT_THAT(Judge({"--judge", "vlm", "--config", "qwen.yaml", "--dry-run", "--offline"}),
              HasSubstr("--offline: asks no server"));
}

TEST_F(MeaninglessOption, OfARunIsRefusedOfATableOfRates) {
  const std::string csv = Beside("rates.csv").string(), out = Beside("page").string();
  std::ofstream(csv) << "group,task,policy,real_sr,sim_sr\n,t,a,0.2,0.5\n,t,b,0.6,0.5\n,t,c,0.8,0.9\n";
  for (const std::vector<std::string>& option :
       {std::vector<std::string>{"--judge", "human"}, {"--baseline", "pick@1"}, {"--seed", "3"}, {"--embed-thumbs"}}) {
    std::vector<std::string> words = {"report", "--pairs", csv, "--out", out};
    words.insert(words.end(), option.begin(), option.end());
    EXPECT_THROW(Printed(AddReport, words), CLI::ExcludesError) << option.front();
  }
  EXPECT_FALSE(std::filesystem::exists(out));
  for (const std::vector<std::string>& option :
       {std::vector<std::string>{"--judge", "human"}, {"--world", "sim"}, {"--seed", "3"}}) {
    std::vector<std::string> words = {"correlate", "--pairs", csv};
    words.insert(words.end(), option.begin(), option.end());
    EXPECT_THROW(Printed(AddCorrelate, words), CLI::ExcludesError) << option.front();
  }
}

TEST_F(MeaninglessOption, OfImaginingIsRefusedWhereMapsAloneAreDrawn) {
  const std::string out = Beside("maps").string();
  for (const std::vector<std::string>& option :
       {std::vector<std::string>{"--png"}, {"--restart"}, {"--seed", "3"}, {"--steps", "10"}, {"--dtype", "bf16"}}) {
    std::vector<std::string> words = {"imagine", "--maps-only", "--recording", Run(), "--out", out};
    words.insert(words.end(), option.begin(), option.end());
    EXPECT_THROW(Printed(AddImagine, words), CLI::ExcludesError) << option.front();
  }
  EXPECT_FALSE(std::filesystem::exists(out));
}

TEST_F(MeaninglessOption, OfASamplerIsRefusedWhereItHasNoEffectUnlessItSaysWhatIsUsual) {
  const auto complaint = [&](const std::vector<std::string>& options) {
    std::vector<std::string> words = {"imagine", "--recording", Run(), "--out", Beside("imagined").string()};
    words.insert(words.end(), options.begin(), options.end());
    try {
      Printed(AddImagine, words);
    } catch (const Error& error) {
      return std::string(error.what());
    }
    return std::string("nothing was thrown");
  };
  EXPECT_THAT(complaint({"--solver", "dpm", "--eta", "0"}), HasSubstr("--eta: found 0 with --solver dpm"));
  EXPECT_THAT(complaint({"--cfg-rescale", "0"}), HasSubstr("--cfg-rescale: found 0 with --cfg 1"));
  for (const std::vector<std::string>& options :
       {std::vector<std::string>{"--eta", "0"},
        {"--cfg", "2", "--cfg-rescale", "0"},
        {"--solver", "dpm", "--eta", "1", "--cfg", "1", "--cfg-rescale", "0.7"}})
    EXPECT_THAT(complaint(options), HasSubstr("--weights is missing"));
}

TEST_F(MeaninglessOption, BeforeASubcommandThatReadsNoneIsRefused) {
  const std::string out = Beside("pinned.json").string();
  EXPECT_THROW(Printed(AddJudge, {"judge", "--again", "calibrate", Run(), "--judge", "oracle"}), CLI::ValidationError);
  EXPECT_THROW(Printed(AddGate, {"gate", "rules.yaml", "pin", Run(), "--out", out}), CLI::ValidationError);
  EXPECT_FALSE(std::filesystem::exists(out));
  Printed(AddGate, {"gate", "pin", Run(), "--out", out});
  EXPECT_TRUE(std::filesystem::exists(out));
}

TEST_F(MeaninglessOption, OfADecisionIsRefusedWhereAGateOnlySaysHowManyEpisodesItTakes) {
  const std::string rules = Beside("gate.yaml").string(), out = Beside("decision").string();
  std::ofstream(rules) << "gates:\n  - {name: r, test: paired_mcnemar, task: take, world: sim, margin: 0.1}\n";
  for (const std::vector<std::string>& option : {std::vector<std::string>{"--json"}, {"--out", out}, {"--seed", "3"}}) {
    std::vector<std::string> words = {"gate", rules};
    words.insert(words.end(), option.begin(), option.end());
    EXPECT_THROW(Printed(AddGate, words), CLI::RequiresError) << option.front();
  }
  EXPECT_FALSE(std::filesystem::exists(out));
  EXPECT_THAT(Printed(AddGate, {"gate", rules}), HasSubstr("pairs"));
}

}  // namespace
}  // namespace evac
