#include "policies/lcm_link.h"

#include <arpa/inet.h>
#include <fmt/format.h>
#include <lcm/lcm.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <cstdlib>
#include <random>
#include <thread>
#include <utility>

#include "core/error.h"
#include "core/hash.h"

namespace evac {
namespace {

using Clock = std::chrono::steady_clock;

constexpr int kQueuedMessages = 4096;  ///< per subscription; LCM's own default of 30 loses bursts of images

void CheckToken(const std::string& token) {
  const auto is_plain = [](char c) { return std::isalnum(static_cast<unsigned char>(c)) || c == '-'; };
  if (token.empty() || token.size() > 32 || !std::all_of(token.begin(), token.end(), is_plain)) {
    throw InvalidInput("LCM token \"{}\": wanted 1 … 32 of A–Z a–z 0–9 -", token);
  }
}

/// Whether the system would know where to send to a "udpm://ADDRESS:…" URL; asked before LCM, which would answer with a
/// page of advice.
bool HasRoute(const std::string& url) {
  const std::string scheme = "udpm://";
  if (!url.starts_with(scheme)) return true;
  sockaddr_in to{};
  to.sin_family = AF_INET;
  to.sin_port = htons(7667);
  const std::string host = url.substr(scheme.size(), url.find_first_of(":?", scheme.size()) - scheme.size());
  if (inet_pton(AF_INET, host.c_str(), &to.sin_addr) != 1) return true;  // LCM says what is wrong with it
  const int probe = ::socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0);
  const bool has_route = ::connect(probe, reinterpret_cast<const sockaddr*>(&to), sizeof to) == 0;
  ::close(probe);
  return has_route;
}

lcm_t* Open(const std::string& url) {
  if (!HasRoute(url)) {
    throw InvalidInput(
        "this machine has no route for multicast, which LCM needs for {}; without a network, give it one over "
        "loopback: "
        "ip route add 224.0.0.0/4 dev lo",
        url);
  }
  lcm_t* lcm = lcm_create(url.c_str());
  if (lcm == nullptr)
    throw InvalidInput("LCM cannot open {}: the URL is malformed, or multicast is not possible here", url);
  return lcm;
}

}  // namespace

LcmAddress LcmAddress::For(const std::string& unique_name) {
  constexpr unsigned kFirstPort = 10000, kPorts = 20000;  // below those the system hands out by itself
  const std::string digest = Sha256Hex(unique_name);
  const unsigned port = kFirstPort + static_cast<unsigned>(std::stoul(digest.substr(0, 7), nullptr, 16)) % kPorts;
  return {fmt::format("udpm://239.255.76.67:{}?ttl=0&recv_buf_size=4194304", port), digest.substr(8, 16)};
}

LcmAddress LcmAddress::FromEnvironment() {
  LcmAddress address;
  if (const char* url = std::getenv("EVAC_LCM_URL")) address.url = url;
  if (const char* token = std::getenv("EVAC_TOKEN")) address.token = token;
  return address;
}

std::string LcmAddress::Channel(const std::string& message) const {
  CheckToken(token);
  return fmt::format("EVAC_{}_{}", token, message);
}

struct LcmLink::Subscription {
  LcmLink* link;
  Handler handler;

  /// LCM's callback: C must not see an exception, so it waits in the link until LCM has returned.
  static void Receive(const lcm_recv_buf_t* received, const char* channel, void* self) noexcept {
    const Subscription& subscription = *static_cast<Subscription*>(self);
    if (subscription.link->thrown_) return;
    try {
      subscription.handler(channel, {static_cast<const std::uint8_t*>(received->data), received->data_size});
    } catch (...) {
      subscription.link->thrown_ = std::current_exception();
    }
  }
};

LcmLink::LcmLink(const std::string& url, const Pacing& pacing)
    : lcm_(Open(url)), pacing_(pacing), drained_until_(Clock::now()) {}

LcmLink::~LcmLink() { lcm_destroy(lcm_); }

void LcmLink::Subscribe(const std::string& channels, Handler handler) {
  subscriptions_.push_back(std::make_unique<Subscription>(Subscription{this, std::move(handler)}));
  lcm_subscription_t* subscribed =
      lcm_subscribe(lcm_, channels.c_str(), &Subscription::Receive, subscriptions_.back().get());
  if (subscribed == nullptr) throw InternalError("LCM refuses to listen to {}", channels);
  lcm_subscription_set_queue_capacity(subscribed, kQueuedMessages);
}

void LcmLink::Handle(double timeout_s) {
  while (HandleOne(timeout_s)) timeout_s = 0;
}

bool LcmLink::HandleOne(double timeout_s) {
  const int timeout_ms = std::max(0, static_cast<int>(timeout_s * 1000 + 0.999));
  if (lcm_handle_timeout(lcm_, timeout_ms) <= 0) return false;
  if (thrown_) std::rethrow_exception(std::exchange(thrown_, nullptr));
  return true;
}

void LcmLink::PublishBytes(const std::string& channel, std::span<const std::uint8_t> bytes) {
  WaitForTurn(bytes.size());
  if (lcm_publish(lcm_, channel.c_str(), bytes.data(), static_cast<unsigned>(bytes.size())) != 0) {
    throw InternalError("LCM cannot send {} bytes on {}", bytes.size(), channel);
  }
}

/// A leaky bucket: waits until what was sent before has drained so far that the new bytes fit into the burst.
void LcmLink::WaitForTurn(std::size_t bytes) {
  const auto drain = [this] {
    const Clock::time_point now = Clock::now();
    const double passed_s = std::chrono::duration<double>(now - drained_until_).count();
    backlog_bytes_ = std::max(0.0, backlog_bytes_ - passed_s * pacing_.bytes_per_s);
    drained_until_ = now;
  };
  drain();
  const double excess_bytes =
      std::min(backlog_bytes_, backlog_bytes_ + static_cast<double>(bytes) - pacing_.burst_bytes);
  if (excess_bytes > 0) {
    std::this_thread::sleep_for(std::chrono::duration<double>(excess_bytes / pacing_.bytes_per_s));
    drain();
  }
  backlog_bytes_ += static_cast<double>(bytes);
}

std::optional<std::string> WhatIsWrongWithLcm(const std::string& url) try {
  LcmLink link(url);
  bool came_back = false;
  const std::string channel = fmt::format("EVAC_doctor_{}_{}", getpid(), std::random_device()());
  link.Subscribe(channel, [&](const std::string&, std::span<const std::uint8_t>) { came_back = true; });
  for (int attempt = 0; attempt < 10 && !came_back; ++attempt) {
    link.PublishBytes(channel, std::vector<std::uint8_t>(8));
    link.Handle(0.1);
  }
  if (came_back) return std::nullopt;
  return fmt::format(
      "a message to {} does not come back: a firewall drops it, or loopback has no multicast route "
      "(ip route add 224.0.0.0/4 dev lo)",
      url);
} catch (const Error& error) {
  return error.what();
}

}  // namespace evac
