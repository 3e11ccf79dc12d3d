#pragma once

#include <signal.h>
#include <sys/wait.h>

#include <filesystem>
#include <string>
#include <vector>

#include "tests/support/command.h"

namespace evac {

/// A program that a test runs beside itself: it goes with the test, however that ends.
class Child {
 public:
  /// @param words  the program (absolute) and its arguments. @param log  where its output goes.
  Child(const std::vector<std::string>& words, const std::filesystem::path& log) : pid_(StartCommand(words, log)) {}
  ~Child() {
    if (pid_ > 0) End(SIGKILL);
  }
  Child(const Child&) = delete;
  Child& operator=(const Child&) = delete;

  pid_t pid() const { return pid_; }

  /// Sends the signal and waits for the end; once. @returns the status that waitpid tells.
  int End(int signal) {
    ::kill(pid_, signal);
    int status = -1;
    ::waitpid(pid_, &status, 0);
    pid_ = 0;
    return status;
  }

 private:
  pid_t pid_;
};

}  // namespace evac
