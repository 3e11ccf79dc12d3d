#include <fmt/format.h>

#include <cmath>
#include <functional>

#include "core/seed.h"
#include "core/statistics/mcnemar.h"
#include "core/statistics/sequential.h"
#include "core/statistics/special.h"
#include "core/statistics/two_by_two.h"
#include "tests/core/statistics/coverage.h"

namespace evac::coverage {
namespace {

/// What has been seen of two policies so far.
struct Seen {
  Count first, second;
  Flips flips;
  bool newest_first = false, newest_second = false;
  int steps() const { return static_cast<int>(first.trials); }
};

/// Equal policies; in a share `shared` of the states both have the same outcome for sure.
struct Null {
  double p = 0.5, shared = 0;
  int most = 100;
  std::string Name() const {
    return fmt::format("p {}{}, up to {}", p, shared > 0 ? fmt::format(", {} of the states alike", shared) : "", most);
  }
};

/// A test under way: shown every step, says whether it now rejects. Made anew for each replicate.
using Test = std::function<bool(const Seen&)>;

double FalseAlarmShare(const Null& null, const std::function<Test()>& make_test, const SimulationOptions& options) {
  SplitMix64 random(SeedFor(options.seed, "peeking " + null.Name()));
  int alarms = 0;
  for (int i = 0; i < options.replicates; ++i) {
    const Test rejects = make_test();
    Seen seen;
    bool alarm = false;
    for (int step = 0; step < null.most; ++step) {  // to the end, so that every test sees the same outcomes
      seen.newest_first = random.Uniform() < null.p;
      const bool alike = random.Uniform() < null.shared, other = random.Uniform() < null.p;
      seen.newest_second = alike ? seen.newest_first : other;
      ++seen.first.trials;
      ++seen.second.trials;
      seen.first.successes += seen.newest_first;
      seen.second.successes += seen.newest_second;
      seen.flips.only_first += seen.newest_first && !seen.newest_second;
      seen.flips.only_second += seen.newest_second && !seen.newest_first;
      alarm = alarm || rejects(seen);
    }
    alarms += alarm;
  }
  return static_cast<double>(alarms) / options.replicates;
}

bool IsLook(const Seen& seen) { return seen.steps() % 5 == 0; }

Test EveryFiveZ() {
  return [](const Seen& seen) { return IsLook(seen) && std::abs(PooledZ(seen.first, seen.second)) > TwoSidedZ(0.95); };
}
Test EveryFiveFisher() {
  return [](const Seen& seen) { return IsLook(seen) && FisherExact(seen.first, seen.second).two_sided <= 0.05; };
}
Test EveryFiveMcNemar() {
  return [](const Seen& seen) { return IsLook(seen) && McNemarExact(seen.flips).p_exact <= 0.05; };
}
template <RateOrder order>
Test Bet() {
  return [bet = TwoRatesBet(order)](const Seen& seen) mutable {
    bet.Add(seen.newest_first, seen.newest_second);
    return bet.e_value() >= 20;
  };
}
Test Flipping() {
  return [](const Seen& seen) { return FlipsEValue(seen.flips.only_first, seen.flips.only_second) >= 20; };
}
/// Not of two policies: whether the sequence of one rate ever leaves the truth out.
Test Sequence(double p) {
  return [p](const Seen& seen) {
    const Interval interval = *ConfidenceSequence(seen.first).interval;
    return p < interval.low || p > interval.high;
  };
}

}  // namespace

std::vector<FalseAlarms> Peeking(const SimulationOptions& options) {
  std::vector<FalseAlarms> table;
  const auto add = [&](const char* name, const Null& null, const std::function<Test()>& make_test) {
    table.push_back({name, null.Name(), FalseAlarmShare(null, make_test, options)});
  };
  for (const double p : {0.1, 0.5, 0.9}) {
    const Null apart{.p = p};
    add("z every 5", apart, EveryFiveZ);
    add("Fisher every 5", apart, EveryFiveFisher);
    add("bet, one-sided, every step", apart, Bet<RateOrder::kFirstBelow>);
    add("bet, two-sided, every step", apart, Bet<RateOrder::kEither>);
    add("confidence sequence, every step", apart, [p] { return Sequence(p); });
  }
  for (const double p : {0.5, 0.9}) {
    for (const double shared : {0.0, 0.7}) {
      const Null paired{.p = p, .shared = shared, .most = 200};
      add("McNemar every 5", paired, EveryFiveMcNemar);
      add("flips bet, every step", paired, Flipping);
    }
  }
  return table;
}

}  // namespace evac::coverage
