#include "core/statistics/dawid_skene.h"

#include <cmath>

#include "core/error.h"

namespace evac {
namespace {

void Check(const RaterCounts& counts, const DawidSkeneOptions& options) {
  if (counts.of_rater.empty() || counts.of_rater.front().size() == 0) {
    throw InvalidInput("statistics: Dawid-Skene wants at least one rater, item and label");
  }
  for (const Eigen::MatrixXd& rater : counts.of_rater) {
    if (rater.rows() != counts.of_rater.front().rows() || rater.cols() != counts.of_rater.front().cols()) {
      throw InvalidInput("statistics: raters differ in their number of items or labels");
    }
    if (!rater.allFinite() || rater.minCoeff() < 0) throw InvalidInput("statistics: a count is negative or not finite");
  }
  if (!(options.smoothing >= 0) || options.max_iterations < 1) {
    throw InvalidInput("statistics: smoothing {} and {} iterations, wanted at least 0 and 1", options.smoothing,
                       options.max_iterations);
  }
}

/// Each row divided by its sum; equal shares where that is 0.
Eigen::MatrixXd RowShares(const Eigen::MatrixXd& weights) {
  Eigen::MatrixXd shares = weights;
  for (Eigen::Index row = 0; row < shares.rows(); ++row) {
    const double sum = shares.row(row).sum();
    shares.row(row) = sum > 0 ? Eigen::RowVectorXd(shares.row(row) / sum)
                              : Eigen::RowVectorXd::Constant(shares.cols(), 1.0 / static_cast<double>(shares.cols()));
  }
  return shares;
}

Eigen::MatrixXd VoteShares(const RaterCounts& counts) {
  Eigen::MatrixXd votes = Eigen::MatrixXd::Zero(counts.of_rater.front().rows(), counts.of_rater.front().cols());
  for (const Eigen::MatrixXd& rater : counts.of_rater) votes += rater;
  return RowShares(votes);
}

void Maximise(const RaterCounts& counts, double smoothing, DawidSkene& model) {
  const Eigen::VectorXd items_of_label = model.posterior.colwise().sum().array() + smoothing;
  model.prior = items_of_label / items_of_label.sum();
  model.confusion.clear();
  for (const Eigen::MatrixXd& rater : counts.of_rater) {
    const Eigen::MatrixXd said = model.posterior.transpose() * rater;
    model.confusion.push_back(RowShares((said.array() + smoothing).matrix()));
  }
}

/// log P(all that was said of the item and its true label), [items, labels]; -inf where impossible.
Eigen::MatrixXd LogJoint(const RaterCounts& counts, const DawidSkene& model) {
  Eigen::MatrixXd log_joint = model.prior.array().log().matrix().transpose().replicate(model.posterior.rows(), 1);
  for (std::size_t r = 0; r < counts.of_rater.size(); ++r) {
    const Eigen::MatrixXd& said = counts.of_rater[r];
    for (Eigen::Index item = 0; item < said.rows(); ++item) {
      for (Eigen::Index label = 0; label < said.cols(); ++label) {
        if (said(item, label) == 0) continue;  // 0 log 0 = 0
        log_joint.row(item) += said(item, label) * model.confusion[r].col(label).array().log().matrix().transpose();
      }
    }
  }
  return log_joint;
}

/// Bayes in log space. @returns the largest change of a posterior.
double Expect(const RaterCounts& counts, DawidSkene& model) {
  const Eigen::MatrixXd log_joint = LogJoint(counts, model);
  const Eigen::MatrixXd before = model.posterior;
  model.log_likelihood = 0;
  for (Eigen::Index item = 0; item < log_joint.rows(); ++item) {
    const double most = log_joint.row(item).maxCoeff();
    const Eigen::RowVectorXd weights = (log_joint.row(item).array() - most).exp();
    model.posterior.row(item) = weights / weights.sum();
    model.log_likelihood += most + std::log(weights.sum());
  }
  return (model.posterior - before).cwiseAbs().maxCoeff();
}

}  // namespace

DawidSkene FitDawidSkene(const RaterCounts& counts, const DawidSkeneOptions& options) {
  Check(counts, options);
  DawidSkene model;
  model.posterior = VoteShares(counts);
  while (model.iterations < options.max_iterations) {
    Maximise(counts, options.smoothing, model);
    const double change = Expect(counts, model);
    ++model.iterations;
    if (options.tolerance && change < *options.tolerance) break;
  }
  for (Eigen::Index item = 0; item < model.posterior.rows(); ++item) {
    Eigen::Index best = 0;
    model.posterior.row(item).maxCoeff(&best);
    model.label.push_back(best);
  }
  return model;
}

}  // namespace evac
