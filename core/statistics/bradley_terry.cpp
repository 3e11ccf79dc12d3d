#include "core/statistics/bradley_terry.h"

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <vector>

#include "core/error.h"

namespace evac {
namespace {

void Check(const Eigen::MatrixXd& wins, double ridge) {
  if (wins.rows() != wins.cols()) {
    throw InvalidInput("statistics: wins are {} x {}, wanted a square", wins.rows(), wins.cols());
  }
  if (!(ridge >= 0 && std::isfinite(ridge))) throw InvalidInput("statistics: ridge is {}, wanted at least 0", ridge);
  for (const double win : wins.reshaped()) {
    if (!(win >= 0 && std::isfinite(win))) throw InvalidInput("statistics: {} wins, wanted at least 0", win);
  }
}

/// Whether everyone is reached from the first by going from winner to loser (`forward`) or back.
bool ReachesAll(const Eigen::MatrixXd& wins, bool forward) {
  std::vector<bool> reached(static_cast<std::size_t>(wins.rows()), false);
  std::vector<Eigen::Index> open{0};
  reached[0] = true;
  while (!open.empty()) {
    const Eigen::Index i = open.back();
    open.pop_back();
    for (Eigen::Index j = 0; j < wins.rows(); ++j) {
      if (i == j || reached[static_cast<std::size_t>(j)] || (forward ? wins(i, j) : wins(j, i)) == 0) continue;
      reached[static_cast<std::size_t>(j)] = true;
      open.push_back(j);
    }
  }
  return std::ranges::all_of(reached, [](bool is) { return is; });
}

double LogSigmoid(double x) { return x < 0 ? x - std::log1p(std::exp(x)) : -std::log1p(std::exp(-x)); }

double LogLikelihood(const Eigen::MatrixXd& wins, const Eigen::VectorXd& strength) {
  double sum = 0;
  for (Eigen::Index i = 0; i < wins.rows(); ++i) {
    for (Eigen::Index j = 0; j < wins.rows(); ++j) {
      if (i != j && wins(i, j) > 0) sum += wins(i, j) * LogSigmoid(strength(i) - strength(j));
    }
  }
  return sum;
}

struct Slope {
  Eigen::VectorXd gradient;     ///< of the log-likelihood
  Eigen::MatrixXd information;  ///< minus its second derivative
};
Slope SlopeAt(const Eigen::MatrixXd& wins, const Eigen::VectorXd& strength) {
  const Eigen::Index n = wins.rows();
  Slope slope{Eigen::VectorXd::Zero(n), Eigen::MatrixXd::Zero(n, n)};
  for (Eigen::Index i = 0; i < n; ++i) {
    for (Eigen::Index j = i + 1; j < n; ++j) {
      const double games = wins(i, j) + wins(j, i);
      const double p = 1 / (1 + std::exp(strength(j) - strength(i)));
      const double surprise = wins(i, j) - games * p, information = games * p * (1 - p);
      slope.gradient(i) += surprise;
      slope.gradient(j) -= surprise;
      slope.information(i, i) += information;
      slope.information(j, j) += information;
      slope.information(i, j) -= information;
      slope.information(j, i) -= information;
    }
  }
  return slope;
}

/// Newton's method with halved steps where a full one would not climb.
Eigen::VectorXd Maximise(const Eigen::MatrixXd& wins, double ridge) {
  const Eigen::Index n = wins.rows();
  Eigen::VectorXd strength = Eigen::VectorXd::Zero(n);
  const auto height = [&](const Eigen::VectorXd& b) { return LogLikelihood(wins, b) - ridge / 2 * b.squaredNorm(); };
  // Without a ridge the sum of strengths is free; a matrix of ones holds it at 0 and changes nothing else.
  const Eigen::MatrixXd pin =
      ridge > 0 ? Eigen::MatrixXd(Eigen::MatrixXd::Identity(n, n) * ridge) : Eigen::MatrixXd::Ones(n, n);
  for (int step = 0; step < 200; ++step) {
    const Slope slope = SlopeAt(wins, strength);
    const Eigen::VectorXd gradient = slope.gradient - ridge * strength;
    Eigen::VectorXd move = Eigen::LDLT<Eigen::MatrixXd>(slope.information + pin).solve(gradient);
    while (height(strength + move) < height(strength) && move.cwiseAbs().maxCoeff() > 1e-12) move /= 2;
    strength += move;
    if (move.cwiseAbs().maxCoeff() < 1e-13) break;
  }
  return strength.array() - strength.mean();
}

}  // namespace

double BradleyTerry::SeOfDifference(Eigen::Index i, Eigen::Index j) const {
  return std::sqrt(covariance(i, i) + covariance(j, j) - 2 * covariance(i, j));
}

Defined<BradleyTerry> FitBradleyTerry(const Eigen::MatrixXd& wins, double ridge) {
  Check(wins, ridge);
  if (wins.rows() == 0) return Undefined{"no policies"};
  if (ridge == 0 && !(ReachesAll(wins, true) && ReachesAll(wins, false))) {
    return Undefined{"some policies never lost to the others, or never met them: no finite strengths; use a ridge"};
  }
  BradleyTerry fit;
  fit.strength = Maximise(wins, ridge);
  fit.log_likelihood = LogLikelihood(wins, fit.strength);
  const Eigen::Index n = wins.rows();
  const Eigen::MatrixXd information = SlopeAt(wins, fit.strength).information;
  const Eigen::MatrixXd ones = Eigen::MatrixXd::Ones(n, n) / static_cast<double>(n);
  // The ones make the information of strengths that sum to 0 invertible; taken out again, the rows sum to 0.
  fit.covariance = ridge > 0 ? Eigen::MatrixXd((information + ridge * Eigen::MatrixXd::Identity(n, n)).inverse())
                             : Eigen::MatrixXd((information + ones).inverse() - ones);
  return fit;
}

}  // namespace evac
