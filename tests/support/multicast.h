#pragma once

#include <arpa/inet.h>
#include <netinet/in.h>
#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

namespace evac {

/// Whether a datagram to LCM's usual group comes back to who sent it, by sockets alone: nothing of ours, and nothing of
/// LCM's, has a part in it. So what our own look at the wire says can be held against something.
inline bool MulticastComesBack() {
  const int own = ::socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0);
  sockaddr_in address{};
  address.sin_family = AF_INET;
  socklen_t size = sizeof address;
  ip_mreq group{};
  ::inet_pton(AF_INET, "239.255.76.67", &group.imr_multiaddr);
  const unsigned char ttl = 0;
  ::setsockopt(own, IPPROTO_IP, IP_MULTICAST_TTL, &ttl, sizeof ttl);
  const bool is_open = ::bind(own, reinterpret_cast<const sockaddr*>(&address), size) == 0 &&
                       ::getsockname(own, reinterpret_cast<sockaddr*>(&address), &size) == 0 &&
                       ::setsockopt(own, IPPROTO_IP, IP_ADD_MEMBERSHIP, &group, sizeof group) == 0;
  address.sin_addr = group.imr_multiaddr;
  bool came_back = false;
  for (int attempt = 0; is_open && attempt < 5 && !came_back; ++attempt) {
    const char word = 'x';
    if (::sendto(own, &word, 1, 0, reinterpret_cast<const sockaddr*>(&address), size) != 1) break;  // no route
    pollfd heard{own, POLLIN, 0};
    came_back = ::poll(&heard, 1, 1000) == 1;
  }
  ::close(own);
  return came_back;
}

}  // namespace evac
