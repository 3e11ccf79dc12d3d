#pragma once

#include <sys/types.h>

#include <filesystem>
#include <string>
#include <vector>

namespace evac {

struct CommandResult {
  int exit_code = -1;  ///< 128 + signal if it was killed
  std::string out, err;
};

/// In a process that is to become a program under test: interrupts do what they do on a terminal, whatever the caller
/// of the tests ignores (a script's `&` ignores Ctrl-C, `nohup` the closed terminal).
void HearInterrupts();

/// Runs a program to its end. @param words  the program (absolute) and its arguments.
CommandResult RunCommand(const std::vector<std::string>& words);

/// Starts a program with its output in `log`; the caller waits for it.
pid_t StartCommand(const std::vector<std::string>& words, const std::filesystem::path& log);

/// The built binary of that name, beside the test.
std::string Binary(const std::string& name);

}  // namespace evac
