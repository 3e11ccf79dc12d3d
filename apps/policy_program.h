#pragma once

#include <fmt/core.h>

#include <CLI/CLI.hpp>
#include <cstdio>

#include "core/error.h"
#include "policies/policy_server.h"

namespace evac {

/// Where a policy listens, as options or from the environment that the harness sets for the policies it starts.
inline void AddAddressOptions(CLI::App& app, LcmAddress& address) {
  app.add_option("--url", address.url, "where to listen")->envname("EVAC_LCM_URL")->capture_default_str();
  app.add_option("--token", address.token, "word inside the channels' names")
      ->envname("EVAC_TOKEN")
      ->capture_default_str();
}

/// Parses, and by that runs the callback of what was asked for, which sets `exit_code`. @returns the process's exit
/// code; whatever was wrong has been said on stderr.
inline int RunPolicyProgram(CLI::App& app, int argc, char** argv, const int& exit_code) {
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    return app.exit(error) == 0 ? 0 : static_cast<int>(ExitCode::kInvalidInput);
  } catch (const Error& error) {
    fmt::print(stderr, "evac-policy: {}\n", error.what());
    return static_cast<int>(error.exit_code());
  } catch (const std::exception& error) {
    fmt::print(stderr, "evac-policy: internal error: {}\n", error.what());
    return static_cast<int>(ExitCode::kInternal);
  }
  return exit_code;
}

}  // namespace evac
