#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <chrono>
#include <cstdio>
#include <future>
#include <memory>
#include <set>

#include "apps/commands.h"
#include "apps/interrupts.h"
#include "core/store.h"
#include "core/version.h"
#include "reports/counted_judges.h"
#include "reports/dashboard.h"

namespace evac {
namespace {

/// Nobody need have judged yet, nor need a run be there; but who names judges wants their verdicts of one run at least.
void DemandVerdicts(const DashboardOptions& options) {
  std::set<std::string> there;
  for (const std::filesystem::path& run : options.runs) {
    try {
      const std::vector<std::string> judges = Store::Open(run, Store::Mode::kReadOnly).Judges();
      const std::string counted = FullJudgeNames(options.summary.judge, judges);
      if (std::ranges::any_of(judges, [&](const std::string& judge) { return IsCounted(judge, counted); })) return;
      there.insert(judges.begin(), judges.end());
    } catch (const Error&) {  // that run is listed with the reason
    }
  }
  if (there.empty()) return;
  throw InvalidInput("--judge: found '{}', wanted one who has judged any of the runs: {}", options.summary.judge,
                     fmt::join(there, ", "));
}

/// Until somebody interrupts.
void ServeDashboard(const DashboardOptions& options) {
  Dashboard dashboard(options);
  const CatchInterrupts interrupts;
  fmt::print("{}\n", dashboard.url());
  std::fflush(stdout);
  std::future<void> server = std::async(std::launch::async, [&dashboard] { dashboard.Serve(); });
  while (!IsInterrupted() && server.wait_for(std::chrono::milliseconds(50)) != std::future_status::ready) {
  }
  dashboard.Stop();
  server.get();
}

}  // namespace

void AddDashboard(CLI::App& app, ExitCode& exit_code) {
  const auto options = std::make_shared<DashboardOptions>();
  options->program = "evac " EVAC_VERSION;
  options->port = 8765;
  CLI::App* command = app.add_subcommand("dashboard", "Serve the reports of several runs, live while they go on.");
  command->add_option("RUN", options->runs, "folders of runs, oldest first")->required();
  command->add_option("--host", options->host, "address to listen at; another than 127.0.0.1 is open to the network")
      ->capture_default_str();
  command->add_option("--port", options->port, "0: any that is free")
      ->check(CLI::Range(0, 65535))
      ->capture_default_str();
  const CLI::Option* judge =
      command
          ->add_option("--judge", options->summary.judge,
                       "whose verdicts are counted; with commas, of each episode the first who can tell: "
                       "oracle,classifier")
          ->capture_default_str();
  command->footer(
      "Examples:\n"
      "  evac dashboard out/demo\n"
      "  evac dashboard out/monday out/tuesday --port 0\n"
      "Reads only. Ends with Ctrl-C. docs/dashboard.md.");
  command->callback([options, judge, &exit_code] {
    if (judge->count() > 0) DemandVerdicts(*options);
    ServeDashboard(*options);
    exit_code = ExitCode::kOk;
  });
}

}  // namespace evac
