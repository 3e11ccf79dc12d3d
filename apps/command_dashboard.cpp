#include <fmt/format.h>

#include <chrono>
#include <cstdio>
#include <memory>
#include <thread>

#include "apps/commands.h"
#include "apps/interrupts.h"
#include "core/version.h"
#include "reports/dashboard.h"

namespace evac {
namespace {

/// Until somebody interrupts.
void ServeDashboard(const DashboardOptions& options) {
  Dashboard dashboard(options);
  const CatchInterrupts interrupts;
  std::thread server([&dashboard] { dashboard.Serve(); });
  fmt::print("{}\n", dashboard.url());
  std::fflush(stdout);
  while (!IsInterrupted()) std::this_thread::sleep_for(std::chrono::milliseconds(50));
  dashboard.Stop();
  server.join();
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
  command->add_option("--judge", options->summary.judge, "whose verdicts are counted")->capture_default_str();
  command->footer(
      "Examples:\n"
      "  evac dashboard out/demo\n"
      "  evac dashboard out/monday out/tuesday --port 0\n"
      "Reads only. Ends with Ctrl-C. docs/dashboard.md.");
  command->callback([options, &exit_code] {
    ServeDashboard(*options);
    exit_code = ExitCode::kOk;
  });
}

}  // namespace evac
