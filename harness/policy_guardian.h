#pragma once

namespace evac {

/// What the guardian needs, prepared before the fork: after it, in a copy of a program that had threads, nothing may
/// allocate or lock.
struct GuardianOptions {
  char* const* arguments;         ///< program (looked up in PATH) first, null-terminated
  char* const* environment;       ///< null-terminated
  const char* working_directory;  ///< null: stay
  int log_fd;                     ///< stdout and stderr of the policy
  int harness_fd;                 ///< reads end-of-file when the harness is gone or wants an end
  int grace_ms;                   ///< between SIGTERM and SIGKILL
};

/// The whole life of the guardian process (policy_process.h): starts the policy in a session of its own, waits until it
/// ends or the harness is gone, ends everything that descends from it, and exits as the policy did (128 + n after
/// signal n). To be called in the child of a fork. Async-signal-safe.
[[noreturn]] void Guard(const GuardianOptions& options);

}  // namespace evac
