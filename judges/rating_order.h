#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

/// In which order one rater sees the clips: a function of the study's seed, the rater and the votes so far, nothing
/// else (docs/rating_session.md).
namespace evac {

struct OrderedClip {
  std::string start;       ///< task and initial state: clips that begin alike
  std::string group;       ///< world and policy: what blocks are balanced by
  std::int64_t votes = 0;  ///< it has when the order is made
};

struct OrderOptions {
  std::size_t apart = 12;  ///< clips of one start are further apart than this, as far as their number allows
  std::size_t block = 20;  ///< in each block of so many, groups are shared as in the whole, but for a few clips
};

/// @returns every index of `clips` once. Clips with fewer votes come before clips with more; within equal votes a
/// shuffle by splitmix64(seed, rater), then as the options ask. Where a start has too many clips to be kept apart, the
/// one that was longest ago comes next.
std::vector<std::size_t> OrderFor(std::uint64_t seed, std::uint64_t rater, std::span<const OrderedClip> clips,
                                  const OrderOptions& options = {});

/// One place in the order of a rater who sees some clips again.
struct Place {
  std::size_t clip = 0;
  bool is_repeat = false;
};
/// Inserts `repeats` of the first clips again, each more than options.apart later (or at the end), never twice the
/// same.
std::vector<Place> WithRepeats(std::uint64_t seed, std::uint64_t rater, std::span<const std::size_t> order,
                               std::size_t repeats, const OrderOptions& options = {});

}  // namespace evac
