#pragma once

#include <signal.h>
#include <sys/types.h>
#include <sys/wait.h>

#include <chrono>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <functional>
#include <sstream>
#include <string>
#include <thread>
#include <vector>

/// Finds and ends the processes of one test: those that carry its mark in their environment.
namespace evac::system_test {

/// While it lives, everything that the test starts carries the mark.
class Mark {
 public:
  explicit Mark(const std::string& mark) : entry_("EVAC_TEST_MARK=" + mark) {
    ::setenv("EVAC_TEST_MARK", mark.c_str(), 1);
  }
  ~Mark() { ::unsetenv("EVAC_TEST_MARK"); }

  /// Those whose program's name is `program`; empty: all. Zombies have no environment and do not count.
  std::vector<pid_t> Processes(const std::string& program = "") const {
    std::vector<pid_t> found;
    for (const auto& entry : std::filesystem::directory_iterator("/proc")) {
      const std::string name = entry.path().filename();
      if (name.find_first_not_of("0123456789") != std::string::npos || std::stoi(name) == ::getpid()) continue;
      if (!Text(entry.path() / "environ").contains(entry_)) continue;
      const std::string comm = Text(entry.path() / "comm");
      if (program.empty() || comm == program + "\n") found.push_back(std::stoi(name));
    }
    return found;
  }

 private:
  /// Lines, or entries of an environment: whether one of them is this.
  struct Contents : std::string {
    bool contains(const std::string& entry) const {
      return (std::string(1, '\0') + *this).find('\0' + entry + '\0') != npos;
    }
  };
  static Contents Text(const std::filesystem::path& path) {
    std::ostringstream text;
    text << std::ifstream(path, std::ios::binary).rdbuf();
    return {text.str()};
  }
  std::string entry_;
};

/// @returns whether it came true in time.
inline bool WaitUntil(const std::function<bool()>& is_true, double patience_s = 60) {
  const auto end = std::chrono::steady_clock::now() + std::chrono::duration<double>(patience_s);
  while (!is_true()) {
    if (std::chrono::steady_clock::now() > end) return false;
    std::this_thread::sleep_for(std::chrono::milliseconds(10));
  }
  return true;
}

inline void KillAll(const std::vector<pid_t>& processes) {
  for (const pid_t process : processes) ::kill(process, SIGKILL);
}

}  // namespace evac::system_test
