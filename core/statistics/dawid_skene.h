#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <optional>
#include <vector>

namespace evac {

/// What several raters said, without what they did not say: most raters see a small part of the items.
struct RaterCounts {
  /// That many times (more than one where a rater saw the item again) a rater called this item so.
  struct Said {
    Eigen::Index item = 0;   ///< 0 … items - 1
    Eigen::Index label = 0;  ///< 0 … labels - 1
    double count = 1;        ///< finite, not negative
  };
  Eigen::Index items = 0, labels = 0;
  std::vector<std::vector<Said>> of_rater{};  ///< [raters]
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
/// @throws InvalidInput without raters, items or labels, if an item, a label, a count or an option is out of range.
DawidSkene FitDawidSkene(const RaterCounts& counts, const DawidSkeneOptions& options = {});

}  // namespace evac
