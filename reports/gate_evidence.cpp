#include "reports/gate_evidence.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>

#include "core/error.h"
#include "core/run_extent.h"
#include "core/statistics/inverted_interval.h"
#include "core/statistics/planning.h"
#include "core/statistics/sequential.h"
#include "core/statistics/sequential_planning.h"
#include "core/statistics/special.h"
#include "core/statistics/two_samples.h"
#include "reports/counted_judges.h"
#include "reports/gate_quality.h"
#include "reports/wording.h"

namespace evac {
namespace {

constexpr double kPower = 0.8;             // of the sizes that "more" promises
constexpr double kShownConfidence = 0.95;  // of the two rates

std::string Margin(const GateRule& rule) { return GivenPoints(rule.margin); }

double PassConfidence(const GateRule& rule) { return 1 - 2 * rule.alpha; }

/// Of a test that looks once, by the normal approximation: until it is shown on which side of -margin the difference is,
/// `side` 1 above it and -1 below.
Number PairsToShow(int side, const GateRule& rule, const FlipRates& rates) {
  const double d = rates.only_first - rates.only_second, room = side * (rule.margin + d);
  if (room <= 0.005) return Undefined{"the flips lean the other way"};
  const double z = NormalQuantile(1 - rule.alpha) + NormalQuantile(kPower);
  return z * z * (rates.only_first + rates.only_second - d * d) / (room * room);
}

/// Pairs of which the lower end of the difference would clear -margin, and those that would show it worse, both if the
/// flips stay as seen and further pairs repeat states as these do. Without a pair nothing was seen.
std::string MorePairs(const GateRule& rule, const PairedOutcomes& seen, std::int64_t effective) {
  if (seen.pairs == 0) return "";
  const Repeated have{seen.pairs, effective};
  const double each = static_cast<double>(effective) / static_cast<double>(seen.pairs);
  const double n = static_cast<double>(effective) + 1;
  const FlipRates rates{(static_cast<double>(seen.flips.only_first) * each + 0.5) / n,
                        (static_cast<double>(seen.flips.only_second) * each + 0.5) / n};
  std::vector<std::string> parts;
  const auto add = [&](const Number& wanted, const std::string& what) {
    const Defined<std::int64_t> further = wanted ? FurtherWanted(*wanted, have) : Undefined{wanted.reason()};
    if (further) parts.push_back(fmt::format("about {} to show it {}", Counted(*further, "more pair"), what));
  };
  const bool is_bet = rule.test == GateTest::kSavi, is_worse = rates.only_second > rates.only_first;
  const Promise promise{rule.alpha, kPower};
  add(is_bet ? PairsForSequentialNonInferiority(rates, rule.margin, promise).exact : PairsToShow(1, rule, rates),
      "not worse by " + Margin(rule));
  if (rule.test == GateTest::kNonInferiority) {
    add(PairsToShow(-1, rule, rates), "worse by more than " + Margin(rule));
  } else if (is_worse) {
    add((is_bet ? PairsForFlipsBet(rates, promise) : PairsForMcNemar(rates, promise)).exact, "worse");
  }
  return parts.empty() ? "" : fmt::format("If the flips stay as seen: {}.", fmt::join(parts, ", "));
}

/// One policy's trials: all of them, and what they tell as much as where states repeat.
struct Trials {
  explicit Trials(const std::vector<Count>& states) : all(SumOf(states)), effective(EffectiveCount(states)) {}
  Repeated Number() const { return {all.trials, effective.trials}; }
  Count all, effective;
};

/// Of each of two samples with these rates, as PairsToShow.
Number TrialsToShow(int side, const GateRule& rule, double p, double q) {
  const double room = side * (rule.margin + p - q);
  if (room <= 0.005) return Undefined{"the rates lean the other way"};
  const double z = NormalQuantile(1 - rule.alpha) + NormalQuantile(kPower);
  return std::ceil(z * z * (p * (1 - p) + q * (1 - q)) / (room * room));
}

/// As MorePairs, of episodes on different initial states. Where one of the two has none nothing was seen.
std::string MoreTrials(const GateRule& rule, const Trials& candidate, const Trials& baseline) {
  if (candidate.all.trials == 0 || baseline.all.trials == 0) return "";
  const auto rate = [](const Count& c) {
    return (static_cast<double>(c.successes) + 0.5) / (static_cast<double>(c.trials) + 1);
  };
  const double p = rate(candidate.effective), q = rate(baseline.effective);
  std::vector<std::string> parts;
  const auto add = [&](const Number& wanted, const std::string& what) {
    if (!wanted) return;
    const Defined<std::int64_t> here = FurtherWanted(*wanted, candidate.Number());
    const Defined<std::int64_t> there = FurtherWanted(*wanted, baseline.Number());
    if (!here || !there) return;
    const std::string further = Counted(std::max(*here, *there), "more episode", "more episodes");
    parts.push_back(fmt::format("about {} of each to show it {}", further, what));
  };
  add(TrialsToShow(1, rule, p, q), "not worse by " + Margin(rule));
  if (rule.test == GateTest::kNonInferiority) {
    add(TrialsToShow(-1, rule, p, q), "worse by more than " + Margin(rule));
  } else if (p < q) {
    add(TrialsPerPolicy(p, q, {rule.alpha, kPower}).exact, "worse");
  }
  return parts.empty() ? "" : fmt::format("If the rates stay as seen: {}.", fmt::join(parts, ", "));
}

/// Rates, difference, flips: what every comparison shows.
void Describe(const GateRule& rule, const Estimate& difference, std::int64_t n, Evidence& evidence) {
  RuleDecision& decision = evidence.decision;
  decision.difference = difference;
  decision.states = n;
  evidence.good = "not worse by " + Margin(rule);
  evidence.bad = rule.test == GateTest::kNonInferiority ? "worse by more than " + Margin(rule) : "worse";
  evidence.shows_good = difference.value && difference.interval && difference.interval->low > -rule.margin;
  decision.statement =
      fmt::format("{} {} against {} {}: {} ({:g} %), ", decision.policy, PercentWithInterval(decision.value),
                  decision.baseline_policy, PercentWithInterval(decision.baseline), PointsWithInterval(difference),
                  100 * difference.confidence);
}

/// The difference of the pairs, its interval on their effective number.
Estimate DifferenceOf(const GatePairs& pairs, double confidence) {
  Estimate difference = TangoOfClusters(pairs.by_state, confidence);
  difference.method = OnPairs("Tango", PairsOfInterval(pairs.by_state, confidence));
  return difference;
}

/// Everything of an anytime-valid test but the looks before: both kinds of flips within their confidence sequences. One
/// pair of each state: no design effect is known ahead, and what is bet must be.
Estimate SequentialDifference(const GatePairs& pairs, double alpha) {
  Estimate difference = SequentialPairedDifference(pairs.one_each, 1 - alpha);
  difference.value = DifferenceOf(pairs, 1 - alpha).value;  // of all pairs
  if (!difference.value) difference.interval = Undefined{"no pairs"};
  return difference;
}

/// This look's bet and the largest of all looks that leaned towards "worse".
void Bet(const GateInput& input, const GatePairs& pairs, Evidence& evidence) {
  RuleDecision& decision = evidence.decision;
  const auto [better, worse] = pairs.one_each.flips;
  const std::int64_t n = pairs.one_each.pairs;
  const SequentialLook look{fmt::format("gate {}, rule {}: {} against {} of {:.16} in {}, judge {}, one pair a state",
                                        input.gate, decision.name, decision.policy, decision.baseline_policy,
                                        input.data.baseline->sha256, decision.world, input.data.candidate.judge),
                            decision.task,
                            n,
                            better,
                            worse,
                            FlipsEValue(better, worse)};
  double largest = worse > better ? look.e_value : 1;
  int looks = 1;
  bool is_new = true;
  for (const SequentialLook& old : input.looks) {
    if (old.comparison != look.comparison || old.task != look.task) continue;
    if (old.only_second > old.only_first) largest = std::max(largest, old.e_value);
    is_new = old != look;
    ++looks;
  }
  looks -= !is_new;
  if (is_new) evidence.look = look;
  decision.p = std::min(1.0, 1 / largest);
  decision.statement +=
      fmt::format("{}{}, {} better / {} worse; e-value {:.3g}, largest of {} {:.3g}, {}", Counted(n, "pair"),
                  n < pairs.all.pairs ? ", one of each state" : "", better, worse, look.e_value,
                  Counted(looks, "look"), largest, PValue(*decision.p));
}

void ComparePairs(const GateRule& rule, const GateInput& input, const GateSides& sides, Evidence& evidence) {
  RuleDecision& decision = evidence.decision;
  GatePairs pairs = PairUp(sides, input.data);
  decision.value = ClusteredWilsonInterval(pairs.candidate, kShownConfidence);
  decision.baseline = ClusteredWilsonInterval(pairs.baseline, kShownConfidence);
  const bool is_bet = rule.test == GateTest::kSavi;
  const PairedOutcomes& counted = is_bet ? pairs.one_each : pairs.all;
  const auto [better, worse] = counted.flips;
  decision.flips_better = better;
  decision.flips_worse = worse;
  Describe(rule, is_bet ? SequentialDifference(pairs, rule.alpha) : DifferenceOf(pairs, PassConfidence(rule)),
           counted.pairs, evidence);
  evidence.initial_states = is_bet ? counted.pairs : std::ssize(pairs.by_state);
  if (is_bet) {
    Bet(input, pairs, evidence);
  } else {
    const bool by_margin = rule.test == GateTest::kNonInferiority;
    decision.p = by_margin ? PBelow([&](double c) { return TangoOfClusters(pairs.by_state, c).interval; }, -rule.margin)
                 : worse > better ? McNemarExact(pairs.effective.flips).p_exact
                                  : 1.0;
    decision.statement += fmt::format(
        "{} pairs, {} better / {} worse, {} ({})", counted.pairs, better, worse, PValue(*decision.p),
        by_margin ? OnPairs("Tango against the margin", PairsOfInterval(pairs.by_state, PassConfidence(rule)))
                  : OnPairs("exact McNemar", {counted.pairs, pairs.effective.pairs}));
  }
  evidence.more = MorePairs(rule, counted,
                            is_bet ? counted.pairs : PairsOfInterval(pairs.by_state, PassConfidence(rule)).effective);
  decision.counter_examples = std::move(pairs.counter_examples);
}

void CompareUnpaired(const GateRule& rule, const GateSides& sides, Evidence& evidence) {
  RuleDecision& decision = evidence.decision;
  const std::vector<Count> candidate = CountsOf(sides.candidate), baseline = CountsOf(sides.baseline);
  decision.value = ClusteredWilsonInterval(candidate, kShownConfidence);
  decision.baseline = ClusteredWilsonInterval(baseline, kShownConfidence);
  const auto difference = [&](double confidence) {
    return NewcombeOfRates(RateOfStates(candidate, confidence), RateOfStates(baseline, confidence));
  };
  const Trials here(candidate), there(baseline);
  Describe(rule, difference(PassConfidence(rule)), here.all.trials, evidence);
  evidence.initial_states = std::ssize(candidate);
  const bool by_margin = rule.test == GateTest::kNonInferiority;
  std::string method = by_margin ? "Newcombe" : "Boschloo";
  if (here.all.trials == 0 || there.all.trials == 0) {
    decision.p = Undefined{"one of the two has no episode that counts"};
  } else if (by_margin) {
    decision.p = PBelow([&](double confidence) { return difference(confidence).interval; }, -rule.margin);
  } else {
    const TwoSampleTest test = BoschlooOrNewcombe(candidate, baseline);
    decision.p = std::min(1.0, 2 * test.less);
    method = test.method;
  }
  decision.statement += fmt::format("{} and {} episodes, {} ({})", here.all.trials, there.all.trials,
                                    decision.p ? PValue(*decision.p) : decision.p.reason(),
                                    OnEpisodes(method, here.Number(), there.Number()));
  evidence.more = MoreTrials(rule, here, there);
}

/// Of what the suite asks for, the part that the rule is about.
RunExtent ExtentOfRule(const GateRule& rule, const RunSummary& run, const std::string& world) {
  return ExtentOf(run.data.plan, run.data.episodes, [&](const PlannedEpisodes& one) {
    return IsOfRule(one, rule, world) || (rule.test == GateTest::kCorrelation && IsOfRule(one, rule, run.reference));
  });
}

/// Of what a rule is about, where none of it has run.
std::string NothingYet(const GateRule& rule, const GateSides& sides) {
  return fmt::format("{}{} in {}", sides.candidate.policy.empty() ? "all policies" : sides.candidate.policy,
                     rule.task.empty() ? "" : " on " + rule.task, sides.world);
}

/// A run that is not whole is no sample of itself: tasks, worlds and policies have their turns one after another. A bet
/// may be looked at while it runs; of errors there may be too many already, whatever comes.
void BlockPart(const GateRule& rule, const GateInput& input, const GateSides& sides, Evidence& evidence) {
  if (rule.test == GateTest::kSavi && !sides.candidate.cells.empty()) return;
  const RunExtent extent = ExtentOfRule(rule, input.run, sides.world);
  if (extent.missing == 0) return;
  const double errors = static_cast<double>(sides.candidate.errors), planned = static_cast<double>(extent.planned);
  if (evidence.counted == GateOutcome::kFail && errors > *rule.at_most * planned) return;
  evidence.counted.reset();
  evidence.blocked =
      fmt::format("{} of {} are there", extent.planned - extent.missing, Counted(extent.planned, "episode"));
  evidence.more = "The run is not whole: evac resume runs the others, evac merge adds those of other shards.";
}

/// The episodes whose errors the rule minds: the candidate's, and where they are held against the real world its too.
GateSide TriedBy(const GateRule& rule, const GateInput& input, const GateSides& sides) {
  GateSide side = sides.candidate;
  if (rule.test != GateTest::kCorrelation) return side;
  for (const PinnedCell& cell : input.data.candidate.cells) {
    if (cell.world == input.run.reference && (rule.task.empty() || cell.task == rule.task)) side.Add(cell);
  }
  return side;
}

/// A rule of outcomes has nothing to go by where nobody judged; errors need no judge.
void AskForAJudge(const GateRule& rule, const RunSummary& run, Evidence& evidence) {
  if (!run.judges.empty() || rule.test == GateTest::kErrorShare) return;
  const std::string judge = LastJudge(run.options.judge);
  evidence.more = fmt::format("Nobody has judged the run yet: {}.", fmt::join(JudgingCommands(judge), ", then "));
}

/// What stands before any test.
void Block(const GateRule& rule, const GateInput& input, const GateSides& sides, Evidence& evidence) {
  const GateSide side = TriedBy(rule, input, sides);
  const double share = side.episodes > 0 ? static_cast<double>(side.errors) / static_cast<double>(side.episodes) : 0;
  if (!evidence.counted && share > rule.max_error_share) {
    evidence.blocked = fmt::format("{} of {} episodes ({}) could not go on, more than {}", side.errors, side.episodes,
                                   Percent(share), GivenPercent(rule.max_error_share));
    evidence.more = "Mend what failed and run those again (evac resume --retry-failed).";
  } else if (evidence.initial_states < rule.min_states) {
    evidence.blocked = fmt::format("{} of at least {} states", evidence.initial_states, rule.min_states);
    evidence.more = fmt::format("The rule asks for {}.",
                                Counted(rule.min_states - evidence.initial_states, "more initial state"));
  }
}

}  // namespace

Evidence Examine(const GateRule& rule, const GateInput& input) {
  const GateSides sides = SidesOf(rule, input.data);
  Evidence evidence;
  RuleDecision& decision = evidence.decision;
  decision.name = rule.name;
  decision.test = Name(rule.test);
  decision.metric = rule.metric;
  decision.task = rule.task;
  decision.world = sides.world;
  decision.policy = sides.candidate.policy;
  decision.baseline_policy = sides.baseline.policy;
  if (sides.candidate.cells.empty()) {
    decision.statement = NothingYet(rule, sides);
    decision.p = Undefined{"no episode is there yet"};
  } else if (rule.ComparesPairs()) {
    ComparePairs(rule, input, sides, evidence);
  } else if (rule.Compares()) {
    CompareUnpaired(rule, sides, evidence);
  } else {
    ExamineQuality(rule, input.run, sides, evidence);
  }
  AskForAJudge(rule, input.run, evidence);
  BlockPart(rule, input, sides, evidence);
  if (evidence.blocked.empty()) Block(rule, input, sides, evidence);
  return evidence;
}

}  // namespace evac
