#include "core/error.h"
#include "core/statistics/bayes.h"
#include "core/statistics/betting.h"
#include "core/statistics/many_comparisons.h"
#include "core/statistics/rate_difference.h"
#include "core/statistics/sequential.h"
#include "core/statistics/stratified.h"
#include "core/statistics/two_by_two.h"
#include "tests/core/statistics/golden_parts.h"

namespace evac::golden {
namespace {

double Confidence(const Json& in) {
  return in.contains("alpha") ? 1 - in.at("alpha").get<double>() : in.value("conf", 0.95);
}

Json Hoeffding(const Json& in) {
  const Estimate rate = HoeffdingInterval(in.at("k"), in.at("n"), Confidence(in));
  return {{"p", ToJson(rate.value)}, {"ci", ToJson(rate.interval)}};
}

Json Newcombe(const Json& in) {
  const Estimate difference =
      NewcombeDifference({in.at("k1"), in.at("n1")}, {in.at("k2"), in.at("n2")}, Confidence(in));
  Json result = Ends(difference.interval);
  result["diff"] = ToJson(difference.value);
  return result;
}

Json PairedDifference(const Json& in) {
  const PairedOutcomes outcomes{{in.at("b"), in.at("c")}, in.at("n")};
  const Estimate tango = TangoDifference(outcomes, Confidence(in));
  return {{"diff", ToJson(tango.value)},
          {"tango", ToJson(tango.interval)},
          {"bonett_price", ToJson(BonettPriceDifference(outcomes, Confidence(in)).interval)}};
}

Json TwoByTwo(const Json& in) {
  const Count first{in.at("x1"), in.at("n1")}, second{in.at("x2"), in.at("n2")};
  const ExactTest fisher = FisherExact(first, second), barnard = BarnardExact(first, second),
                  boschloo = BoschlooExact(first, second);
  return {{"fisher_two_sided", fisher.two_sided},
          {"fisher_greater", fisher.greater},
          {"fisher_less", fisher.less},
          {"barnard_two_sided", barnard.two_sided},
          {"barnard_greater", barnard.greater},
          {"barnard_less", barnard.less},
          {"boschloo_two_sided", boschloo.two_sided},
          {"boschloo_greater", boschloo.greater},
          {"boschloo_less", boschloo.less},
          {"wald_pooled_z", PooledZ(first, second)}};
}

double OneOf(const ExactTest& test, const std::string& alternative) {
  if (alternative == "greater") return test.greater;
  if (alternative == "less") return test.less;
  if (alternative == "two-sided" || alternative == "two_sided") return test.two_sided;
  throw InvalidInput("statistics: an alternative of {}, wanted greater, less or two-sided", alternative);
}

Json Boschloo(const Json& in) {
  const Count first{in.at("x1"), in.at("n1")}, second{in.at("x2"), in.at("n2")};
  const std::string alternative = in.value("alternative", "two-sided");
  return {{"fisher_p", OneOf(FisherExact(first, second), alternative)},
          {"p", OneOf(BoschlooExact(first, second), alternative)}};
}

Json Cmh(const Json& in) {
  std::vector<Stratum> strata;
  for (const Json& stratum : in.at("strata")) {
    strata.push_back({{stratum.at("x1"), stratum.at("n1")}, {stratum.at("x2"), stratum.at("n2")}});
  }
  const StratifiedTest test = MantelHaenszel(strata);
  return {{"chi2", ToJson(test.chi2)},
          {"p", ToJson(test.p)},
          {"mh_odds_ratio", ToJson(test.odds_ratio)},
          {"mh_risk_difference", ToJson(test.risk_difference.value)}};
}

Json Cochran(const Json& in) {
  std::vector<std::vector<bool>> outcomes;
  for (const Json& state : in.at("success_item_by_policy")) {
    std::vector<bool>& row = outcomes.emplace_back();
    for (const Json& outcome : state) row.push_back(outcome.get<int>() != 0);
  }
  const CochranQ test = CochranQTest(outcomes);
  return {{"Q", ToJson(test.q)}, {"p", ToJson(test.p)}, {"df", test.degrees}};
}

Json PAdjust(const Json& in) {
  const std::vector<double> p_values = in.at("p");
  return {{"holm", HolmAdjusted(p_values)},
          {"bh", BenjaminiHochbergAdjusted(p_values)},
          {"bonferroni", BonferroniAdjusted(p_values)}};
}

Json Letters(const Json& in) {
  const std::vector<std::pair<std::size_t, std::size_t>> pairs = in.at("significant_pairs");
  return {{"letters", CompactLetters(in.at("n"), pairs)}};
}

Json ProbabilityBetter(const Json& in) {
  const BetaPrior prior{in.value("prior_a", 1.0), in.value("prior_b", 1.0)};
  return {{"p_first_better", ProbabilityGreater({in.at("k1"), in.at("n1")}, {in.at("k2"), in.at("n2")}, prior)}};
}

RateOrder OrderFrom(const std::string& alternative) {
  if (alternative == "p0<p1" || alternative == "less") return RateOrder::kFirstBelow;
  if (alternative == "p0>p1" || alternative == "greater") return RateOrder::kFirstAbove;
  if (alternative == "p0!=p1" || alternative == "two-sided") return RateOrder::kEither;
  throw InvalidInput("statistics: an alternative of {}, wanted p0<p1, p0>p1 or p0!=p1", alternative);
}

std::vector<bool> Outcomes(const Json& json) {
  std::vector<bool> outcomes;
  for (const Json& outcome : json) outcomes.push_back(outcome.get<int>() != 0);
  return outcomes;
}

Json Savi(const Json& in) {
  const SequentialTest test = TwoRatesSequential(Outcomes(in.at("s0")), Outcomes(in.at("s1")),
                                                 OrderFrom(in.value("alternative", "p0<p1")), in.value("alpha", 0.05));
  return {{"e_values", test.e_values},
          {"p_values", test.p_values},
          {"first_reject_n", test.first_reject ? Json(*test.first_reject) : Json(nullptr)}};
}

Json BetaBinomial(const Json& in) {
  const MixturePrior prior{in.value("prior_a", 0.5), in.value("prior_b", 0.5)};
  return Ends(ConfidenceSequence({in.at("k"), in.at("n")}, Confidence(in), prior).interval);
}

Json Betting(const Json& in) {
  const std::vector<double> values = in.at("x");
  const Estimate mean = BettingInterval(
      values, {.confidence = Confidence(in), .truncation = in.value("c", 0.5), .share = in.value("theta", 0.5)});
  Json result = Ends(mean.interval);
  result["mean"] = ToJson(mean.value);
  return result;
}

}  // namespace

Functions ComparisonFunctions() {
  return {{"beta_binomial_cs", BetaBinomial},
          {"beta_prob_greater", ProbabilityBetter},
          {"boschloo", Boschloo},
          {"cmh", Cmh},
          {"cochran_q", Cochran},
          {"compact_letters", Letters},
          {"hoeffding_ci", Hoeffding},
          {"newcombe_diff_ci", Newcombe},
          {"p_adjust", PAdjust},
          {"paired_diff_ci", PairedDifference},
          {"savi_two_proportions", Savi},
          {"two_by_two_exact", TwoByTwo},
          {"wsr_betting_ci", Betting}};
}

}  // namespace evac::golden
