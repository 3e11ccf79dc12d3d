#pragma once

#include <string>

#include "core/config.h"
#include "harness/suite.h"

namespace evac {

/// SHA-256 of everything in a suite that can change a result, wherever its files lie: fields by value, files by
/// content. Left out: lanes, threads, error_budget and the transport's times, which change how fast and how patiently,
/// not what.
std::string SuiteHash(const Config& page, const Suite& suite);

/// The same without the worlds of type evac: suites that differ in a world model alone have the same reality.
std::string RealityHash(const Config& page, const Suite& suite);

}  // namespace evac
