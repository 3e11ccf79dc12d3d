#pragma once

#include <chrono>
#include <condition_variable>
#include <cstdint>
#include <filesystem>
#include <map>
#include <mutex>
#include <optional>
#include <string>
#include <thread>
#include <vector>

namespace evac {

struct PolicyProcessOptions {
  std::vector<std::string> command;                ///< program (looked up in PATH) and arguments, not empty
  std::map<std::string, std::string> environment;  ///< added to the harness's own
  std::filesystem::path working_directory;         ///< empty: the harness's
  std::filesystem::path log;                       ///< its stdout and stderr are appended here
  double first_restart_after_s = 0.2;              ///< back-off after a death; doubles with each …
  double longest_back_off_s = 5;                   ///< … up to this
  int restarts = 5;  ///< more deaths than this within `window_s`: given up; at once after exit
                     ///< code 127 (not found) or 2 (refuses its options)
  double window_s = 60;
  double grace_s = 1;  ///< between SIGTERM and SIGKILL: short, so that Ctrl-C ends a run within two seconds
};

/// A policy's process, started, watched, restarted and stopped. Nothing of it outlives the harness:
///
///   harness ── guardian ── the policy's command (its own session) ── whatever it starts
///
/// The guardian is a fork of the harness that does nothing but wait. It ends everything below it, also what left the
/// policy's session (it is the "subreaper" of its descendants), when the policy ends, when Stop asks for it, or when
/// the harness is gone, be it by SIGKILL: it sees its pipe to the harness close. If the guardian itself is killed, the
/// policy gets SIGKILL.
class PolicyProcess {
 public:
  /// Starts it. @throws InvalidInput if the command is empty or the log cannot be written.
  explicit PolicyProcess(PolicyProcessOptions options);
  /// Stops it.
  ~PolicyProcess();
  PolicyProcess(const PolicyProcess&) = delete;
  PolicyProcess& operator=(const PolicyProcess&) = delete;

  /// SIGTERM to all of it, `grace_s`, SIGKILL; returns when nothing is left. Idempotent.
  void Stop();

  /// Ends it, as Stop does, to be started again after the usual back-off: it hangs. Returns at once. Thread-safe.
  /// @param asked  what it did not answer; one that was started since is loading, and goes on
  void Restart(std::chrono::steady_clock::time_point asked);

  /// Why it is not coming back: "its process ended 6 times within 60 s, at last with exit code 3: <its last line>
  /// (policy.log)"; of one that Restart ended "at last by evac because it was silent". Nothing while it runs or is about
  /// to be restarted, and after Stop. Thread-safe.
  std::optional<std::string> WhyGone() const;

  int restarts() const;  ///< so far. Thread-safe.

 private:
  void Supervise();
  int RunOnce();
  void GiveUp(int deaths, int status);

  PolicyProcessOptions options_;
  mutable std::mutex mutex_;
  std::condition_variable stopping_changed_;
  bool stopping_ = false;
  int alive_pipe_ = -1;                            ///< closing it asks the guardian to end
  std::chrono::steady_clock::time_point started_;  ///< when that process was
  bool was_silent_ = false;                        ///< that process: Restart ended it
  int restarts_ = 0;
  std::int64_t log_before_ = 0;  ///< bytes that the log had when the process was last started
  std::optional<std::string> why_gone_;
  std::thread supervisor_;
};

}  // namespace evac
