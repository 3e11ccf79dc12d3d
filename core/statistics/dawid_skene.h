#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <optional>
#include <vector>

namespace evac {

/// What several raters said: counts[rater](item, label), how often (more than once where a rater saw an item again; 0
/// where the rating is missing). All matrices of one size.
struct RaterCounts {
  std::vector<Eigen::MatrixXd> of_rater;  ///< [raters] of [items, labels]
};

struct DawidSkeneOptions {
  double smoothing =
      0.5;  ///< added to every label's items and every cell of every rater's confusion; 0: maximum likelihood
  int max_iterations = 10000;
  std::optional<double> tolerance = 1e-12;  ///< stop when no posterior changes by this much; none: all iterations
};

/// The raters' error rates and the items' true labels, estimated together by expectation maximisation (Dawid & Skene
/// 1979). Starts from each item's share of votes; an item without votes starts at equal shares.
/// With 3 raters and fewer than 50 items it is unstable: to be shown, not to be decided by.
struct DawidSkene {
  Eigen::VectorXd prior;                   ///< [labels] share of each true label
  std::vector<Eigen::MatrixXd> confusion;  ///< [raters] of [true label, said label], rows sum to 1
  Eigen::MatrixXd posterior;               ///< [items, labels], rows sum to 1
  std::vector<std::int64_t> label;         ///< [items] most probable, the first of equals
  double log_likelihood = 0;
  int iterations = 0;
};
/// @throws InvalidInput without raters, items or labels, if sizes differ, a count is negative or an option out of
/// range.
DawidSkene FitDawidSkene(const RaterCounts& counts, const DawidSkeneOptions& options = {});

}  // namespace evac
