#include "core/statistics/many_comparisons.h"

#include <algorithm>
#include <numeric>
#include <set>

#include "core/error.h"

namespace evac {
namespace {

/// Places of the p-values in ascending order; equal ones in the order given.
std::vector<std::size_t> Ascending(std::span<const double> p_values) {
  for (const double p : p_values) {
    if (!(p >= 0 && p <= 1)) throw InvalidInput("statistics: a p-value of {}, wanted 0 <= p <= 1", p);
  }
  std::vector<std::size_t> order(p_values.size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  std::ranges::stable_sort(order, {}, [&](std::size_t i) { return p_values[i]; });
  return order;
}

using Group = std::set<std::size_t>;  ///< policies that share one letter

bool IsWithinAnother(const std::vector<Group>& groups, std::size_t at) {
  for (std::size_t other = 0; other < groups.size(); ++other) {
    if (other == at || !std::ranges::includes(groups[other], groups[at])) continue;
    if (groups[other] != groups[at] || other < at) return true;  // of equal groups the first stays
  }
  return false;
}

void Absorb(std::vector<Group>& groups) {
  std::vector<Group> kept;
  for (std::size_t at = 0; at < groups.size(); ++at) {
    if (!IsWithinAnother(groups, at)) kept.push_back(groups[at]);
  }
  groups = std::move(kept);
}

/// Every group that holds both becomes two, each without one of them.
void Separate(std::vector<Group>& groups, std::size_t i, std::size_t j) {
  std::vector<Group> separated;
  for (const Group& group : groups) {
    if (!group.contains(i) || !group.contains(j)) {
      separated.push_back(group);
      continue;
    }
    Group without_i = group, without_j = group;
    without_i.erase(i);
    without_j.erase(j);
    separated.push_back(std::move(without_i));
    separated.push_back(std::move(without_j));
  }
  groups = std::move(separated);
  Absorb(groups);
}

std::string Letter(std::size_t index) {
  if (index < 26) return std::string(1, static_cast<char>('a' + index));
  if (index < 52) return std::string(1, static_cast<char>('A' + (index - 26)));
  return fmt::format("({})", index + 1);
}

}  // namespace

std::vector<double> HolmAdjusted(std::span<const double> p_values) {
  std::vector<double> adjusted(p_values.size());
  double running = 0, left = static_cast<double>(p_values.size());
  for (const std::size_t i : Ascending(p_values)) {
    running = std::max(running, std::min(1.0, left * p_values[i]));
    adjusted[i] = running;
    --left;
  }
  return adjusted;
}

std::vector<double> BenjaminiHochbergAdjusted(std::span<const double> p_values) {
  std::vector<double> adjusted(p_values.size());
  std::vector<std::size_t> order = Ascending(p_values);
  const double count = static_cast<double>(p_values.size());
  double running = 1, rank = count;
  for (const std::size_t i : std::vector<std::size_t>(order.rbegin(), order.rend())) {
    running = std::min(running, p_values[i] * count / rank);
    adjusted[i] = running;
    --rank;
  }
  return adjusted;
}

std::vector<double> BonferroniAdjusted(std::span<const double> p_values) {
  Ascending(p_values);  // complains
  std::vector<double> adjusted;
  for (const double p : p_values) adjusted.push_back(std::min(1.0, p * static_cast<double>(p_values.size())));
  return adjusted;
}

std::vector<std::string> CompactLetters(std::size_t policies,
                                        std::span<const std::pair<std::size_t, std::size_t>> significant) {
  std::set<std::pair<std::size_t, std::size_t>> pairs;
  for (const auto& [i, j] : significant) {
    if (i == j || std::max(i, j) >= policies) {
      throw InvalidInput("statistics: the pair ({}, {}) of {} policies, wanted two of them, counted from 0", i, j,
                         policies);
    }
    pairs.insert(std::minmax(i, j));
  }
  Group everybody;
  for (std::size_t policy = 0; policy < policies; ++policy) everybody.insert(policy);
  std::vector<Group> groups{everybody};
  for (const auto& [i, j] : pairs) Separate(groups, i, j);
  std::ranges::sort(groups);
  std::vector<std::string> letters(policies);
  for (std::size_t g = 0; g < groups.size(); ++g) {
    for (const std::size_t policy : groups[g]) letters[policy] += Letter(g);
  }
  return letters;
}

}  // namespace evac
