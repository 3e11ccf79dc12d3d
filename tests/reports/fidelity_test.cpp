#include "reports/fidelity.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

namespace evac {
namespace {

using testing::HasSubstr;
using testing::Not;
using Json = nlohmann::json;

/// Outcomes as letters: s, f, or anything else for none.
std::optional<bool> Outcome(char letter) {
  if (letter == 's') return true;
  if (letter == 'f') return false;
  return std::nullopt;
}

/// One row per letter: reality, reality again, the model.
void Add(std::vector<FidelityRow>& rows, const std::string& kind, const std::string& checkpoint, const std::string& real,
         const std::string& again, const std::string& model) {
  for (std::size_t i = 0; i < real.size(); ++i)
    rows.push_back({kind, {"take_bottle", "7-" + std::to_string(i), "pick", checkpoint, 1}, Outcome(real[i]),
                    Outcome(again[i]), Outcome(model[i]), "closed/real.mp4", "closed/model.mp4"});
}

FidelityInput Sample() {
  FidelityInput input;
  Add(input.rows, "closed_loop", "good", "ssssssssff", "sssssssfff", "ssssssssfs");
  Add(input.rows, "closed_loop", "fair", "sssssfffff", "sssssfffff", "ssssffffff");
  Add(input.rows, "closed_loop", "bad", "sfffffffff", "sffffffff-", "sfffffffs-");
  Add(input.rows, "open_loop", "good", "ssff", "----", "ssfs");
  Add(input.rows, "counterfactual:shifted", "good", "fffs", "----", "ffss");
  return input;
}

TEST(Fidelity, CountsWhatWasHallucinatedAmongWhatTrulyFailed) {
  const Fidelity fidelity = FidelityOf(Sample());
  EXPECT_EQ(fidelity.closed.n, 29) << "one state of bad has no imagined outcome";
  EXPECT_DOUBLE_EQ(*fidelity.closed.hallucinated.value, 2.0 / 15);
  EXPECT_DOUBLE_EQ(*fidelity.closed.missed.value, 1.0 / 14);
  EXPECT_DOUBLE_EQ(*fidelity.closed.agreement.value, 26.0 / 29);
  EXPECT_DOUBLE_EQ(*fidelity.closed_again.missed.value, 1.0 / 14);
  EXPECT_DOUBLE_EQ(*fidelity.open.hallucinated.value, 1.0 / 2);
  ASSERT_EQ(fidelity.counterfactuals.size(), 1u);
  EXPECT_DOUBLE_EQ(*fidelity.counterfactuals[0].match.hallucinated.value, 1.0 / 3) << "one succeeded in truth: it is no hallucination";
}

TEST(Fidelity, SaysWhichWrongOutcomesAreTheModelsOwn) {
  FidelityInput input = Sample();
  Add(input.rows, "executed", "good", "ssssssssff", "----------", "ssssssssfs");
  Add(input.rows, "executed", "fair", "ssss-fffff", "----------", "ssssffffff");
  Add(input.rows, "executed", "bad", "sfffffffsf", "----------", "sfffffffs-");
  const Fidelity fidelity = FidelityOf(std::move(input));
  EXPECT_EQ(fidelity.executed.n, 28);
  EXPECT_DOUBLE_EQ(*fidelity.executed.hallucinated.value, 1.0 / 14);
  EXPECT_DOUBLE_EQ(*fidelity.executed.missed.value, 0);
  EXPECT_EQ(fidelity.wrong.of_actions, 1) << "a success of good that its actions do not come to";
  EXPECT_EQ(fidelity.wrong.led_astray, 1) << "the success of bad; of the failure of fair nobody knows";
  const Json json = Json::parse(FidelityJson(fidelity));
  EXPECT_EQ(json["executed"]["wrong_of_actions"], 1);
  EXPECT_EQ(json["executed"]["wrong_led_astray"], 1);
  EXPECT_THAT(FidelityPage(fidelity), HasSubstr("Of 2 wrong outcomes of the closed loop, 1 is wrong about the very actions"));
  EXPECT_THAT(FidelityPage(FidelityOf(Sample())), Not(HasSubstr("the very actions"))) << "nobody asked";
}

TEST(Fidelity, RatesOfACellAreOverTheStatesThatCountInBothWorlds) {
  const Fidelity fidelity = FidelityOf(Sample());
  ASSERT_EQ(fidelity.cells.size(), 3u);
  const FidelityCell& bad = fidelity.cells[0];
  EXPECT_EQ(bad.checkpoint, "bad");
  EXPECT_EQ(bad.n, 9);
  EXPECT_DOUBLE_EQ(*bad.real, 1.0 / 9);
  EXPECT_DOUBLE_EQ(*bad.model, 2.0 / 9);
}

TEST(Fidelity, RanksOfRealityAgainstItselfAreWhatTheModelIsHeldAgainst) {
  const Fidelity fidelity = FidelityOf(Sample());
  EXPECT_DOUBLE_EQ(*fidelity.mmrv, 0) << "good > fair > bad in both";
  EXPECT_DOUBLE_EQ(*fidelity.mmrv_again, 0);
  EXPECT_GT(*fidelity.model.correlation.pearson.value, 0.9);
}

TEST(Fidelity, TheHorizonEndsWhereAStillPictureIsAsGood) {
  FidelityInput input = Sample();
  for (const double gain_db : {6.0, 3.0, 1.0, 5.0}) {
    ChunkDrift chunk;
    chunk.clips = 1;
    chunk.psnr_moving = 20 + gain_db;
    chunk.psnr_moving_copy = 20.0;
    input.horizon.push_back(chunk);
  }
  EXPECT_EQ(FidelityOf(input).usable_horizon_chunks, 2);
  input.horizon[2].psnr_moving = input.horizon[2].psnr_moving_copy = Undefined{"nothing moved"};
  EXPECT_EQ(FidelityOf(input).usable_horizon_chunks, 4) << "where reality stands still there is nothing to beat";
}

TEST(Fidelity, JsonHasEveryFieldAndSaysWhyOneIsNull) {
  const Json json = Json::parse(FidelityJson(FidelityOf(Sample())));
  for (const char* field : {"cells", "pearson", "pearson_low", "spearman", "mmrv", "mmrv_real_real", "agreement", "agreement_real_real",
                            "kappa", "hallucinated", "hallucinated_real_real", "missed", "missed_real_real", "open_loop",
                            "executed", "counterfactual", "usable_horizon_chunks", "seconds_per_chunk", "judge"})
    EXPECT_TRUE(json.contains(field)) << field;
  for (const char* field : {"n", "agreement", "hallucinated", "missed", "object_px_error_p85", "gripper_px_error_by_chunk", "psnr_by_chunk",
                            "psnr_moving_by_chunk", "psnr_moving_copy_by_chunk"})
    EXPECT_TRUE(json["open_loop"].contains(field)) << field;
  for (const char* field : {"auroc", "kappa", "ece", "kappa_masked"}) EXPECT_TRUE(json["judge"].contains(field)) << field;
  EXPECT_TRUE(json["seconds_per_chunk"].is_null());
  EXPECT_EQ(json["undefined"]["seconds_per_chunk"], "nothing was imagined");
  EXPECT_EQ(json["counterfactual"][0]["kind"], "shifted");
}

TEST(Fidelity, CsvLeavesEmptyWhatNobodyKnows) {
  const std::string csv = FidelityCsv(Sample().rows);
  EXPECT_THAT(csv, HasSubstr("kind,task,policy,checkpoint,initial_state,seed,real_outcome,real2_outcome,wm_verdict\n"));
  EXPECT_THAT(csv, HasSubstr("closed_loop,take_bottle,pick,bad,7-9,1,0,,\n"));
  EXPECT_THAT(csv, HasSubstr("open_loop,take_bottle,pick,good,7-3,1,0,,1\n"));
}

TEST(Fidelity, WithoutAJudgeNothingIsClaimed) {
  FidelityInput input = Sample();
  for (FidelityRow& row : input.rows) row.model.reset();
  const Fidelity fidelity = FidelityOf(std::move(input));
  EXPECT_EQ(fidelity.closed.n, 0);
  EXPECT_FALSE(fidelity.closed.agreement.value);
  EXPECT_FALSE(fidelity.model.correlation.pearson.value);
  EXPECT_THAT(FidelityText(fidelity), HasSubstr("Pearson –"));
}

TEST(Fidelity, WhereTwoMmrvsAreShownEachSaysOverWhat) {
  FidelityInput input = Sample();
  EXPECT_THAT(FidelityPage(FidelityOf(input)), Not(HasSubstr("It ranks all points as one list"))) << "of one task they are the same";
  for (std::size_t i = 0, n = input.rows.size(); i < n; ++i) {
    input.rows.push_back(input.rows[i]);
    input.rows.back().pair.task = "take_ham";
  }
  const Fidelity fidelity = FidelityOf(std::move(input));
  EXPECT_THAT(FidelityPage(fidelity), HasSubstr("MMRV within tasks"));
  EXPECT_THAT(FidelityText(fidelity), HasSubstr("MMRV within tasks"));
  ASSERT_FALSE(fidelity.model.by_task.empty());
  EXPECT_THAT(FidelityPage(fidelity), HasSubstr("It ranks all points as one list; within each task: below."));
}

TEST(Fidelity, ThePageEscapesWhatASuiteCalledItsPolicies) {
  FidelityInput input = Sample();
  for (FidelityRow& row : input.rows) row.pair.policy = "<script>alert(1)</script>";
  const std::string page = FidelityPage(FidelityOf(std::move(input)));
  EXPECT_THAT(page, Not(HasSubstr("<script>alert")));
  EXPECT_THAT(page, HasSubstr("&lt;script&gt;"));
}

}  // namespace
}  // namespace evac
