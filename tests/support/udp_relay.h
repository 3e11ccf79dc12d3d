#pragma once

#include <cstdint>
#include <memory>
#include <string>

namespace evac {

struct RelayOptions {
  int port_a = 0, port_b = 0;  ///< of LCM's usual group, 239.255.76.67: two LCM networks that only the relay joins
  double loss = 0;             ///< share of datagrams that are lost …
  double duplication = 0;      ///< … doubled …
  double longest_delay_s = 0;  ///< … and all are delayed by up to this, each by its own: they overtake each other
  std::uint64_t seed = 1;
};

/// A bad network of a test's own: hands datagrams from one port to the other and back, as badly as it is told.
class UdpRelay {
 public:
  struct Counts {
    int passed = 0, lost = 0, doubled = 0, overtaken = 0;
  };

  explicit UdpRelay(const RelayOptions& options);
  ~UdpRelay();

  /// Stops it first.
  Counts Stop();
  static std::string Url(int port) {
    return "udpm://239.255.76.67:" + std::to_string(port) + "?ttl=0&recv_buf_size=4194304";
  }

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace evac
