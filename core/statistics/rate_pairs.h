#pragma once

#include <span>
#include <vector>

namespace evac {

/// What every comparison of worlds works on: entry i is one point, a policy (on a task). Named, because the order of
/// arguments has been confused before: SIMPLER's signature is (sim, real), its README calls it with (real, sim).
struct RatePairs {
  std::vector<double> real;  ///< R: success rate in the reference world
  std::vector<double> sim;   ///< S: success rate in the world under test, of the same length
};

/// What every function of two sequences asks of them. @throws InvalidInput if the lengths differ or a value is not
/// finite.
void CheckPairs(std::span<const double> x, std::span<const double> y);

}  // namespace evac
