#pragma once

#include <cstddef>
#include <span>
#include <string>
#include <utility>
#include <vector>

/// Many p-values on one page (docs/statistics.md). The family is every pair that the page shows.
namespace evac {

/// Adjusted p-values, in the order given, at most 1. All throw InvalidInput for a p outside [0, 1].
/// Holm: no false alarm in the whole family with probability 1 - alpha; for gates.
std::vector<double> HolmAdjusted(std::span<const double> p_values);
/// Benjamini & Hochberg: the expected share of false alarms among the findings; for exploring.
std::vector<double> BenjaminiHochbergAdjusted(std::span<const double> p_values);
std::vector<double> BonferroniAdjusted(std::span<const double> p_values);

/// Letters that policies share exactly if they do not differ significantly (Piepho 2004, insert and absorb).
/// @param policies  how many, in order of descending rate, so that "a" is with the best.
/// @param significant  the pairs that differ, each once, in any order.
/// @returns per policy its letters in order: {"a", "ab", "b"}. After "z" come "A" … "Z", then "(53)", "(54)", ….
/// @throws InvalidInput if a pair names no policy, or one twice.
std::vector<std::string> CompactLetters(std::size_t policies,
                                        std::span<const std::pair<std::size_t, std::size_t>> significant);

}  // namespace evac
