#include "core/statistics/dawid_skene.h"

#include <cmath>

#include "core/error.h"

namespace evac {
namespace {

void Check(const RaterCounts& counts, const DawidSkeneOptions& options) {
  if (counts.of_rater.empty() || counts.items < 1 || counts.labels < 1)
    throw InvalidInput("statistics: Dawid-Skene wants at least one rater, item and label");
  for (const std::vector<RaterCounts::Said>& rater : counts.of_rater) {
    for (const RaterCounts::Said& said : rater) {
      if (said.item < 0 || said.item >= counts.items || said.label < 0 || said.label >= counts.labels)
        throw InvalidInput("statistics: label {} of item {}, wanted one of {} labels of {} items", said.label,
                           said.item, counts.labels, counts.items);
      if (!std::isfinite(said.count) || said.count < 0)
        throw InvalidInput("statistics: a count is negative or not finite");
    }
  }
  if (!(options.smoothing >= 0) || options.max_iterations < 1) {
    throw InvalidInput("statistics: smoothing {} and {} iterations, wanted at least 0 and 1", options.smoothing,
                       options.max_iterations);
  }
}

/// Each column divided by its sum; equal shares where that is 0.
void MakeColumnsShares(Eigen::MatrixXd& weights) {
  for (Eigen::Index column = 0; column < weights.cols(); ++column) {
    const double sum = weights.col(column).sum();
    if (sum > 0)
      weights.col(column) /= sum;
    else
      weights.col(column).setConstant(1.0 / static_cast<double>(weights.rows()));
  }
}

/// What the iterations work on: a label's numbers of one item lie side by side, a vote costs a few multiplications.
struct Fit {
  const RaterCounts& counts;
  Eigen::MatrixXd posterior;               ///< [labels, items]
  Eigen::VectorXd prior;                   ///< [labels]
  std::vector<Eigen::MatrixXd> confusion;  ///< [raters] of [said label, true label], columns sum to 1
  double log_likelihood = 0;

  explicit Fit(const RaterCounts& given)
      : counts(given),
        posterior(Eigen::MatrixXd::Zero(given.labels, given.items)),
        confusion(given.of_rater.size(), Eigen::MatrixXd(given.labels, given.labels)) {
    for (const auto& rater : counts.of_rater) {
      for (const RaterCounts::Said& said : rater) posterior(said.label, said.item) += said.count;
    }
    MakeColumnsShares(posterior);
  }

  void Maximise(double smoothing) {
    prior = posterior.rowwise().sum().array() + smoothing;
    prior /= prior.sum();
    for (std::size_t r = 0; r < confusion.size(); ++r) {
      confusion[r].setConstant(smoothing);
      for (const RaterCounts::Said& said : counts.of_rater[r]) {
        for (Eigen::Index label = 0; label < counts.labels; ++label)
          confusion[r](said.label, label) += said.count * posterior(label, said.item);
      }
      MakeColumnsShares(confusion[r]);
    }
  }

  /// log P(all that was said of the item and its true label), [labels, items]; -inf where impossible.
  Eigen::MatrixXd LogJoint() const {
    Eigen::MatrixXd log_joint = prior.array().log().matrix().replicate(1, counts.items);
    for (std::size_t r = 0; r < confusion.size(); ++r) {
      const Eigen::MatrixXd log_confusion = confusion[r].array().log();
      for (const RaterCounts::Said& said : counts.of_rater[r]) {
        if (said.count == 0) continue;  // 0 log 0 = 0
        for (Eigen::Index label = 0; label < counts.labels; ++label)
          log_joint(label, said.item) += said.count * log_confusion(said.label, label);
      }
    }
    return log_joint;
  }

  /// Bayes in log space. @returns the largest change of a posterior.
  double Expect() {
    Eigen::MatrixXd weights = LogJoint();
    const Eigen::RowVectorXd most = weights.colwise().maxCoeff();
    weights = (weights.rowwise() - most).array().exp();
    const Eigen::RowVectorXd sums = weights.colwise().sum();
    weights.array().rowwise() /= sums.array();
    log_likelihood = most.sum() + sums.array().log().sum();
    posterior.swap(weights);
    return (posterior - weights).cwiseAbs().maxCoeff();
  }
};

}  // namespace

DawidSkene FitDawidSkene(const RaterCounts& counts, const DawidSkeneOptions& options) {
  Check(counts, options);
  Fit fit(counts);
  DawidSkene model;
  while (model.iterations < options.max_iterations) {
    fit.Maximise(options.smoothing);
    const double change = fit.Expect();
    ++model.iterations;
    if (options.tolerance && change < *options.tolerance) break;
  }
  model.prior = fit.prior;
  for (const Eigen::MatrixXd& rater : fit.confusion) model.confusion.push_back(rater.transpose());
  model.posterior = fit.posterior.transpose();
  model.log_likelihood = fit.log_likelihood;
  for (Eigen::Index item = 0; item < model.posterior.rows(); ++item) {
    Eigen::Index best = 0;
    model.posterior.row(item).maxCoeff(&best);
    model.label.push_back(best);
  }
  return model;
}

}  // namespace evac
