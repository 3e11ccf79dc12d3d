#pragma once

#include <Eigen/Core>

#include "core/statistics/estimate.h"

namespace evac {

/// Strengths of policies from paired comparisons: P(i is preferred to j) = 1 / (1 + exp(b_j - b_i)), sum b = 0.
struct BradleyTerry {
  Eigen::VectorXd strength;    ///< b, by policy
  Eigen::MatrixXd covariance;  ///< of b; the variance of b_i - b_j is c_ii + c_jj - 2 c_ij
  double log_likelihood = 0;   ///< of the comparisons alone, without the penalty
  double SeOfDifference(Eigen::Index i, Eigen::Index j) const;
};

/// @param wins  [i, j] how often i was preferred to j; a tie is half a win for each. The diagonal is not read.
/// @param ridge  penalty ridge / 2 * sum b²: 1 is a weak prior that always has an answer; 0 is maximum likelihood.
/// @returns undefined with ridge 0 where no finite maximum exists: unless everyone has beaten everyone else, directly
/// or
///   through others (Ford 1957); and without policies.
/// @throws InvalidInput for a matrix that is not square, or a win or ridge that is negative or not finite.
Defined<BradleyTerry> FitBradleyTerry(const Eigen::MatrixXd& wins, double ridge = 1);

}  // namespace evac
