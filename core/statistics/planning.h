#pragma once

#include <cstdint>

#include "core/statistics/estimate.h"
#include "core/statistics/rates.h"

/// How many trials, before any is made (docs/statistics.md). All throw InvalidInput for shares outside [0, 1], or
/// alpha, power or confidence outside (0, 1).
namespace evac {

struct Promise {
  double alpha = 0.05;  ///< two-sided
  double power = 0.8;
};

/// A sample size as computed and rounded up.
struct SampleSize {
  Number exact = Undefined{"not computed"};
  std::int64_t n = 0;  ///< smallest whole number not below it; 0 where undefined
};

/// The smallest n whose Wilson interval at rate p is not wider than ± half_width, half_width > 0. At least 1.
std::int64_t TrialsForHalfWidth(double p, double half_width, double confidence = 0.95);
/// Half the width of Wilson's interval at rate p of n trials.
double WilsonHalfWidth(double p, std::int64_t n, double confidence = 0.95);

/// Trials per policy to tell two rates apart on different initial states: normal approximation without continuity
/// correction. Undefined for equal rates.
SampleSize TrialsPerPolicy(double p1, double p2, const Promise& promise = {});
/// The smallest difference d > 0 that n trials each tell apart from rate p: of p - d (and p + d) the one with room.
/// Undefined where not even 0 or 1 is far enough.
Number DetectableDifference(double p, std::int64_t n, const Promise& promise = {});

/// How often the outcomes of a pair differ, and which way.
struct FlipRates {
  double only_first = 0, only_second = 0;  ///< their sum at most 1
};
/// Power of the exact two-sided McNemar test with this many pairs, over the random number of flips.
double McNemarPower(std::int64_t pairs, const FlipRates& rates, double alpha = 0.05);
/// The smallest number of pairs from which on, for all sizes looked at, the power holds. Undefined for equal rates and
/// above `most` pairs.
SampleSize PairsForMcNemar(const FlipRates& rates, const Promise& promise = {}, std::int64_t most = 5000);

/// How many further pairs or trials, that repeat initial states as those there are do, until they tell as much as
/// `wanted` independent ones. At least 1; undefined from 2^53 on, beyond which they cannot be counted.
Defined<std::int64_t> FurtherWanted(double wanted, const Repeated& have);

/// Power of Fisher's exact two-sided test with n trials per policy.
double FisherPower(std::int64_t n, double p1, double p2, double alpha = 0.05);

/// Points (policies, checkpoints) to show a correlation of r: ((z_alpha/2 + z_power) / atanh r)² + 3. Undefined for r 0
/// and ±1.
SampleSize PointsForCorrelation(double r, const Promise& promise = {});

/// Pairs to show that the candidate's rate is not below the baseline's by `margin` or more, if they are equal and flip
/// in a share `discordance` of pairs: (z_1-alpha + z_power)² discordance / margin², alpha one-sided. No fewer than show
/// it where no pair flips, z_1-alpha² (1 - margin) / margin, and at least 1. @param margin  in (0, 1)
SampleSize PairsForNonInferiority(double discordance, double margin, const Promise& promise = {});
/// The same on different initial states, per policy, both with rate p: 2 p (1 - p) in place of the discordance.
SampleSize TrialsForNonInferiority(double p, double margin, const Promise& promise = {});

/// What a strict majority of raters achieves, each right with probability `accuracy`, independently.
struct PanelQuality {
  double majority_right = 0;  ///< of items with a majority or not
  double split = 0;           ///< share of items on which they do not all agree
};
PanelQuality PanelOf(int raters, double accuracy);
/// The smallest odd number of raters whose majority is right with at least this probability; 0 where no number of them
/// gets there (accuracy at most 1/2), or more than 99 were needed.
int RatersFor(double accuracy, double wanted_right);

}  // namespace evac
