#include <fmt/core.h>

#include <cerrno>
#include <cstdio>
#include <cstring>

#include "apps/command_rate.h"
#include "apps/commands.h"
#include "core/standard_streams.h"
#include "core/tensor_file.h"
#include "core/version.h"

namespace {

/// @returns the exit code of what the words asked for.
int Main(int argc, char** argv) {
  CLI::App app("evac: find out, without a robot, how well a policy works.", "evac");
  app.set_version_flag("--version", EVAC_VERSION);
  app.require_subcommand(1);
  app.footer(
      "First steps:\n  evac run apps/configs/demo.yaml --out out/demo\n  evac report out/demo\n"
      "Exit codes: 0 ok, 1 the answer is no, 2 invalid input, 3 inconclusive, 4 internal error, error budget spent, or "
      "interrupted.");
  evac::ExitCode exit_code = evac::ExitCode::kOk;
  try {
    evac::AddRun(app, exit_code);
    evac::AddResume(app, exit_code);
    evac::AddMerge(app, exit_code);
    evac::AddJudge(app, exit_code);
    evac::AddCorrelate(app, exit_code);
    evac::AddReport(app, exit_code);
    evac::AddDashboard(app, exit_code);
    evac::AddPlan(app, exit_code);
    evac::AddCompare(app, exit_code);
    evac::AddImportReal(app, exit_code);
    evac::AddTrust(app, exit_code);
    evac::AddGate(app, exit_code);
    evac::AddFidelity(app, exit_code);
    evac::AddValidate(app, exit_code);
    evac::AddDoctor(app, exit_code);
    evac::AddLs(app, exit_code);
    evac::AddWeights(app, exit_code);
    evac::AddImagine(app, exit_code);
    evac::AddTrain(app, exit_code);
    evac::AddEncode(app, exit_code);
    evac::AddCollect(app, exit_code);
    evac::AddPack(app, exit_code);
    evac::AddVary(app, exit_code);
    evac::AddRate(app, exit_code);
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    return app.exit(error) == 0 ? 0 : static_cast<int>(evac::ExitCode::kInvalidInput);
  } catch (const evac::Error& error) {
    std::fputs(fmt::format("evac: {}\n", error.what()).c_str(), stderr);
    return static_cast<int>(error.exit_code());
  } catch (const evac::TensorWriteError& error) {  // a full disk
    std::fputs(fmt::format("evac: {}\n", error.what()).c_str(), stderr);
    return static_cast<int>(evac::ExitCode::kInternal);
  } catch (const evac::TensorError& error) {  // a file of weights that is none, or another network's
    std::fputs(fmt::format("evac: {}\n", error.what()).c_str(), stderr);
    return static_cast<int>(evac::ExitCode::kInvalidInput);
  } catch (const std::exception& error) {
    std::fputs(fmt::format("evac: internal error: {}\n", error.what()).c_str(), stderr);
    return static_cast<int>(evac::ExitCode::kInternal);
  }
  return static_cast<int>(exit_code);
}

}  // namespace

/// Results that a full disk did not take are no results, whatever was decided.
int main(int argc, char** argv) {
  constexpr int kInternal = static_cast<int>(evac::ExitCode::kInternal);
  evac::OpenStandardStreams();
  const int exit_code = Main(argc, argv);
  const bool is_written = std::fflush(stdout) == 0 && std::ferror(stdout) == 0;
  if (is_written || exit_code == kInternal) return exit_code;
  std::fputs(fmt::format("evac: standard output cannot be written: {}\n", std::strerror(errno)).c_str(), stderr);
  return kInternal;
}
