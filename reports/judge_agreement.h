#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "core/statistics/calibration.h"
#include "core/statistics/confusion.h"
#include "core/statistics/estimate.h"
#include "reports/summary.h"

/// How far each judge may be believed: against the best judge there is, in each world, since a judge that reads real
/// videos well may misread imagined ones (docs/statistics.md). The best of a world is people where they told an outcome
/// there, else the oracle where it did, else the best of the run.
namespace evac {

/// One judge in one world.
struct JudgeAgreement {
  std::string judge, against, world;
  Confusion confusion;      ///< episodes that both called success or failure
  std::int64_t apart = 0;   ///< that both judged, and one of them called neither
  std::int64_t judged = 0;  ///< verdicts of the judge in this world
  ConfusionStatistics statistics;
  Estimate bias;  ///< the judge's share of successes - the truth's, on the compared episodes, Tango's interval
  Calibration calibration;  ///< of its probabilities of success, where it gives any
  bool IsCalibrated() const { return confusion.total() > 0; }
};

struct JudgeReport {
  std::string truth;                   ///< the run's: "human" where people judged any episode, else "oracle", else the
                                       ///< judge that is counted
  std::vector<JudgeAgreement> judges;  ///< every judge but the truth, and raters where people are it, by judge and world;
                                       ///< those that spoke there. The best of a world that is not the run's is held
                                       ///< against the run's, which told nothing there: it is not calibrated
  std::vector<std::string> raters;     ///< "human:anna", …
  /// Krippendorff's, nominal, over the raters, of success and failure alone; a rating session's board counts "cannot
  /// tell" as a third answer.
  Number alpha = Undefined{"fewer than two human raters"};
  std::int64_t rated_twice = 0;  ///< episodes that two or more raters called one of the two
};

JudgeReport JudgesOf(const RunSummary& summary);

/// "human"; where worlds differ, "human in real, oracle in sim".
std::string HeldAgainst(const JudgeReport& report);

}  // namespace evac
