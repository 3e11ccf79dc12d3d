#pragma once

#include <atomic>
#include <map>
#include <memory>
#include <string>

#include "core/policy.h"
#include "core/store.h"
#include "policies/lcm_link.h"
#include "policies/spec.h"

namespace evac {

/// Serves any Policy over LCM (docs/write_a_policy.md): declares itself, keeps the episodes of every client apart,
/// gathers a request's images in whatever order they come, answers a repeated request from its cache, and turns
/// exceptions into error replies.
///
/// The wrapped policy gets a Task with id, instruction, arms, cameras (those it declared to need), period_s and
/// workspace_m: what travels, nothing else. It is asked for one scene at a time, by one thread.
class PolicyServer {
 public:
  /// @param policy  outlives the server.
  /// @throws InvalidInput if there is no multicast here.
  PolicyServer(Policy& policy, PolicySpec spec, const LcmAddress& address = LcmAddress::FromEnvironment());
  ~PolicyServer();

  /// Answers until Stop is called, by another thread or by the policy: what is under way then is answered, what waits
  /// behind it is not.
  void Run();
  void Stop() { stop_ = true; }
  bool stopped() const { return stop_; }

  /// Waits at most `timeout_s` for a message and answers that one.
  void Handle(double timeout_s);

  /// requests, repeated_requests, stale_requests, foreign_messages, undecodable_messages, errors, resets.
  const Counters& counters() const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
  std::atomic<bool> stop_ = false;
};

/// The rest of a policy's `main`: serves until SIGTERM, SIGINT or the harness that started it is gone.
/// Call it before the policy starts threads of its own, or block SIGTERM and SIGINT in those.
/// @returns the process's exit code, 0.
int ServePolicy(Policy& policy, const PolicySpec& spec, const LcmAddress& address = LcmAddress::FromEnvironment());

}  // namespace evac
