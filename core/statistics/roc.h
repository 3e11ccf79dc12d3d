#pragma once

#include <span>

#include "core/statistics/estimate.h"

namespace evac {

/// Area under the receiver operating characteristic: how often a success is scored above a failure, ties counting half
/// (Mann and Whitney's U over the number of pairs). Undefined without a success or without a failure.
/// @param scores    finite; larger means success
/// @param outcomes  1 success, 0 failure, of the same length
/// @throws InvalidInput for anything else.
Number AreaUnderRoc(std::span<const double> scores, std::span<const int> outcomes);

}  // namespace evac
