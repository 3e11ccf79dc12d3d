#include "core/error.h"
#include "core/statistics/planning.h"
#include "core/statistics/ppi.h"
#include "tests/core/statistics/golden_parts.h"

namespace evac::golden {
namespace {

BothWorlds Paired(const Json& in) {
  const Json& paired = in.at("paired");
  return {.both = paired.at("y1g1"),
          .only_real = paired.at("y1g0"),
          .only_model = paired.at("y0g1"),
          .neither = paired.at("y0g0")};
}

Count More(const Json& in) { return {in.at("unpaired_wm").at("k"), in.at("unpaired_wm").at("n")}; }

PpiWeight WeightFrom(const std::string& mode) {
  if (mode == "classical") return PpiWeight::kRealOnly;
  if (mode == "ppi") return PpiWeight::kFull;
  if (mode == "ppi++") return PpiWeight::kTuned;
  throw InvalidInput("statistics: a mode of {}, wanted classical, ppi or ppi++", mode);
}

Json Ppi(const Json& in) {
  const PpiEstimate estimate =
      PpiMean(Paired(in), More(in), WeightFrom(in.value("mode", "ppi++")), in.value("conf", 0.95));
  Json result = Ends(estimate.normal);
  result["estimate"] = ToJson(estimate.value);
  result["se"] = ToJson(estimate.se);
  result["lam"] = estimate.value ? Json(estimate.lambda) : Json(nullptr);
  result["lambda_raw"] = ToJson(estimate.tuned_lambda);
  return result;
}

Json Mover(const Json& in) {
  const BothWorlds paired = Paired(in);
  const Count more = More(in);
  const double confidence = in.value("conf", 0.95);
  const Estimate estimate = PpiMover(paired, more, confidence);
  Json result = Ends(estimate.interval);
  result["estimate"] = ToJson(estimate.value);
  result["wm_rate"] = ToJson(WilsonInterval(more.successes, more.trials, confidence).value);
  result["rectifier"] = ToJson(TangoDifference({{paired.only_real, paired.only_model}, paired.n()}, confidence).value);
  if (!estimate.value) result["lo"] = result["hi"] = nullptr;
  return result;
}

Promise PromiseFrom(const Json& in) { return {.alpha = in.value("alpha", 0.05), .power = in.value("power", 0.8)}; }

Json Size(const SampleSize& size, const char* exact, const char* rounded) {
  return {{exact, ToJson(size.exact)}, {rounded, size.exact ? Json(size.n) : Json(nullptr)}};
}

Json ForCorrelation(const Json& in) { return Size(PointsForCorrelation(in.at("r"), PromiseFrom(in)), "n_real", "n"); }

Json ForTwoProportions(const Json& in) {
  return Size(TrialsPerPolicy(in.at("p1"), in.at("p2"), PromiseFrom(in)), "n_per_arm_real", "n_per_arm");
}

Json ForHalfWidth(const Json& in) {
  return {{"n", TrialsForHalfWidth(in.at("p"), in.at("half_width"), in.value("conf", 0.95))}};
}

Json PowerOfFisher(const Json& in) {
  return {{"power", FisherPower(in.at("n_per_arm"), in.at("p1"), in.at("p2"), in.value("alpha", 0.05))}};
}

Json PowerOfMcNemar(const Json& in) {
  return {{"power", McNemarPower(in.at("n_pairs"), {in.at("p10"), in.at("p01")}, in.value("alpha", 0.05))}};
}

}  // namespace

Functions PlanningFunctions() {
  return {{"n_for_correlation", ForCorrelation},
          {"n_for_wilson_half_width", ForHalfWidth},
          {"n_two_proportions", ForTwoProportions},
          {"power_fisher_exact", PowerOfFisher},
          {"power_mcnemar_exact", PowerOfMcNemar},
          {"ppi_mean", Ppi},
          {"ppi_mover_ci", Mover}};
}

}  // namespace evac::golden
