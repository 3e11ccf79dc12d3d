#include "reports/letters.h"

#include <algorithm>
#include <iterator>
#include <map>
#include <numeric>
#include <string>

#include "core/statistics/many_comparisons.h"
#include "core/statistics/mcnemar.h"
#include "core/statistics/rate_difference.h"
#include "core/statistics/two_samples.h"
#include "reports/summary.h"

namespace evac {
namespace {

constexpr double kPairedFrom = 0.8;

using Where = std::pair<std::size_t, std::uint64_t>;  // a number for each initial state, seed
/// One cell's outcomes that count, in the order of their key, and whether they succeeded.
using Outcomes = std::vector<std::pair<Where, bool>>;
using Place = std::pair<std::string, std::string>;  // world, task

struct Contestant {
  RateCell* cell;
  Outcomes outcomes;
};

/// Two contestants of one place.
struct Contest {
  std::size_t first = 0, second = 0;
  PolicyContest told;
};

/// The pairs of each initial state, so that its repeats do not count as if they were new.
std::vector<PairedOutcomes> PairsByState(const Outcomes& a, const Outcomes& b) {
  std::vector<PairedOutcomes> states;
  std::size_t last_state = 0;
  for (auto one = a.begin(), two = b.begin(); one != a.end() && two != b.end();) {
    if (one->first != two->first) {
      ++(one->first < two->first ? one : two);
      continue;
    }
    const std::size_t state = one->first.first;
    if (states.empty() || state != last_state) states.emplace_back();
    last_state = state;
    ++states.back().pairs;
    states.back().flips.only_first += one->second && !two->second;
    states.back().flips.only_second += !one->second && two->second;
    ++one, ++two;
  }
  return states;
}

std::vector<Count> TrialsByState(const Outcomes& outcomes) {
  std::vector<Count> states;
  for (auto one = outcomes.begin(); one != outcomes.end(); ++one) {
    if (one == outcomes.begin() || one->first.first != std::prev(one)->first.first) states.emplace_back();
    ++states.back().trials;
    states.back().successes += one->second;
  }
  return states;
}

void TestPairs(const std::vector<PairedOutcomes>& states, PolicyContest& contest) {
  const PairedOutcomes effective = EffectivePairs(states);
  contest.is_paired = true;
  contest.test = "exact McNemar";
  contest.shared = {contest.pairs.pairs, effective.pairs};
  contest.first_leads = contest.pairs.flips.only_first > contest.pairs.flips.only_second;
  contest.p = McNemarExact(effective.flips).p_exact;
}

void TestTwoSamples(const Outcomes& a, const Outcomes& b, PolicyContest& contest) {
  const std::vector<Count> one = TrialsByState(a), two = TrialsByState(b);
  const TwoSampleTest test = BoschlooOrNewcombe(one, two);
  contest.test = test.method;
  contest.first_episodes = {std::ssize(a), EffectiveCount(one).trials};
  contest.second_episodes = {std::ssize(b), EffectiveCount(two).trials};
  contest.first_leads = test.greater < test.less;
  contest.p = test.two_sided;
}

Contest ContestOf(const std::vector<Contestant>& contestants, std::size_t first, std::size_t second) {
  const Outcomes &a = contestants[first].outcomes, &b = contestants[second].outcomes;
  const std::vector<PairedOutcomes> states = PairsByState(a, b);
  const RateCell& cell = *contestants[first].cell;
  Contest contest{first, second, {}};
  PolicyContest& told = contest.told;
  told.world = cell.world;
  told.task = cell.task;
  told.first = cell.policy;
  told.second = contestants[second].cell->policy;
  told.pairs = SumOf(states);
  told.shared_states = std::ssize(states);
  if (static_cast<double>(told.pairs.pairs) >= kPairedFrom * static_cast<double>(std::max(a.size(), b.size()))) {
    TestPairs(states, told);
  } else {
    TestTwoSamples(a, b, told);
  }
  return contest;
}

std::map<Place, std::vector<Contestant>> ContestantsOf(const std::vector<JudgedEpisode>& episodes,
                                                       std::vector<RateCell>& cells) {
  std::map<Place, std::vector<Contestant>> places;
  std::map<std::pair<Place, std::string>, std::size_t> where;
  for (RateCell& cell : cells) {
    std::vector<Contestant>& contestants = places[{cell.world, cell.task}];
    where[{{cell.world, cell.task}, cell.policy}] = contestants.size();
    contestants.push_back({&cell, {}});
  }
  std::map<std::string, std::size_t> numbers;  // of initial states
  for (const JudgedEpisode& judged : episodes) {
    if (!judged.Counts()) continue;
    const EpisodeKey& key = judged.episode.key;
    const Place place{key.world, key.pair.task};
    const auto found = where.find({place, PolicyLabel(key.pair.policy, key.pair.checkpoint)});
    if (found == where.end()) continue;
    const std::size_t state = numbers.try_emplace(key.pair.initial_state, numbers.size()).first->second;
    places[place][found->second].outcomes.emplace_back(Where{state, key.pair.seed},
                                                       judged.outcome == Outcome::kSuccess);
  }
  for (auto& [place, contestants] : places) {
    for (Contestant& one : contestants) std::sort(one.outcomes.begin(), one.outcomes.end());
  }
  return places;
}

/// The best first, so that "a" is with the best; those without a verdict last.
void SortByRate(std::vector<Contestant>& contestants) {
  std::stable_sort(contestants.begin(), contestants.end(), [](const Contestant& a, const Contestant& b) {
    const auto rate = [](const Contestant& one) { return one.cell->rate.value ? *one.cell->rate.value : -1; };
    return rate(a) > rate(b);
  });
}

std::vector<Contest> ContestsOf(const std::vector<Contestant>& contestants) {
  std::vector<Contest> contests;
  for (std::size_t i = 0; i < contestants.size(); ++i) {
    for (std::size_t j = i + 1; j < contestants.size(); ++j) {
      if (contestants[i].outcomes.empty() || contestants[j].outcomes.empty()) continue;
      contests.push_back(ContestOf(contestants, i, j));
    }
  }
  return contests;
}

using ContestsByTask = std::map<std::string, std::vector<Contest>>;

void AdjustOverTasks(ContestsByTask& tasks) {
  std::vector<double> p_values;
  for (const auto& [task, contests] : tasks) {
    for (const Contest& contest : contests) p_values.push_back(contest.told.p);
  }
  const std::vector<double> adjusted = HolmAdjusted(p_values);
  auto p = adjusted.begin();
  for (auto& [task, contests] : tasks) {
    for (Contest& contest : contests) contest.told.p_holm = *p++;
  }
}

}  // namespace

LetterTests GiveLetters(const std::vector<JudgedEpisode>& episodes, double alpha, std::vector<RateCell>& cells) {
  std::map<Place, std::vector<Contestant>> places = ContestantsOf(episodes, cells);
  std::map<std::string, ContestsByTask> worlds;
  for (auto& [place, contestants] : places) {
    SortByRate(contestants);
    worlds[place.first][place.second] = ContestsOf(contestants);
  }
  LetterTests tests;
  for (auto& [world, tasks] : worlds) {
    AdjustOverTasks(tasks);
    std::int64_t family = 0;
    for (const auto& [task, contests] : tasks) {
      std::vector<std::pair<std::size_t, std::size_t>> significant;
      for (const Contest& contest : contests) {
        ++family;
        tests.contests.push_back(contest.told);
        if (!contest.told.is_paired) tests.unpaired_tests.insert(contest.told.test);
        if (contest.told.p_holm <= alpha) significant.emplace_back(contest.first, contest.second);
      }
      tests.pairs = std::max(tests.pairs, family);
      const std::vector<Contestant>& contestants = places.at({world, task});
      if (contests.empty()) continue;  // nobody to differ from
      const std::vector<std::string> letters = CompactLetters(contestants.size(), significant);
      for (std::size_t i = 0; i < contestants.size(); ++i) {
        if (!contestants[i].outcomes.empty()) contestants[i].cell->letters = letters[i];
      }
    }
  }
  return tests;
}

}  // namespace evac
