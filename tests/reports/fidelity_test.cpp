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
         const std::string& again, const std::string& model, const std::string& task = "take_bottle") {
  for (std::size_t i = 0; i < real.size(); ++i)
    rows.push_back({kind, {task, "7-" + std::to_string(i), "pick", checkpoint, 1}, Outcome(real[i]),
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

TEST(Fidelity, PoliciesThatErrInTheSameStatesTellNoMoreThanOneOfThem) {
  const auto match = [](int policies) {
    std::vector<FidelityRow> rows;
    for (int i = 0; i < policies; ++i) Add(rows, "closed_loop", std::to_string(i), "ssssssffffff", "------------", "ssssssffssss");
    return MatchOf(rows, "closed_loop", FidelityColumn::kModel);
  };
  const OutcomeMatch one = match(1), five = match(5);
  EXPECT_EQ(five.n, 5 * one.n);
  EXPECT_DOUBLE_EQ(*five.hallucinated.value, 4.0 / 6);
  for (Estimate OutcomeMatch::*number : {&OutcomeMatch::agreement, &OutcomeMatch::hallucinated}) {
    EXPECT_NEAR((five.*number).interval->low, (one.*number).interval->low, 1e-9);
    EXPECT_NEAR((five.*number).interval->high, (one.*number).interval->high, 1e-9);
  }
  EXPECT_LE(five.kappa.interval->low, one.kappa.interval->low);
  EXPECT_EQ(one.agreement.method, "Wilson");
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

/// Two policies on two tasks; no two numbers of it are alike, so that none can stand where another belongs.
FidelityInput TwoTasks() {
  FidelityInput input;
  Add(input.rows, "closed_loop", "good", "ssssssssff", "ssssssssff", "ssssffffss", "take_bottle");
  Add(input.rows, "closed_loop", "bad", "sssfffffff", "ssffffffff", "sssssfffff", "take_bottle");
  Add(input.rows, "closed_loop", "good", "sssssfffff", "sssffsffff", "sss-ffff--", "take_ham");
  Add(input.rows, "closed_loop", "bad", "ssssffffff", "sssssfssff", "ssssfff-ff", "take_ham");
  Add(input.rows, "open_loop", "good", "sssff", "-----", "ssfsf");
  Add(input.rows, "executed", "good", "ssfff", "-----", "sffss");
  Add(input.rows, "counterfactual:shifted", "good", "fffs", "----", "ffss");
  return input;
}

TEST(Fidelity, JsonSaysOfTheModelWhatIsOfTheModelAndOfRealityWhatIsOfReality) {
  const Json json = Json::parse(FidelityJson(FidelityOf(TwoTasks())));
  EXPECT_EQ(json["n"], 36);
  EXPECT_DOUBLE_EQ(json["agreement"], 27.0 / 36);
  EXPECT_DOUBLE_EQ(json["hallucinated"], 4.0 / 17);
  EXPECT_DOUBLE_EQ(json["missed"], 5.0 / 19);
  EXPECT_EQ(json["n_real_real"], 40);
  EXPECT_DOUBLE_EQ(json["agreement_real_real"], 33.0 / 40);
  EXPECT_DOUBLE_EQ(json["hallucinated_real_real"], 4.0 / 20);
  EXPECT_DOUBLE_EQ(json["missed_real_real"], 3.0 / 20);
  EXPECT_EQ(json["told_real_real"]["n"], 36) << "without the four clips that the judge could not tell";
  EXPECT_DOUBLE_EQ(json["told_real_real"]["agreement"], 31.0 / 36);
  EXPECT_DOUBLE_EQ(json["told_real_real"]["hallucinated"], 3.0 / 17);
  EXPECT_DOUBLE_EQ(json["told_real_real"]["missed"], 2.0 / 19);
  const Json& ham = json["cells"][3];
  EXPECT_EQ(ham["task"], "take_ham");
  EXPECT_EQ(ham["checkpoint"], "good");
  EXPECT_EQ(ham["n"], 7);
  EXPECT_EQ(ham["n_real_real"], 10);
  EXPECT_DOUBLE_EQ(ham["real_sr"], 4.0 / 7);
  EXPECT_DOUBLE_EQ(ham["real2_sr"], 4.0 / 10);
  EXPECT_DOUBLE_EQ(ham["wm_sr"], 3.0 / 7);
  EXPECT_DOUBLE_EQ(ham["agreement"], 6.0 / 7);
}

/// Over the ham, reality ranks good above bad (4/7, 4/9) and the model does not (3/7, 4/9): the violation is reality's gap.
TEST(Fidelity, RankViolationsAreRealitysGapsAveragedOverTasks) {
  const Json json = Json::parse(FidelityJson(FidelityOf(TwoTasks())));
  EXPECT_NEAR(json["mmrv"], (0 + (4.0 / 7 - 4.0 / 9)) / 2, 1e-12);
  EXPECT_NEAR(json["mmrv_real_real"], (0 + (5.0 / 10 - 4.0 / 10)) / 2, 1e-12);
}

TEST(Fidelity, JsonSaysWhatEachPartCameTo) {
  FidelityInput input = TwoTasks();
  input.open_loop.object_px = {1, 2, 3};
  input.parts = {{"closed", 120, 0}, {"open", 40, 2, "evac/take_ham: NaN"}};
  ChunkDrift chunk;
  chunk.clips = 5;
  chunk.psnr = 31.0;
  chunk.psnr_moving = 22.0;
  chunk.psnr_moving_copy = 15.0;
  chunk.gripper_px = 1.5;
  chunk.gripper_found = 0.75;
  input.open_loop.chunks = {chunk, {}};
  const Json json = Json::parse(FidelityJson(FidelityOf(input)));
  const Json& open = json["open_loop"];
  EXPECT_EQ(open["n"], 5);
  EXPECT_DOUBLE_EQ(open["agreement"], 3.0 / 5);
  EXPECT_DOUBLE_EQ(open["hallucinated"], 1.0 / 2);
  EXPECT_DOUBLE_EQ(open["missed"], 1.0 / 3);
  EXPECT_NEAR(open["object_px_error_p85"], 2.7, 1e-12);
  EXPECT_EQ(open["clips_by_chunk"], Json::parse("[5, 0]"));
  EXPECT_EQ(open["psnr_by_chunk"], Json::parse("[31.0, null]"));
  EXPECT_EQ(open["psnr_moving_by_chunk"], Json::parse("[22.0, null]"));
  EXPECT_EQ(open["psnr_moving_copy_by_chunk"], Json::parse("[15.0, null]"));
  EXPECT_EQ(open["gripper_px_error_by_chunk"], Json::parse("[1.5, null]"));
  EXPECT_EQ(open["gripper_found_by_chunk"], Json::parse("[0.75, null]"));
  EXPECT_DOUBLE_EQ(json["executed"]["agreement"], 2.0 / 5);
  EXPECT_DOUBLE_EQ(json["executed"]["hallucinated"], 2.0 / 3);
  EXPECT_DOUBLE_EQ(json["executed"]["missed"], 1.0 / 2);
  EXPECT_EQ(json["counterfactual"], Json::parse(R"([{"kind": "shifted", "n": 4, "hallucinated": 0.3333333333333333}])"));
  EXPECT_EQ(json["parts"], Json::parse(R"([{"part": "closed", "episodes": 120, "failed": 0}, {"part": "open", "episodes": 40, "failed": 2}])"));
}

TEST(Fidelity, JsonHasEveryFieldAndSaysWhyOneIsNull) {
  FidelityInput input;
  Add(input.rows, "closed_loop", "good", "sff", "sff", "sff");
  Add(input.rows, "open_loop", "good", "sff", "---", "---");
  const Json json = Json::parse(FidelityJson(FidelityOf(std::move(input))));
  for (const char* field : {"cells", "pearson", "pearson_low", "spearman", "mmrv", "mmrv_real_real", "kappa", "open_loop", "executed",
                            "counterfactual", "horizon", "usable_horizon_chunks", "seconds_per_chunk", "judge"})
    EXPECT_TRUE(json.contains(field)) << field;
  for (const char* field : {"auroc", "kappa", "ece", "kappa_masked"}) EXPECT_TRUE(json["judge"].contains(field)) << field;
  EXPECT_TRUE(json["seconds_per_chunk"].is_null());
  EXPECT_EQ(json["undefined"]["seconds_per_chunk"], "nothing was imagined");
  EXPECT_TRUE(json["usable_horizon_chunks"].is_null());
  EXPECT_EQ(json["undefined"]["usable_horizon_chunks"], "no long rollouts");
  EXPECT_EQ(json["open_loop"]["undefined"]["hallucinated"], "no pairs") << "nobody could tell: not that nothing failed";
  EXPECT_EQ(json["executed"]["undefined"]["missed"], "nothing was asked");
}

TEST(Fidelity, SaysWhatHasNoOutcomeAndWhatFailed) {
  FidelityInput input = Sample();
  const std::string none = FidelityPage(FidelityOf(input));
  EXPECT_THAT(none, Not(HasSubstr("in no number")));
  EXPECT_THAT(none, HasSubstr("29 of 30")) << "one state of bad has no imagined outcome";
  input.parts = {{"closed", 90, 0}, {"open", 40, 2, "evac/take_bottle: <NaN>"}};
  const Fidelity fidelity = FidelityOf(std::move(input));
  EXPECT_THAT(FidelityPage(fidelity), HasSubstr("open: 2 of 40 episodes failed and are in no number; the last: evac/take_bottle: &lt;NaN&gt;"));
  EXPECT_THAT(FidelityText(fidelity), HasSubstr("open: 2 of 40 episodes failed and are in no number; the last: evac/take_bottle: <NaN>"));
  EXPECT_THAT(FidelityText(fidelity), Not(HasSubstr("closed: ")));
}

TEST(Fidelity, RealityIsAlsoHeldAgainstItselfOverThePairsThatTheModelIsHeldAgainst) {
  const Fidelity fidelity = FidelityOf(TwoTasks());
  EXPECT_THAT(FidelityPage(fidelity), HasSubstr("reality against reality, of the closed loop&#39;s pairs"));
  EXPECT_THAT(FidelityText(fidelity), HasSubstr("real against real, of the closed loop's pairs"));
  FidelityInput all_told = TwoTasks();
  for (FidelityRow& row : all_told.rows) row.model = row.real;
  EXPECT_THAT(FidelityPage(FidelityOf(std::move(all_told))), Not(HasSubstr("of the closed loop&#39;s pairs"))) << "they are the same";
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

/// A kappa of nothing is -2e-16 where it is added up.
TEST(Fidelity, ThePageHasNoNegativeZero) {
  FidelityInput input = Sample();
  input.judge.kappa_masked = -2.3e-16;
  EXPECT_THAT(FidelityPage(FidelityOf(input)), HasSubstr("with the object painted over 0.00."));
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

TEST(Fidelity, RecordingsThatFailedAreNotCountedAsReplayed) {
  FidelityInput input;
  for (const char* model_video : {"open/model.mp4", ""}) {
    FidelityRow& row = input.rows.emplace_back();
    row.kind = "open_loop";
    row.real_video = "open/real.mp4";
    row.model_video = model_video;
  }
  input.horizon = {ChunkDrift{.clips = 1, .psnr = 30.0, .psnr_moving = 20.0, .psnr_moving_copy = 15.0}};
  const std::string some = FidelityPage(FidelityOf(input));
  EXPECT_THAT(some, HasSubstr("1 of 2 recordings replayed"));
  EXPECT_THAT(some, HasSubstr("better than a picture that stands still for 1 chunk."));
  input.rows[0].model_video.clear();
  input.horizon.clear();
  const std::string none = FidelityPage(FidelityOf(input));
  EXPECT_THAT(none, HasSubstr("0 of 2 recordings replayed"));
  EXPECT_THAT(none, HasSubstr("Nothing could be compared."));
  EXPECT_THAT(none, Not(HasSubstr("not a single chunk")));
}

/// 199 of 200 were 100 % here, and nowhere else.
TEST(Fidelity, ThePageSaysAllOfAllAlone) {
  FidelityInput input;
  const std::string real = std::string(100, 's') + std::string(100, 'f'), model = real.substr(0, 199) + "s";
  Add(input.rows, "closed_loop", "good", real, real, model);
  const std::string page = FidelityPage(FidelityOf(std::move(input)));
  EXPECT_THAT(page, HasSubstr("agreement 99.5 % <span class=\"quiet\">["));
  EXPECT_THAT(page, HasSubstr("(reality against itself 100 % <span class=\"quiet\">[98, 100]</span>)"));
  EXPECT_THAT(page, HasSubstr("<td class=\"num\">99.5 %</td>")) << "its cell";
}

TEST(Fidelity, ThePageEscapesWhatASuiteCalledItsPolicies) {
  FidelityInput input = Sample();
  for (FidelityRow& row : input.rows) row.pair.policy = "<script>alert(1)</script>";
  const std::string page = FidelityPage(FidelityOf(std::move(input)));
  EXPECT_THAT(page, Not(HasSubstr("<script>alert")));
  EXPECT_THAT(page, HasSubstr("&lt;script&gt;"));
}

TEST(Fidelity, ARateOverOtherPairsThanTheRestOfItsRowSaysOverHowMany) {
  FidelityInput input = Sample();
  Add(input.rows, "closed_loop", "few", "ssff", "ssff", "ss--");
  const Fidelity fidelity = FidelityOf(std::move(input));
  EXPECT_THAT(FidelityPage(fidelity), HasSubstr("<td class=\"num\">50 % of 4</td>"));
  EXPECT_THAT(FidelityText(fidelity), HasSubstr("0.500 of 4"));
  EXPECT_THAT(FidelityText(fidelity), Not(HasSubstr(" of 10"))) << "the same pairs as the rest";
}

}  // namespace
}  // namespace evac
