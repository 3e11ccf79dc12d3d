#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>

#include "apps/commands.h"
#include "core/file.h"
#include "core/store.h"
#include "core/tensor_file.h"
#include "judges/classifier_judge.h"
#include "judges/judge_card.h"
#include "tests/apps/printed.h"
#include "tests/support/temp_folder.h"

/// `evac judge balance`: what it writes is a judge.
namespace evac {

void AddBalance(CLI::App& judge, ExitCode& exit_code);

namespace {

using testing::HasSubstr;

const std::string kJudge = EVAC_SOURCE_DIR "/worldmodel/weights/desk/judge.safetensors";

/// Pairs of `count` states: of imagined clips the judge says .8 if they truly succeeded, else .7 or .1 by turns.
class Balance : public testing::Test {
 protected:
  void Run(int count) {
    Store store = Store::CreateOrContinue(folder_ / "run", {.suite_text = "suite: x", .suite_hash = std::string(64, 'a'), .suite_path = "x.yaml", .evac_version = "0"});
    Task task;
    task.id = "take_ham";
    store.AddTask(task);
    store.AddPolicy({"policy", "v1", "{}"});
    store.AddWorld({"real", "mujoco", true, ""});
    store.AddWorld({"evac", "evac", false, ""});
    for (int state = 0; state < count; ++state) {
      const bool succeeded = state % 2 == 0;
      Add(store, "real", state, "oracle", succeeded, {});
      Add(store, "evac", state, ClassifierName(kJudge), true, succeeded ? 0.8 : state % 4 == 1 ? 0.7 : 0.1);
    }
  }

  static void Add(Store& store, const std::string& world, int state, const std::string& judge, bool succeeded, std::optional<double> probability) {
    EpisodeRecord record;
    record.episode.key = {{"take_ham", std::to_string(state), "policy", "v1", 1}, world};
    record.episode.stop = StopReason::kStill;
    store.Add(record);
    Verdict verdict;
    verdict.episode_id = record.episode.key.Id();
    verdict.judge = judge;
    verdict.label = succeeded ? Label::kSuccess : Label::kFailure;
    verdict.probability = probability;
    store.AddVerdict(verdict);
  }

  std::vector<std::string> Words(std::vector<std::string> more = {}) const {
    std::vector<std::string> words = {"balance", (folder_ / "run").string(), "--weights", kJudge};
    words.insert(words.end(), more.begin(), more.end());
    return words;
  }

  const TempFolder folder_;
};

TEST_F(Balance, WritesTheSameNetworkWithTheThresholdThatBalances) {
  Run(240);
  const std::filesystem::path out = folder_ / "new" / "judge.safetensors";
  const std::string said = Printed(AddBalance, Words({"--out", out.string()}));
  EXPECT_THAT(said, HasSubstr("240 clips of evac whose pair truly succeeded (120) or failed (120) by oracle"));
  EXPECT_THAT(said, HasSubstr("   60 of 120   0.500"));
  EXPECT_THAT(said, HasSubstr("balanced: 0.753"));
  const TensorFile before = TensorFile::Open(kJudge), after = TensorFile::Open(out);
  EXPECT_EQ(after.metadata().at("threshold"), "0.5");
  EXPECT_EQ(after.metadata().at("threshold_of_kappas"), before.metadata().contains("threshold_of_kappas") ? before.metadata().at("threshold_of_kappas") : before.metadata().at("threshold"));
  EXPECT_EQ(after.metadata().at("balanced_on"), "240 clips of world evac of run aaaaaaaaaaaa");
  EXPECT_EQ(after.metadata().at("kappa"), before.metadata().at("kappa"));
  ASSERT_EQ(after.tensors().size(), before.tensors().size());
  for (const TensorView& tensor : before.tensors()) {
    const TensorView& same = after.Get(tensor.name);
    EXPECT_TRUE(std::ranges::equal(same.bytes, tensor.bytes)) << tensor.name;
  }
  const ClassifierCard was = ClassifierJudge(kJudge, folder_.path()).card(), is = ClassifierJudge(out, folder_.path()).card();
  EXPECT_EQ(is.threshold, 0.5);
  EXPECT_EQ(is.temperature, was.temperature);
  const double logit = was.offset + was.temperature * (std::log(0.7 / 0.3) + std::log(0.8 / 0.2)) / 2;  // between .7 and .8
  EXPECT_NEAR(1 / (1 + std::exp((is.offset - logit) / is.temperature)), 0.5, 1e-5);
  EXPECT_NE(ClassifierName(out), ClassifierName(kJudge)) << "another card is another judge";
}

TEST_F(Balance, ATruthThatNobodyHasToldIsRefusedByItsName) {
  Run(20);
  EXPECT_THAT([&] { Printed(AddBalance, Words({"--truth", "orcale"})); },
              testing::ThrowsMessage<Error>(testing::AllOf(
                  HasSubstr("--truth: found 'orcale', wanted one who has judged"), HasSubstr("oracle"))));
}

TEST_F(Balance, TooFewPairsAreInconclusiveAndNothingIsWritten) {
  Run(20);
  CLI::App app;
  ExitCode exit_code = ExitCode::kOk;
  AddBalance(app, exit_code);
  std::vector<std::string> words = Words({"--out", (folder_ / "judge.safetensors").string()});
  std::ranges::reverse(words);
  testing::internal::CaptureStdout();
  app.parse(words);
  EXPECT_THAT(testing::internal::GetCapturedStdout(), HasSubstr("wanted at least 60 of each"));
  EXPECT_EQ(exit_code, ExitCode::kInconclusive);
  EXPECT_FALSE(std::filesystem::exists(folder_ / "judge.safetensors"));
}

}  // namespace
}  // namespace evac
