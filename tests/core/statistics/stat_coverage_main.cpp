#include <fmt/core.h>

#include <charconv>
#include <cstdio>
#include <string>
#include <string_view>

#include "tests/core/statistics/coverage.h"

namespace evac::coverage {
namespace {

void Print(const char* title, const std::vector<Row>& rows) {
  fmt::print("### {}\n\n| n | setting |", title);
  for (const Coverage& method : rows.front().methods) fmt::print(" {} |", method.method);
  fmt::print("\n|---|---|");
  for (std::size_t i = 0; i < rows.front().methods.size(); ++i) fmt::print("---|");
  for (const Row& row : rows) {
    fmt::print("\n| {} | {} |", row.n, row.setting);
    for (const Coverage& method : row.methods) {
      fmt::print(" {:.3f} / {:.2f}{} |", method.share, method.mean_width,
                 method.without > 0 ? fmt::format(" ({} without)", method.without) : "");
    }
  }
  fmt::print("\n\n");
  std::fflush(stdout);
}

void Print(const std::vector<FalseAlarms>& table) {
  fmt::print(
      "### False alarms under peeking, two equal policies, alpha .05\n\n| setting | test | false alarms "
      "|\n|---|---|---|\n");
  for (const FalseAlarms& row : table) fmt::print("| {} | {} | {:.3f} |\n", row.setting, row.test, row.share);
}

void Print(const std::vector<MmrvPasses>& table) {
  fmt::print("### \"MMRV at most .1\", alpha .05, two policies\n\n| real, sim | states | before | now |\n");
  fmt::print("|---|---|---|---|\n");
  for (const MmrvPasses& row : table) {
    fmt::print("| {} (true {:.2g}) | {} | {:.3f} | {:.3f} |\n", row.setting, row.truth, row.states, row.passes.before,
               row.passes.now);
  }
  fmt::print("\n");
}

void Print(const std::vector<RepeatedDifference>& table) {
  fmt::print("### 90 % intervals of differences of repeats, before / now\n\n");
  fmt::print("| states x repeats, flips better and worse | rho | coverage | shown |\n|---|---|---|---|\n");
  for (const RepeatedDifference& row : table) {
    fmt::print("| {} | {} | {:.3f} / {:.3f} | {:.3f} / {:.3f} |\n", row.setting, row.rho, row.covered.before,
               row.covered.now, row.shown.before, row.shown.now);
  }
}

void PrintDecisions(const SimulationOptions& options) {
  fmt::print("Decision 0012, {} replicates, seed {}.\n\n", options.replicates, options.seed);
  Print(PassesOfMmrv(options));
  Print(DifferencesOfRepeats(options));
}

void PrintAll(const SimulationOptions& options) {
  fmt::print("Coverage / mean width of 95 % intervals, {} replicates (the bootstrap: {}, B = 500), seed {}.\n\n",
             options.replicates, options.replicates / 10, options.seed);
  Print("One rate", Rates(options));
  Print("Difference of two rates", Differences(options));
  Print("Kappa of a judge, n initial states", Kappas(options));
  Print("Sensitivity and Brier's score of a judge, n initial states", SensitivitiesAndBriers(options));
  Print("The real rate from n real and 10 n further imagined trials", FewReal(options));
  Print("Pearson's r over 6 policies", Bootstrap({options.replicates / 10, options.seed}));
  Print(Peeking(options));
}

bool ParseNumber(std::string_view text, auto& number) {
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), number);
  return error == std::errc() && end == text.data() + text.size() && number > 0;
}

}  // namespace
}  // namespace evac::coverage

/// Prints the simulation tables of docs/statistics.md, or with "decisions" those of
/// docs/decisions/0012-interval-of-record.md. stat_coverage [REPLICATES [SEED [decisions]]]
int main(int argc, char** argv) {
  evac::coverage::SimulationOptions options{.replicates = 10000, .seed = 1};
  const bool understood = argc <= 4 && (argc < 2 || evac::coverage::ParseNumber(argv[1], options.replicates)) &&
                          (argc < 3 || evac::coverage::ParseNumber(argv[2], options.seed)) &&
                          (argc < 4 || argv[3] == std::string_view("decisions")) && options.replicates >= 10;
  if (!understood) {
    fmt::print(stderr,
               "Usage: stat_coverage [REPLICATES, 10000, at least 10 [SEED, 1 [decisions]]]\nPrints the simulation "
               "tables of docs/statistics.md, or those of docs/decisions/0012-interval-of-record.md.\n");
    return 2;
  }
  if (argc == 4) {
    evac::coverage::PrintDecisions(options);
  } else {
    evac::coverage::PrintAll(options);
  }
  return 0;
}
