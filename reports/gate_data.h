#pragma once

#include <string>

#include "reports/summary.h"

namespace evac {

/// SHA-256 of everything of a run that a gate can count: the suite's hash, every episode, whether it failed, and every
/// judge's current label; while episodes are missing, also how many there are to be. Another hash is another data set;
/// the same one gets the stored decision again.
std::string DataHash(const RunData& data);

}  // namespace evac
