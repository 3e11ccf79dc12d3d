#pragma once

#include <chrono>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <string>

#include "core/policy.h"
#include "core/store.h"
#include "policies/lcm_link.h"
#include "policies/spec.h"

namespace evac {

struct LcmPolicyOptions {
  LcmAddress address{};
  double deadline_s = 20;  ///< from a request's first sending, or the last answer to another of the same Act, to giving
                           ///< it up as policy_timeout: one that answers in turn is given its time for each
  double start_s = 0;  ///< for an episode's start, if longer: a process that was restarted may have much to load. So
                       ///< long waits meanwhile whoever else asks: a policy that begins one's episode answers nobody
  double repeat_after_s =
      0.5;                  ///< before the first repeat of what was not answered; doubles with each, up to eightfold
  bool raw_images = false;  ///< exact pixels instead of JPEG; for tests
  int jpeg_quality = 95;    ///< 0 … 100
  Pacing pacing{};
  /// Asked while waiting: why nobody will ever answer (PolicyProcess::WhyGone), so that nobody waits for the deadline.
  std::function<std::optional<std::string>()> why_gone{};
  /// Called when the policy was silent for a whole deadline, once for all who wait, with the time since which it was:
  /// when it was asked, or gave its last answer to another of the same Act. It hangs, unless it was started since
  /// (PolicyProcess::Restart). May be empty.
  std::function<void(std::chrono::steady_clock::time_point asked)> restart{};
  /// Asked while waiting: the user wants an end. Who waits gets a Failure at once; nobody is to keep it. May be empty.
  std::function<bool()> interrupted{};
  bool keep_longer_chunks = false;  ///< a chunk longer than the harness executes stays whole (policy latency needs it)
  std::string who{};        ///< "policy good@v1", the suite's entry: begins what a handshake refuses. May be empty
  std::string if_silent{};  ///< what helps then, its end; empty: how a policy that runs elsewhere joins
};

/// A policy in another process, at the end of an LCM link (docs/formats/policy_wire.md).
///
/// What the wire does is never the run's end: what stays unanswered until its deadline becomes Failure{policy_timeout},
/// an error reply or a malformed one becomes Failure{policy_error} with what and where, for that scene alone. Replies
/// that answer something else are recognised and counted. Repeats change no result: the server answers them from its
/// cache.
///
///   LcmPolicy policy({.address = LcmAddress::For(run_name)});
///   const PolicySpec declared = policy.Handshake(HarnessSpec(task, chunk_size), 30);
///   RunEpisodes(policy, world, …);
class LcmPolicy : public Policy {
 public:
  /// @throws InvalidInput if there is no multicast here or the options are out of range.
  explicit LcmPolicy(LcmPolicyOptions options);
  ~LcmPolicy() override;

  /// Both sides declare. To be called once, before the first Reset; a process that is only just starting has `wait_s`
  /// for it.
  /// @returns what the policy declared.
  /// @throws InvalidInput if they do not fit together (both declarations side by side), if nobody answers within
  /// `wait_s`,
  ///         or if two policies answer on this address.
  /// A process that is started again is asked too: if it declares otherwise, its episodes fail with what changed.
  PolicySpec Handshake(const PolicySpec& harness, double wait_s);

  /// How many processes have declared themselves here: one more whenever it was started again. What a new one answers
  /// comes after its declaration.
  int declared() const;

  /// The policy's declared name; before the handshake the token.
  std::string Name() const override;

  /// Returns at once: the start travels with the next Act, where a refusal is a policy_error.
  void Reset(SceneId scene, const Task& task, std::uint64_t seed) override;

  /// All scenes' requests are sent before the first answer is awaited. Chunks longer than the harness's are cut to it.
  /// ActionChunk::thinking_s is the time from a request's first sending to its answer, without what this process was
  /// stopped for meanwhile (SIGSTOP): the policy may have been stopped with it.
  std::vector<Acted> Act(std::span<const SceneObservation> batch) override;

  /// repeats, stale_replies (of an earlier request), duplicate_replies, late_replies (after the deadline),
  /// reordered_replies (overtaken by a later one), foreign_replies (another run's, token's or client's),
  /// undecodable_replies, timeouts, malformed_replies, error_replies.
  const Counters& counters() const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace evac
