#include "tests/core/statistics/coverage.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>

namespace evac::coverage {
namespace {

/// EVAC_LONG=1: enough to see a per cent; else enough to see a broken formula.
SimulationOptions Options() {
  const char* is_long = std::getenv("EVAC_LONG");
  return {.replicates = is_long && is_long[0] == '1' ? 20000 : 1000, .seed = 11};
}

/// Four standard errors of a share near `share`.
double Noise(double share) { return 4 * std::sqrt(share * (1 - share) / Options().replicates); }

const Coverage& Of(const Row& row, const std::string& method) {
  return *std::ranges::find(row.methods, method, &Coverage::method);
}

double MeanShare(const std::vector<Row>& rows, const std::string& method) {
  double sum = 0;
  for (const Row& row : rows) sum += Of(row, method).share;
  return sum / static_cast<double>(rows.size());
}

TEST(Coverage, WilsonHoldsItsPromiseOnAverageAndClopperPearsonAlways) {
  const std::vector<Row> rows = Rates(Options());
  EXPECT_NEAR(MeanShare(rows, "Wilson"), 0.95, 0.015);
  for (const Row& row : rows) {
    EXPECT_GT(Of(row, "Wilson").share, 0.90 - Noise(0.9)) << row.setting << ", n " << row.n;
    EXPECT_GT(Of(row, "Clopper-Pearson").share, 0.95 - Noise(0.95)) << row.setting << ", n " << row.n;
    EXPECT_LT(Of(row, "Wilson").mean_width, Of(row, "Clopper-Pearson").mean_width) << row.setting << ", n " << row.n;
  }
}

TEST(Coverage, TangoAndNewcombeHoldTheirPromiseAtTheSizesOfLabs) {
  for (const Row& row : Differences(Options())) {
    EXPECT_GT(Of(row, "Tango (paired)").share, 0.93 - Noise(0.93)) << row.setting << ", n " << row.n;
    EXPECT_GT(Of(row, "Bonett-Price (paired)").share, 0.93 - Noise(0.93)) << row.setting << ", n " << row.n;
    EXPECT_GT(Of(row, "Newcombe (unpaired)").share, 0.93 - Noise(0.93)) << row.setting << ", n " << row.n;
  }
}

TEST(Coverage, KappaByStateHoldsWhereClipsRepeatStatesAndFleissCohenEverittDoesNot) {
  for (const Row& row : Kappas(Options())) {
    const bool repeats = row.setting.find("1 clip ") == std::string::npos;
    if (row.n >= 40 && repeats) {
      EXPECT_GT(Of(row, "by state").share, 0.91 - Noise(0.91)) << row.setting << ", n " << row.n;
    }
    if (repeats) {
      EXPECT_LT(Of(row, "Fleiss-Cohen-Everitt").share, 0.85) << row.setting << ", n " << row.n;
    } else {
      EXPECT_EQ(Of(row, "by state").share, Of(row, "Fleiss-Cohen-Everitt").share) << row.n;
    }
  }
}

TEST(Coverage, SensitivityByStateHoldsWhereClipsRepeatStatesAndWilsonDoesNot) {
  for (const Row& row : SensitivitiesAndBriers(Options())) {
    const bool repeats = row.setting.find("1 clip ") == std::string::npos;
    if (row.n >= 40) {
      EXPECT_GT(Of(row, "sensitivity by state").share, 0.91 - Noise(0.91)) << row.setting << ", n " << row.n;
      EXPECT_GT(Of(row, "Brier by state").share, 0.88 - Noise(0.88)) << row.setting << ", n " << row.n;
    }
    if (repeats) {
      EXPECT_LT(Of(row, "sensitivity, Wilson").share, 0.91) << row.setting << ", n " << row.n;
    } else {
      EXPECT_EQ(Of(row, "sensitivity by state").share, Of(row, "sensitivity, Wilson").share) << row.n;
    }
  }
}

TEST(Coverage, MoverAndBettingHoldTheirPromiseWherePpiPlusPlusDoesNot) {
  double worst_normal = 1;
  for (const Row& row : FewReal(Options())) {
    EXPECT_GT(Of(row, "MOVER").share, 0.94 - Noise(0.94)) << row.setting << ", n " << row.n;
    EXPECT_GT(Of(row, "betting").share, 0.95 - Noise(0.95)) << row.setting << ", n " << row.n;
    worst_normal = std::min(worst_normal, Of(row, "PPI++ normal").share);
  }
  EXPECT_LT(worst_normal, 0.6) << "the reason why it is not shown";
}

TEST(Coverage, TheBootstrapCoversWhatOtherStatesWouldHaveGiven) {
  const SimulationOptions options{.replicates = Options().replicates / 10, .seed = 11};
  for (const Row& row : Bootstrap(options)) {
    const double noise = 4 * std::sqrt(0.9 * 0.1 / options.replicates);
    EXPECT_GT(Of(row, "percentile, of the mean r").share, 0.90 - noise) << row.setting << ", n " << row.n;
  }
}

TEST(Coverage, MmrvOfFewStatesPassesFalselyAtItsAlphaWhereThePercentileIntervalAlonePassesFarMore) {
  for (const MmrvPasses& row : PassesOfMmrv(Options())) {
    EXPECT_LE(row.passes.now, row.passes.before) << row.setting << ", n " << row.states;
    if (row.truth > 0.1) {
      const double promise = row.states == 20 ? 0.07 : 0.05;  // the percentile interval's own, which varied
      EXPECT_LE(row.passes.now, promise + Noise(promise)) << row.setting << ", n " << row.states;
      if (row.states <= 3) {
        EXPECT_GT(row.passes.before, 0.1) << row.setting << ", n " << row.states;
      }
    } else {
      EXPECT_GT(row.passes.now, 0.85) << row.setting << ", n " << row.states << ": policies that lie well apart";
    }
  }
}

TEST(Coverage, DifferencesOfRepeatsHoldTheirPromiseAndShowNothingThatStatesWithoutFlipsWouldNot) {
  for (const RepeatedDifference& row : DifferencesOfRepeats(Options())) {
    EXPECT_GT(row.covered.now, 0.88 - Noise(0.88)) << row.setting << ", rho " << row.rho;
    EXPECT_LE(row.shown.now, row.shown.before) << row.setting << ", rho " << row.rho;
    if (row.setting == "20 x 4, 0.01 and 0.11") {
      EXPECT_LE(row.shown.now, 0.05 + Noise(0.05)) << "worse by the margin";
    }
    if (row.setting == "20 x 4, 0 and 0.05") {
      EXPECT_GT(row.shown.before, 0.05) << row.rho;
      EXPECT_EQ(row.shown.now, 0) << row.rho << ": 20 states without any flip do not show it";
    }
  }
}

TEST(Peeking, SequentialTestsKeepTheirAlphaAndFixedOnesDoNot) {
  double worst_z = 0;
  for (const FalseAlarms& row : Peeking(Options())) {
    if (row.test == "z every 5") worst_z = std::max(worst_z, row.share);
    if (row.test.find("every step") == std::string::npos) continue;
    EXPECT_LE(row.share, 0.05 + Noise(0.05)) << row.test << ", " << row.setting;
  }
  EXPECT_GT(worst_z, 0.2) << "peeking is what breaks it";
}

}  // namespace
}  // namespace evac::coverage
