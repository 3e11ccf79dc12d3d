#pragma once

#include <chrono>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "policies/messages.h"

struct _lcm_t;

namespace evac {

/// Where a run and its policy meet: an LCM URL, and a token inside the channel names. LCM delivers everything sent to
/// one URL to everyone who listens there, so runs differ in both: the port keeps them apart, the token shows it if the
/// ports collide.
struct LcmAddress {
  /// Where `evac-policy` listens and `evac run` looks for a policy that already runs, unless told otherwise.
  std::string url = "udpm://239.255.76.67:7667?ttl=0&recv_buf_size=4194304";
  std::string token = "evac";  ///< 1 … 32 of A–Z a–z 0–9 -

  /// An address of its own for anything with a unique name, such as "<run folder> <process id> <policy>".
  static LcmAddress For(const std::string& unique_name);
  /// EVAC_LCM_URL and EVAC_TOKEN, as the harness sets them for the policies it starts; the defaults where they are
  /// unset.
  static LcmAddress FromEnvironment();

  /// "EVAC_<token>_<message>".
  std::string Channel(const std::string& message) const;
  /// Any token's channel of that message, as a regular expression: listening to it makes strangers countable.
  static std::string AnyChannel(const std::string& message) { return "EVAC_.*_" + message; }
};

/// How fast bytes may leave, so that a receiver's socket buffer bears it: unpaced bursts of 150 kB lose most of their
/// messages on loopback, the same at 75 MB/s none (measured). A burst below `burst_bytes` goes out at once; so does one
/// message above it, whose fragments LCM sends without a pause.
struct Pacing {
  double bytes_per_s = 50e6;
  double burst_bytes = 64e3;
};

/// One membership in an LCM network: publishing at a pace, and handlers that get raw bytes and may throw.
/// Used by one thread; LCM receives in a thread of its own meanwhile, up to 4096 messages ahead per subscription.
class LcmLink {
 public:
  using Handler = std::function<void(const std::string& channel, std::span<const std::uint8_t> bytes)>;

  /// @throws InvalidInput if the URL is malformed or this machine has no route for multicast; the message says what to
  /// do.
  explicit LcmLink(const std::string& url, const Pacing& pacing = {});
  ~LcmLink();
  LcmLink(const LcmLink&) = delete;
  LcmLink& operator=(const LcmLink&) = delete;

  /// @param channels  a regular expression, anchored at both ends. Exceptions of `handler` come out of Handle.
  void Subscribe(const std::string& channels, Handler handler);

  /// Waits at most `timeout_s` for a message, then handles it and all others that are already here.
  void Handle(double timeout_s);

  /// Waits at most `timeout_s` for a message and handles that one.
  /// @returns whether one came.
  bool HandleOne(double timeout_s);

  /// @throws Error if the system refuses to send.
  template <typename Message>
  void Publish(const std::string& channel, const Message& message) {
    PublishBytes(channel, Encoded(message));
  }
  void PublishBytes(const std::string& channel, std::span<const std::uint8_t> bytes);

 private:
  struct Subscription;
  void WaitForTurn(std::size_t bytes);

  _lcm_t* lcm_;
  Pacing pacing_;
  double backlog_bytes_ = 0;  ///< sent and, at the pace, not yet drained
  std::chrono::steady_clock::time_point drained_until_;
  std::vector<std::unique_ptr<Subscription>> subscriptions_;
  std::exception_ptr thrown_;  ///< by a handler, on its way around C
};

/// Sends a message to itself. Nothing if it comes back; else what is wrong and what to do about it (`evac doctor`).
std::optional<std::string> WhatIsWrongWithLcm(const std::string& url = LcmAddress().url);

}  // namespace evac
