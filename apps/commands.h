#pragma once

#include <CLI/CLI.hpp>

#include "core/error.h"

namespace evac {

/// Each adds one subcommand of `evac` to `app`; when it was chosen, its callback does the work and sets `exit_code`.
/// Callbacks may throw Error; `main` prints it and ends with its exit code. One file each: command_run.cpp, …
void AddRun(CLI::App& app, ExitCode& exit_code);
void AddResume(CLI::App& app, ExitCode& exit_code);
void AddMerge(CLI::App& app, ExitCode& exit_code);
void AddJudge(CLI::App& app, ExitCode& exit_code);
void AddCorrelate(CLI::App& app, ExitCode& exit_code);
void AddReport(CLI::App& app, ExitCode& exit_code);
void AddDashboard(CLI::App& app, ExitCode& exit_code);
void AddValidate(CLI::App& app, ExitCode& exit_code);
void AddDoctor(CLI::App& app, ExitCode& exit_code);
void AddCompare(CLI::App& app, ExitCode& exit_code);
void AddImportReal(CLI::App& app, ExitCode& exit_code);
void AddGate(CLI::App& app, ExitCode& exit_code);
void AddFidelity(CLI::App& app, ExitCode& exit_code);
void AddTrust(CLI::App& app, ExitCode& exit_code);
void AddPlan(CLI::App& app, ExitCode& exit_code);
void AddLs(CLI::App& app, ExitCode& exit_code);
void AddWeights(CLI::App& app, ExitCode& exit_code);
void AddImagine(CLI::App& app, ExitCode& exit_code);
void AddTrain(CLI::App& app, ExitCode& exit_code);
void AddTrainJudge(CLI::App& group, ExitCode& exit_code);
void AddTrainPolicy(CLI::App& group, ExitCode& exit_code);
/// Its second `train`, of the judge: `evac judge train`.
void AddJudgeTrain(CLI::App& judge, ExitCode& exit_code);
void AddEncode(CLI::App& app, ExitCode& exit_code);
void AddCollect(CLI::App& app, ExitCode& exit_code);
void AddPack(CLI::App& app, ExitCode& exit_code);
void AddVary(CLI::App& app, ExitCode& exit_code);

/// Of a command that does something of its own and has subcommands too, once these are added: its options before one of
/// them, which reads none, are refused.
inline void RefuseOptionsBeforeSubcommands(CLI::App& command) {
  for (CLI::App* subcommand : command.get_subcommands([](const CLI::App*) { return true; })) {
    subcommand->preparse_callback([&command, subcommand](std::size_t) {
      for (const CLI::Option* option : command.get_options()) {
        if (option->count() == 0) continue;
        throw CLI::ValidationError(option->get_name(), "means nothing before " + subcommand->get_name());
      }
    });
  }
}

}  // namespace evac
