#include "core/error.h"
#include "core/statistics/bradley_terry.h"
#include "core/statistics/calibration.h"
#include "core/statistics/confusion.h"
#include "core/statistics/dawid_skene.h"
#include "core/statistics/rater_agreement.h"
#include "core/statistics/special.h"
#include "core/statistics/votes.h"
#include "tests/core/statistics/golden_parts.h"

namespace evac::golden {
namespace {

Vote VoteFrom(const Json& json) {
  if (json.is_null()) return Vote::kMissing;
  if (json == "S") return Vote::kSuccess;
  if (json == "F") return Vote::kFailure;
  if (json == "U") return Vote::kUnsure;
  throw InvalidInput("statistics: a vote of {}, wanted S, F, U or null", json.dump());
}

Json MajorityVote(const Json& in) {
  std::vector<Vote> votes;
  for (const Json& vote : in.at("votes")) votes.push_back(VoteFrom(vote));
  const Majority majority = MajorityOf(votes);
  return {{"label", majority.success ? Json(*majority.success ? "S" : "F") : Json(nullptr)},
          {"n_valid", majority.valid},
          {"n_success", majority.successes},
          {"n_unsure", majority.unsure},
          {"split", majority.split},
          {"margin", majority.margin},
          {"soft", ToJson(majority.soft)}};
}

Json Blinding(const Json& in) {
  const BlindingIndex index =
      BangBlindingIndex({.correct = in.at("correct"), .incorrect = in.at("incorrect"), .unsure = in.at("dont_know")});
  return {{"bi", ToJson(index.index)}, {"se", ToJson(index.se)}};
}

Json Fleiss(const Json& in) {
  const FleissKappa fleiss = FleissKappaOf(in.at("counts").get<std::vector<std::vector<std::int64_t>>>());
  Json of_category = Json::array();
  for (const Number& kappa : fleiss.kappa_of_category) of_category.push_back(ToJson(kappa));
  return {{"kappa", ToJson(fleiss.kappa)}, {"P_bar", ToJson(fleiss.agreement)},
          {"P_e", ToJson(fleiss.chance)},  {"p_j", fleiss.shares},
          {"kappa_j", of_category},        {"se0", ToJson(fleiss.null_se)},
          {"z", ToJson(fleiss.z)}};
}

RatingMetric MetricFrom(const std::string& name) {
  if (name == "nominal") return RatingMetric::kNominal;
  if (name == "ordinal") return RatingMetric::kOrdinal;
  if (name == "interval") return RatingMetric::kInterval;
  if (name == "ratio") return RatingMetric::kRatio;
  throw InvalidInput("statistics: a metric of {}, wanted nominal, ordinal, interval or ratio", name);
}

Json Krippendorff(const Json& in) {
  std::vector<std::vector<std::optional<double>>> ratings;
  for (const Json& rater : in.at("ratings_by_rater")) {
    std::vector<std::optional<double>>& row = ratings.emplace_back();
    for (const Json& rating : rater) {
      row.push_back(rating.is_null() ? std::nullopt : std::optional(rating.get<double>()));
    }
  }
  return {{"alpha", ToJson(KrippendorffAlpha(ratings, MetricFrom(in.value("metric", "nominal"))))}};
}

/// The golden file's interval goes on beyond 1 where the estimate is near it; ours, which people read, does not.
Json WaldInterval(const Number& value, const Number& se) {
  if (!value || !se) return Json::array({nullptr, nullptr});
  const double half = TwoSidedZ(0.95) * *se;
  return Json::array({*value - half, *value + half});
}

Json ConfusionStats(const Json& in) {
  const ConfusionStatistics s = StatisticsOf({.both_success = in.at("tp"),
                                              .only_judge_success = in.at("fp"),
                                              .only_human_success = in.at("fn"),
                                              .both_failure = in.at("tn")});
  return {{"n", s.n},
          {"accuracy", ToJson(s.accuracy)},
          {"p_e", ToJson(s.chance)},
          {"kappa", ToJson(s.kappa.value)},
          {"kappa_se", ToJson(s.kappa_se)},
          {"kappa_ci95", WaldInterval(s.kappa.value, s.kappa_se)},
          {"pabak", ToJson(s.pabak)},
          {"gwet_ac1", ToJson(s.gwet_ac1)},
          {"mcc", ToJson(s.matthews)},
          {"sensitivity", ToJson(s.sensitivity.value)},
          {"specificity", ToJson(s.specificity.value)},
          {"balanced_accuracy", ToJson(s.balanced_accuracy)},
          {"precision", ToJson(s.precision)},
          {"f1", ToJson(s.f1)},
          {"bias_judge_minus_human", ToJson(s.bias)}};
}

Json RoganGladenRate(const Json& in) {
  const CorrectedRate rate =
      RoganGladen({.rate = in.at("p_judge"), .n = in.at("n_judge")}, {.sensitivity = in.at("sens"),
                                                                      .specificity = in.at("spec"),
                                                                      .positives = in.at("n_pos"),
                                                                      .negatives = in.at("n_neg")});
  return {{"p_raw", ToJson(rate.raw)}, {"p", ToJson(rate.rate)}, {"se", ToJson(rate.se)}};
}

Json CalibrationStats(const Json& in) {
  const std::vector<double> probabilities = in.at("prob");
  const std::vector<int> labels = in.at("label");
  const Calibration calibration =
      CalibrationOf(probabilities, labels, {.bins = in.value("bins", 10), .epsilon = in.value("eps", 1e-6)});
  return {{"brier", ToJson(calibration.brier.value)},
          {"ece", ToJson(calibration.ece)},
          {"logloss", ToJson(calibration.log_loss)}};
}

/// counts[item][rater][label], or votes_item_by_rater[item][rater] = label or null.
RaterCounts CountsFrom(const Json& in) {
  const bool has_counts = in.contains("counts");
  const Json& items = in.at(has_counts ? "counts" : "votes_item_by_rater");
  if (items.empty() || items[0].empty()) return {};
  RaterCounts counts;
  counts.items = static_cast<Eigen::Index>(items.size());
  counts.labels = has_counts ? static_cast<Eigen::Index>(items[0][0].size()) : in.at("n_labels").get<Eigen::Index>();
  counts.of_rater.resize(items[0].size());
  for (std::size_t item = 0; item < items.size(); ++item) {
    const auto row = static_cast<Eigen::Index>(item);
    for (std::size_t rater = 0; rater < counts.of_rater.size(); ++rater) {
      const Json& said = items[item].at(rater);
      auto& of_rater = counts.of_rater[rater];
      if (!has_counts && !said.is_null()) of_rater.push_back({row, said.get<Eigen::Index>(), 1});
      for (Eigen::Index label = 0; has_counts && label < counts.labels; ++label)
        of_rater.push_back({row, label, said.at(static_cast<std::size_t>(label)).get<double>()});
    }
  }
  return counts;
}

Json Rows(const Eigen::MatrixXd& matrix) {
  Json rows = Json::array();
  for (Eigen::Index row = 0; row < matrix.rows(); ++row) {
    rows.push_back(std::vector<double>());
    for (Eigen::Index column = 0; column < matrix.cols(); ++column) rows.back().push_back(matrix(row, column));
  }
  return rows;
}

Json DawidSkeneFit(const Json& in) {
  DawidSkeneOptions options{.smoothing = in.value("smoothing", 0.0), .max_iterations = in.value("max_iter", 10000)};
  options.tolerance = std::nullopt;
  if (in.contains("tol") && !in.at("tol").is_null()) options.tolerance = in.at("tol").get<double>();
  const DawidSkene model = FitDawidSkene(CountsFrom(in), options);
  Json error_rates = Json::array(), map = Json::array(), p_success = nullptr;
  for (const Eigen::MatrixXd& confusion : model.confusion) error_rates.push_back(Rows(confusion));
  for (const std::int64_t label : model.label) map.push_back(label + 1);
  if (model.posterior.cols() == 2) {
    p_success = std::vector<double>(model.posterior.col(1).begin(), model.posterior.col(1).end());
  }
  return {{"class_prior", std::vector<double>(model.prior.begin(), model.prior.end())},
          {"error_rates", error_rates},
          {"posterior", Rows(model.posterior)},
          {"p_success", p_success},
          {"loglik", model.log_likelihood},
          {"map", map}};
}

Json BradleyTerryFit(const Json& in) {
  const Json& rows = in.at("wins");
  const auto n = static_cast<Eigen::Index>(rows.size());
  Eigen::MatrixXd wins(n, n);
  for (Eigen::Index i = 0; i < n; ++i) {
    if (rows[static_cast<std::size_t>(i)].size() != rows.size()) {
      throw InvalidInput("statistics: {} wins of {} policies, wanted a square",
                         rows[static_cast<std::size_t>(i)].size(), n);
    }
    for (Eigen::Index j = 0; j < n; ++j) wins(i, j) = rows[static_cast<std::size_t>(i)][static_cast<std::size_t>(j)];
  }
  const Defined<BradleyTerry> fit = FitBradleyTerry(wins, in.value("ridge", 0.0));
  Json result;
  for (const char* key : {"beta", "beta_centered", "beta_minus_last", "loglik", "se_diff_first_last"})
    result[key] = nullptr;
  if (!fit) return result;
  const Eigen::VectorXd& strength = fit->strength;
  const Eigen::VectorXd minus_last = strength.array() - strength(n - 1);
  result["beta"] = result["beta_centered"] = std::vector<double>(strength.begin(), strength.end());
  result["beta_minus_last"] = std::vector<double>(minus_last.begin(), minus_last.end());
  result["loglik"] = fit->log_likelihood;
  result["se_diff_first_last"] = fit->SeOfDifference(0, n - 1);
  return result;
}

}  // namespace

Functions RaterFunctions() {
  return {{"bang_blinding_index", Blinding},    {"bradley_terry", BradleyTerryFit}, {"calibration", CalibrationStats},
          {"confusion_stats", ConfusionStats},  {"dawid_skene", DawidSkeneFit},     {"fleiss_kappa", Fleiss},
          {"krippendorff_alpha", Krippendorff}, {"majority_vote", MajorityVote},    {"rogan_gladen", RoganGladenRate}};
}

}  // namespace evac::golden
