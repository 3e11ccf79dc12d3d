#include "judges/rating_order.h"

#include <algorithm>
#include <map>
#include <numeric>
#include <optional>

#include "core/seed.h"

namespace evac {
namespace {

std::vector<std::size_t> Shuffled(std::uint64_t seed, std::uint64_t rater, std::size_t count) {
  std::vector<std::size_t> order(count);
  std::iota(order.begin(), order.end(), 0);
  SplitMix64 draws(SeedFor(SeedFor(seed, "rating order"), rater));
  for (std::size_t i = count; i > 1; --i) std::swap(order[i - 1], order[draws.Below(i)]);
  return order;
}

/// Names as numbers from 0.
std::vector<std::size_t> Numbered(std::span<const OrderedClip> clips, std::string OrderedClip::*name) {
  std::map<std::string, std::size_t> numbers;
  std::vector<std::size_t> of_clip;
  for (const OrderedClip& clip : clips)
    of_clip.push_back(numbers.try_emplace(clip.*name, numbers.size()).first->second);
  return of_clip;
}

/// Chooses one clip after the other among those with the fewest votes.
class Chooser {
 public:
  Chooser(std::span<const OrderedClip> clips, const OrderOptions& options)
      : options_(options),
        start_(Numbered(clips, &OrderedClip::start)),
        group_(Numbered(clips, &OrderedClip::group)),
        wanted_(clips.size()),
        left_(clips.size()),
        in_block_(clips.size()),
        last_(clips.size()) {
    const double share = static_cast<double>(options.block) / std::max(1.0, static_cast<double>(clips.size()));
    for (const std::size_t group : group_) wanted_[group] += share;
  }

  /// @param level  the clips to be placed now, shuffled. Appends all of them to `order`.
  void Place(std::vector<std::size_t> level, std::vector<std::size_t>& order) {
    std::ranges::fill(left_, 0);
    for (const std::size_t clip : level) ++left_[start_[clip]];
    while (!level.empty()) {
      if (order.size() % options_.block == 0) std::ranges::fill(in_block_, 0);
      placed_ = order.size();
      const auto best = std::ranges::max_element(level, {}, [this](std::size_t clip) { return Worth(clip); });
      const std::size_t chosen = *best;
      level.erase(best);
      --left_[start_[chosen]];
      ++in_block_[group_[chosen]];
      last_[start_[chosen]] = placed_;
      order.push_back(chosen);
    }
  }

 private:
  struct Value {
    bool is_apart;
    std::size_t waited;  ///< where it is not apart: the longest first
    std::size_t left;    ///< clips of its start: who has most goes first, so that none are left to stand together
    double lack;         ///< how far its group is behind in this block
    auto operator<=>(const Value&) const = default;
  };

  Value Worth(std::size_t clip) const {
    const std::optional<std::size_t> last = last_[start_[clip]];
    const bool is_apart = !last || placed_ - *last > options_.apart;
    return {is_apart, is_apart ? 0 : placed_ - *last, left_[start_[clip]],
            wanted_[group_[clip]] - static_cast<double>(in_block_[group_[clip]])};
  }

  OrderOptions options_;
  std::vector<std::size_t> start_, group_;        // of each clip
  std::vector<double> wanted_;                    // of each group in a block
  std::vector<std::size_t> left_, in_block_;      // of each start; of each group
  std::vector<std::optional<std::size_t>> last_;  // of each start: where it was placed last
  std::size_t placed_ = 0;
};

}  // namespace

std::vector<std::size_t> OrderFor(std::uint64_t seed, std::uint64_t rater, std::span<const OrderedClip> clips,
                                  const OrderOptions& options) {
  std::map<std::int64_t, std::vector<std::size_t>> levels;
  for (const std::size_t clip : Shuffled(seed, rater, clips.size())) levels[clips[clip].votes].push_back(clip);
  Chooser chooser(clips, options);
  std::vector<std::size_t> order;
  for (auto& [votes, level] : levels) chooser.Place(std::move(level), order);
  return order;
}

std::vector<Place> WithRepeats(std::uint64_t seed, std::uint64_t rater, std::span<const std::size_t> order,
                               std::size_t repeats, const OrderOptions& options) {
  std::vector<Place> places;
  for (const std::size_t clip : order) places.push_back({clip, false});
  const std::size_t first_part = order.size() - order.size() / 4;  // what comes last has no room for a repeat after it
  std::vector<std::size_t> candidates = Shuffled(SeedFor(seed, "repeats"), rater, first_part);
  candidates.resize(std::min(repeats, candidates.size()));
  SplitMix64 draws(SeedFor(SeedFor(seed, "places of repeats"), rater));
  for (const std::size_t candidate : candidates) {
    const std::size_t clip = order[candidate];
    const auto first = std::ranges::find_if(places, [clip](const Place& p) { return p.clip == clip && !p.is_repeat; });
    const auto earliest = static_cast<std::size_t>(first - places.begin()) + options.apart + 1;
    const std::size_t room = earliest < places.size() ? places.size() - earliest : 0;
    const std::size_t at = room == 0 ? places.size() : earliest + draws.Below(room + 1);
    places.insert(places.begin() + static_cast<std::ptrdiff_t>(at), {clip, true});
  }
  return places;
}

}  // namespace evac
