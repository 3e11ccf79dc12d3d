#include "tests/support/udp_relay.h"

#include <arpa/inet.h>
#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <chrono>
#include <map>
#include <stdexcept>
#include <thread>
#include <vector>

#include "core/seed.h"

namespace evac {
namespace {

using Clock = std::chrono::steady_clock;

constexpr const char* kGroup = "239.255.76.67";

sockaddr_in Address(const char* host, int port) {
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_port = htons(static_cast<std::uint16_t>(port));
  ::inet_pton(AF_INET, host, &address.sin_addr);
  return address;
}

/// One port's ear and mouth. What the mouth says comes back to the ear: it is known by its source port.
class Side {
 public:
  explicit Side(int port)
      : ear_(::socket(AF_INET, SOCK_DGRAM, 0)), mouth_(::socket(AF_INET, SOCK_DGRAM, 0)), to_(Address(kGroup, port)) {
    const int yes = 1, buffer_bytes = 4 << 20;
    ::setsockopt(ear_, SOL_SOCKET, SO_REUSEADDR, &yes, sizeof yes);
    ::setsockopt(ear_, SOL_SOCKET, SO_RCVBUF, &buffer_bytes, sizeof buffer_bytes);
    const sockaddr_in any = Address("0.0.0.0", port);
    ip_mreq group{};
    ::inet_pton(AF_INET, kGroup, &group.imr_multiaddr);
    const unsigned char ttl = 0;
    ::setsockopt(mouth_, IPPROTO_IP, IP_MULTICAST_TTL, &ttl, sizeof ttl);
    const bool is_open = ::bind(ear_, reinterpret_cast<const sockaddr*>(&any), sizeof any) == 0 &&
                         ::setsockopt(ear_, IPPROTO_IP, IP_ADD_MEMBERSHIP, &group, sizeof group) == 0 &&
                         ::connect(mouth_, reinterpret_cast<const sockaddr*>(&to_), sizeof to_) == 0;
    if (!is_open) throw std::runtime_error("the relay cannot listen to multicast");
    sockaddr_in own{};
    socklen_t size = sizeof own;
    ::getsockname(mouth_, reinterpret_cast<sockaddr*>(&own), &size);
    own_port_ = own.sin_port;
  }
  ~Side() {
    ::close(ear_);
    ::close(mouth_);
  }
  Side(const Side&) = delete;
  Side& operator=(const Side&) = delete;

  int ear() const { return ear_; }
  void Say(const std::vector<std::uint8_t>& datagram) { (void)!::send(mouth_, datagram.data(), datagram.size(), 0); }
  /// Empty: nothing more, or its own.
  std::vector<std::uint8_t> Hear() {
    std::vector<std::uint8_t> datagram(65536);
    sockaddr_in from{};
    socklen_t size = sizeof from;
    const ssize_t bytes =
        ::recvfrom(ear_, datagram.data(), datagram.size(), MSG_DONTWAIT, reinterpret_cast<sockaddr*>(&from), &size);
    datagram.resize(bytes > 0 && from.sin_port != own_port_ ? static_cast<std::size_t>(bytes) : 0);
    return datagram;
  }

 private:
  int ear_, mouth_;
  sockaddr_in to_;
  in_port_t own_port_ = 0;
};

}  // namespace

struct UdpRelay::Impl {
  explicit Impl(const RelayOptions& given) : options(given), a(given.port_a), b(given.port_b), dice(given.seed) {
    thread = std::thread([this] { Run(); });
  }

  void Run() {
    while (!stop) {
      std::array<pollfd, 2> ears{pollfd{a.ear(), POLLIN, 0}, pollfd{b.ear(), POLLIN, 0}};
      ::poll(ears.data(), ears.size(), waiting.empty() ? 20 : 1);
      if (ears[0].revents) Take(a.Hear(), b);
      if (ears[1].revents) Take(b.Hear(), a);
      while (!waiting.empty() && waiting.begin()->first <= Clock::now()) {
        waiting.begin()->second.to->Say(waiting.begin()->second.bytes);
        waiting.erase(waiting.begin());
      }
    }
  }

  void Take(const std::vector<std::uint8_t>& datagram, Side& to) {
    if (datagram.empty()) return;
    if (dice.Uniform() < options.loss) return void(++counts.lost);
    const bool is_doubled = dice.Uniform() < options.duplication;
    counts.doubled += is_doubled;
    for (int i = 0; i < 1 + is_doubled; ++i) {
      const auto due = Clock::now() + std::chrono::duration_cast<Clock::duration>(
                                          std::chrono::duration<double>(options.longest_delay_s * dice.Uniform()));
      counts.overtaken += !waiting.empty() && due < waiting.rbegin()->first;
      ++counts.passed;
      waiting.insert({due, {&to, datagram}});
    }
  }

  struct Waiting {
    Side* to;
    std::vector<std::uint8_t> bytes;
  };
  RelayOptions options;
  Side a, b;
  SplitMix64 dice;
  std::multimap<Clock::time_point, Waiting> waiting;
  Counts counts;
  std::atomic<bool> stop = false;
  std::thread thread;
};

UdpRelay::UdpRelay(const RelayOptions& options) : impl_(std::make_unique<Impl>(options)) {}
UdpRelay::~UdpRelay() { Stop(); }

UdpRelay::Counts UdpRelay::Stop() {
  impl_->stop = true;
  if (impl_->thread.joinable()) impl_->thread.join();
  return impl_->counts;
}

}  // namespace evac
