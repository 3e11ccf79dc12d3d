#include "core/statistics/rater_agreement.h"

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <numeric>

#include "core/error.h"

namespace evac {
namespace {

using Counts = std::vector<std::vector<std::int64_t>>;

/// The number of ratings per item.
std::int64_t RatersOf(const Counts& counts) {
  const auto ratings = [](const std::vector<std::int64_t>& item) {
    return std::accumulate(item.begin(), item.end(), std::int64_t{0});
  };
  const std::int64_t raters = ratings(counts.front());
  for (const std::vector<std::int64_t>& item : counts) {
    if (item.size() != counts.front().size() || ratings(item) != raters) {
      throw InvalidInput(
          "statistics: Fleiss' kappa of items with {} and {} ratings in {} and {} categories, wanted the same number "
          "(Krippendorff's alpha allows missing ratings)",
          raters, ratings(item), counts.front().size(), item.size());
    }
    if (!item.empty() && std::ranges::min(item) < 0) throw InvalidInput("statistics: a negative number of ratings");
  }
  return raters;
}

/// kappa_j = 1 - sum_i n_ij (n - n_ij) / (N n (n - 1) p_j q_j).
Number KappaOfCategory(const Counts& counts, std::size_t category, double share) {
  if (share == 0 || share == 1) return Undefined{share == 0 ? "nobody chose it" : "everybody chose it"};
  const double n = static_cast<double>(RatersOf(counts));
  double split = 0;
  for (const std::vector<std::int64_t>& item : counts) {
    split += static_cast<double>(item[category]) * (n - static_cast<double>(item[category]));
  }
  return 1 - split / (static_cast<double>(counts.size()) * n * (n - 1) * share * (1 - share));
}

double NullSe(const FleissKappa& result) {
  double spread = 0, skew = 0;
  for (const double p : result.shares) {
    spread += p * (1 - p);
    skew += p * (1 - p) * (1 - 2 * p);
  }
  const double items = static_cast<double>(result.items), n = static_cast<double>(result.raters);
  return std::sqrt(2 / (items * n * (n - 1)) * (spread * spread - skew)) / spread;
}

using Ratings = std::vector<std::vector<std::optional<double>>>;

void Check(const Ratings& ratings, RatingMetric metric) {
  for (const auto& rater : ratings) {
    if (rater.size() != ratings.front().size()) {
      throw InvalidInput("statistics: raters with {} and {} items, wanted the same number", ratings.front().size(),
                         rater.size());
    }
    for (const std::optional<double>& rating : rater) {
      if (rating && (!std::isfinite(*rating) || (metric == RatingMetric::kRatio && *rating < 0))) {
        throw InvalidInput("statistics: a rating of {}, wanted a finite number, not negative for the ratio metric",
                           *rating);
      }
    }
  }
}

/// Every rating that has a partner: [items that have at least 2][ratings].
std::vector<std::vector<double>> Pairable(const Ratings& ratings) {
  std::vector<std::vector<double>> items;
  for (std::size_t item = 0; !ratings.empty() && item < ratings.front().size(); ++item) {
    std::vector<double> values;
    for (const auto& rater : ratings) {
      if (rater[item]) values.push_back(*rater[item]);
    }
    if (values.size() >= 2) items.push_back(std::move(values));
  }
  return items;
}

double Squared(double x) { return x * x; }

/// Distances between the values: [values, values]. @param totals  how often each value was given.
Eigen::MatrixXd Distances(const std::vector<double>& values, const Eigen::VectorXd& totals, RatingMetric metric) {
  const Eigen::Index n = totals.size();
  Eigen::MatrixXd distances = Eigen::MatrixXd::Zero(n, n);
  for (Eigen::Index c = 0; c < n; ++c) {
    for (Eigen::Index k = c + 1; k < n; ++k) {
      const double a = values[static_cast<std::size_t>(c)], b = values[static_cast<std::size_t>(k)];
      double distance = 1;
      if (metric == RatingMetric::kOrdinal) {
        distance = Squared(totals.segment(c, k - c + 1).sum() - (totals(c) + totals(k)) / 2);
      }
      if (metric == RatingMetric::kInterval) distance = Squared(a - b);
      if (metric == RatingMetric::kRatio) distance = Squared((a - b) / (a + b));
      distances(c, k) = distances(k, c) = distance;
    }
  }
  return distances;
}

/// o(c, k): ordered pairs of ratings within items, each item's weighted by 1 / (its ratings - 1).
Eigen::MatrixXd Coincidences(const std::vector<std::vector<double>>& items, const std::vector<double>& values) {
  const Eigen::Index n = static_cast<Eigen::Index>(values.size());
  Eigen::MatrixXd coincidences = Eigen::MatrixXd::Zero(n, n);
  const auto place = [&](double value) { return std::ranges::lower_bound(values, value) - values.begin(); };
  for (const std::vector<double>& item : items) {
    for (std::size_t a = 0; a < item.size(); ++a) {
      for (std::size_t b = 0; b < item.size(); ++b) {
        if (a != b) coincidences(place(item[a]), place(item[b])) += 1 / (static_cast<double>(item.size()) - 1);
      }
    }
  }
  return coincidences;
}

}  // namespace

FleissKappa FleissKappaOf(const Counts& counts) {
  FleissKappa result;
  if (counts.empty()) return result;
  result.raters = RatersOf(counts);
  result.items = static_cast<std::int64_t>(counts.size());
  const double n = static_cast<double>(result.raters), items = static_cast<double>(counts.size());
  result.kappa = result.agreement = result.chance = result.null_se = result.z = Undefined{"fewer than 2 raters"};
  if (result.raters < 2) return result;

  result.shares.assign(counts.front().size(), 0);
  double same = 0, chance = 0;
  for (const std::vector<std::int64_t>& item : counts) {
    for (std::size_t j = 0; j < item.size(); ++j) {
      const double count = static_cast<double>(item[j]);
      result.shares[j] += count;
      same += count * (count - 1);
    }
  }
  for (double& share : result.shares) {
    share /= items * n;
    chance += share * share;
  }
  const double agreement = same / (items * n * (n - 1));
  result.agreement = agreement;
  result.chance = chance;
  for (std::size_t j = 0; j < result.shares.size(); ++j) {
    result.kappa_of_category.push_back(KappaOfCategory(counts, j, result.shares[j]));
  }
  result.kappa = result.null_se = result.z = Undefined{"all ratings are one category"};
  if (std::ranges::max(result.shares) == 1) return result;
  const double kappa = (agreement - chance) / (1 - chance), se = NullSe(result);
  result.kappa = kappa;
  result.null_se = se;
  result.z = kappa / se;
  return result;
}

Number KrippendorffAlpha(const Ratings& ratings, RatingMetric metric) {
  Check(ratings, metric);
  const std::vector<std::vector<double>> items = Pairable(ratings);
  if (items.empty()) return Undefined{"no item has two ratings"};
  std::vector<double> values;
  for (const std::vector<double>& item : items) values.insert(values.end(), item.begin(), item.end());
  std::ranges::sort(values);
  const auto repeated = std::unique(values.begin(), values.end());
  values.erase(repeated, values.end());
  if (values.size() == 1) return Undefined{"all ratings are equal"};

  const Eigen::MatrixXd observed = Coincidences(items, values);
  const Eigen::VectorXd totals = observed.rowwise().sum();
  const Eigen::MatrixXd distances = Distances(values, totals, metric);
  const double n = totals.sum();
  const double expected = totals.dot(distances * totals);
  return 1 - (n - 1) * observed.cwiseProduct(distances).sum() / expected;
}

}  // namespace evac
