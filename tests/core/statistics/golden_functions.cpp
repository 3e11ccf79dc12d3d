#include "tests/core/statistics/golden_functions.h"

#include <algorithm>
#include <functional>
#include <map>

#include "core/error.h"
#include "core/seed.h"
#include "core/statistics/association.h"
#include "core/statistics/bootstrap.h"
#include "core/statistics/mcnemar.h"
#include "core/statistics/mmrv.h"
#include "core/statistics/paired_bootstrap.h"
#include "core/statistics/rate_agreement.h"
#include "core/statistics/rates.h"
#include "core/statistics/special.h"
#include "tests/core/statistics/golden_parts.h"

namespace evac {
namespace {

using Json = nlohmann::json;
using Doubles = std::vector<double>;
using golden::ToJson;

// --- rates -----------------------------------------------------------------------------------------------------------

template <typename IntervalFunction>
Json Rate(const Json& in, IntervalFunction interval_of) {
  const Estimate rate = interval_of(in.at("k"), in.at("n"), in.value("conf", 0.95));
  return {{"p", ToJson(rate.value)}, {"lo", rate.interval->low}, {"hi", rate.interval->high}};
}
Json Wilson(const Json& in) { return Rate(in, WilsonInterval); }
Json ClopperPearson(const Json& in) { return Rate(in, ClopperPearsonInterval); }
Json Jeffreys(const Json& in) { return Rate(in, JeffreysInterval); }

std::vector<Count> Clusters(const Json& in) {
  std::vector<Count> clusters;
  for (const Json& outcomes : in.at("clusters")) {
    Count& count = clusters.emplace_back();
    for (const Json& outcome : outcomes) {
      count.successes += outcome.get<int>();
      ++count.trials;
    }
  }
  return clusters;
}

Json ClusterStats(const Json& in) {
  const ClusterStatistics statistics = StatisticsOfClusters(Clusters(in));
  return {{"rate", ToJson(statistics.rate)},
          {"icc_anova", ToJson(statistics.icc)},
          {"design_effect", ToJson(statistics.design_effect)},
          {"cluster_robust_se", ToJson(statistics.cluster_se)},
          {"naive_se", ToJson(statistics.naive_se)}};
}

Json McNemarTest(const Json& in) {
  const McNemar test = McNemarExact({.only_first = in.at("b"), .only_second = in.at("c")});
  return {{"p_exact", test.p_exact},
          {"p_mid", test.p_mid},
          {"chi2", ToJson(test.chi2)},
          {"p_chi2", ToJson(test.p_chi2)},
          {"chi2_cc", ToJson(test.chi2_corrected)}};
}

// --- association: x is the world under test, y the real one
// -------------------------------------------------------------

Json Correlations(const Json& in) {
  const Doubles x = in.at("x"), y = in.at("y");
  const Estimate pearson = Pearson(x, y), spearman = Spearman(x, y);
  const Kendall kendall = KendallTauB(x, y);
  return {{"n", x.size()},
          {"pearson", ToJson(pearson.value)},
          {"pearson_ci95", ToJson(pearson.interval)},
          {"pearson_p", ToJson(PearsonPValue(pearson))},
          {"spearman", ToJson(spearman.value)},
          {"spearman_ci95", ToJson(spearman.interval)},
          {"kendall_tau_b", ToJson(kendall.tau_b)},
          {"concordant", kendall.concordant},
          {"discordant", kendall.discordant},
          {"ties_x", kendall.ties_x},
          {"ties_y", kendall.ties_y}};
}

Json Agreement(const Json& in) {
  const RateAgreement agreement = AgreementOf({.real = in.at("y"), .sim = in.at("x")});
  return {{"bias", ToJson(agreement.bias)},
          {"mae", ToJson(agreement.mae)},
          {"rmse", ToJson(agreement.rmse)},
          {"max_abs", ToJson(agreement.max_abs)},
          {"ccc", ToJson(agreement.ccc)}};
}

Json RankViolation(const Json& in) {
  const RatePairs pairs{.real = in.at("real"), .sim = in.at("sim")};
  const MmrvResult code = Mmrv(pairs);
  const MmrvResult less = Mmrv(pairs, {.gap = MmrvGap::kReal, .ties = MmrvTies::kLess});
  const MmrvResult swapped = Mmrv(pairs, {.gap = MmrvGap::kSim, .ties = MmrvTies::kCode});
  return {{"mmrv", ToJson(code.mmrv)},
          {"per_policy", code.per_policy},
          {"mmrv_less_than_variant", ToJson(less.mmrv)},
          {"per_policy_less_than_variant", less.per_policy},
          {"mmrv_if_arguments_swapped", ToJson(swapped.mmrv)}};
}

// --- resampling
// --------------------------------------------------------------------------------------------------------

Json Splitmix64(const Json& in) {
  SplitMix64 random(in.at("seed").get<std::uint64_t>());
  Json values = Json::array();
  for (int i = 0; i < in.at("n").get<int>(); ++i) values.push_back(std::to_string(random.Next()));
  return {{"u64_as_decimal_strings", values}};
}

Json Splitmix64Below(const Json& in) {
  SplitMix64 random(in.at("seed").get<std::uint64_t>());
  Json values = Json::array();
  for (int i = 0; i < in.at("n").get<int>(); ++i) values.push_back(random.Below(in.at("bound").get<std::uint64_t>()));
  return {{"values", values}};
}

Json QuantileType7(const Json& in) {
  Doubles sorted = in.at("x");
  std::ranges::sort(sorted);
  Json values = Json::array();
  for (const Json& q : in.at("q")) values.push_back(Quantile(sorted, q));
  return {{"values", values}};
}

Json AllIntervals(const BootstrapIntervals& intervals) {
  return {{"percentile", ToJson(intervals.percentile)},
          {"basic", ToJson(intervals.basic)},
          {"bca", ToJson(intervals.bca)},
          {"z0", ToJson(intervals.z0)},
          {"acceleration", ToJson(intervals.acceleration)}};
}

Json BootstrapFromReplicates(const Json& in) {
  const Resampled resampled{in.at("theta"), in.at("replicates"), in.at("jackknife")};
  return AllIntervals(IntervalsOf(resampled, in.value("conf", 0.95)));
}

BootstrapOptions Options(const Json& in) {
  return {.replicates = in.at("B"), .seed = in.at("seed"), .confidence = in.value("conf", 0.95)};
}

Json First(const Doubles& values, std::size_t count) {
  return Doubles(values.begin(), values.begin() + static_cast<std::ptrdiff_t>(std::min(count, values.size())));
}

Json ClusterBootstrap(const Json& in) {
  const BootstrapOptions options = Options(in);
  const Resampled resampled = ClusterBootstrapRate(Clusters(in), options);
  double sum = 0;
  for (const double replicate : resampled.replicates) sum += replicate;
  Json result = AllIntervals(IntervalsOf(resampled, options.confidence));
  result["theta"] = resampled.theta;
  result["first5"] = First(resampled.replicates, 5);
  result["mean_replicates"] = sum / static_cast<double>(resampled.replicates.size());
  return result;
}

std::vector<Count> SingleTrials(const Json& outcomes) {
  std::vector<Count> states;
  for (const Json& outcome : outcomes) states.push_back({outcome.get<int>(), 1});
  return states;
}

Json PairedBootstrapOf(const Json& in) {
  TaskOutcomes task;
  for (std::size_t policy = 0; policy < in.at("wm").size(); ++policy) {
    task.points.push_back({.real = SingleTrials(in.at("real")[policy]), .sim = SingleTrials(in.at("wm")[policy])});
  }
  const RatePairs rates = RatesOf({task});
  const PairedBootstrap bootstrap = PairedStateBootstrap({task}, {}, Options(in));
  Json result = {{"wm_rates", rates.sim},
                 {"real_rates", rates.real},
                 {"pearson", ToJson(Pearson(rates.sim, rates.real).value)},
                 {"mmrv", ToJson(Mmrv(rates).mmrv)},
                 {"pearson_percentile", nullptr},
                 {"mmrv_percentile", nullptr}};
  if (bootstrap.pearson) {
    result["pearson_percentile"] = ToJson(bootstrap.pearson->intervals.percentile);
    result["undefined_pearson_replicates"] = bootstrap.pearson->undefined;
    result["pearson_first3"] = First(bootstrap.pearson->resampled.replicates, 3);
  }
  if (bootstrap.mmrv) {
    result["mmrv_percentile"] = ToJson(bootstrap.mmrv->intervals.percentile);
    result["mmrv_first3"] = First(bootstrap.mmrv->resampled.replicates, 3);
  }
  return result;
}

// --- special functions
// ---------------------------------------------------------------------------------------------------

/// {"values": function of each element of in[key]}.
Json Each(const Json& in, const char* key, const std::function<double(const Json&)>& function) {
  Json values = Json::array();
  for (const Json& argument : in.at(key)) values.push_back(function(argument));
  return {{"values", values}};
}
Json NormPpf(const Json& in) {
  return Each(in, "x", [](const Json& x) { return NormalQuantile(x); });
}
Json NormCdf(const Json& in) {
  return Each(in, "x", [](const Json& x) { return NormalCdf(x); });
}
Json BetaincReg(const Json& in) {
  return Each(in, "a_b_x", [](const Json& a) { return BetaCdf(a[0], a[1], a[2]); });
}
Json BetaPpf(const Json& in) {
  return Each(in, "q_a_b", [](const Json& a) { return BetaQuantile(a[0], a[1], a[2]); });
}
Json Chi2Sf(const Json& in) {
  return Each(in, "x_df", [](const Json& a) { return ChiSquareTail(a[0], a[1]); });
}

golden::Functions OwnFunctions() {
  return {
      {"beta_ppf", BetaPpf},
      {"betainc_reg", BetaincReg},
      {"bootstrap_ci_from_replicates", BootstrapFromReplicates},
      {"chi2_sf", Chi2Sf},
      {"clopper_pearson_ci", ClopperPearson},
      {"cluster_bootstrap_rate", ClusterBootstrap},
      {"cluster_stats", ClusterStats},
      {"correlations", Correlations},
      {"jeffreys_ci", Jeffreys},
      {"mcnemar", McNemarTest},
      {"mmrv", RankViolation},
      {"norm_cdf", NormCdf},
      {"norm_ppf", NormPpf},
      {"paired_state_bootstrap", PairedBootstrapOf},
      {"quantile_type7", QuantileType7},
      {"rate_agreement", Agreement},
      {"splitmix64", Splitmix64},
      {"splitmix64_below", Splitmix64Below},
      {"wilson_ci", Wilson},
  };
}

const golden::Functions& AllFunctions() {
  static const golden::Functions functions = [] {
    golden::Functions all = OwnFunctions();
    all.merge(golden::RaterFunctions());
    all.merge(golden::ComparisonFunctions());
    all.merge(golden::PlanningFunctions());
    return all;
  }();
  return functions;
}

}  // namespace

Json CallGolden(const std::string& fn, const Json& inputs) {
  const auto function = AllFunctions().find(fn);
  if (function == AllFunctions().end()) throw InvalidInput("statistics: no function is called {}", fn);
  return function->second(inputs);
}

std::vector<std::string> GoldenNames() {
  std::vector<std::string> names;
  for (const auto& [name, function] : AllFunctions()) names.push_back(name);
  return names;
}

}  // namespace evac
