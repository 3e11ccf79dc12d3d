#pragma once

#include <arpa/inet.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <sys/time.h>
#include <unistd.h>

#include <cstdlib>
#include <string>

namespace evac {

/// What came back from a server.
struct RawAnswer {
  int status = 0;  ///< 0: nothing, or nothing whole
  std::string head, body;
};

/// "NAME=VALUE" of the cookie that an answer with this head sets, or "".
inline std::string CookieSetBy(const std::string& head) {
  const std::string header = "Set-Cookie: ";
  const std::size_t at = head.find(header);
  if (at == std::string::npos) return "";
  return head.substr(at + header.size(), head.find(';', at) - at - header.size());
}

/// A TCP connection to this machine, or -1. Where nobody listens, a connection may be given that very port and meet
/// itself: that is none, and in the way of a server that is started there again.
inline int ConnectTo(int port) {
  const int socket = ::socket(AF_INET, SOCK_STREAM, 0);
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_port = htons(static_cast<std::uint16_t>(port));
  inet_pton(AF_INET, "127.0.0.1", &address.sin_addr);
  sockaddr_in own{};
  socklen_t size = sizeof own;
  if (::connect(socket, reinterpret_cast<sockaddr*>(&address), sizeof address) == 0 &&
      ::getsockname(socket, reinterpret_cast<sockaddr*>(&own), &size) == 0 && own.sin_port != address.sin_port)
    return socket;
  close(socket);
  return -1;
}

/// Sends exactly these bytes and reads until the other end closes.
inline RawAnswer RawExchange(int port, const std::string& bytes) {
  const int socket = ConnectTo(port);
  if (socket < 0) return {};
  ::send(socket, bytes.data(), bytes.size(), MSG_NOSIGNAL);
  std::string heard;
  char piece[65536];
  for (ssize_t count; (count = ::recv(socket, piece, sizeof piece, 0)) > 0;)
    heard.append(piece, static_cast<std::size_t>(count));
  close(socket);
  RawAnswer answer;
  const std::size_t end = heard.find("\r\n\r\n");
  if (end == std::string::npos) return answer;
  answer.head = heard.substr(0, end);
  answer.body = heard.substr(end + 4);
  if (answer.head.size() > 12) answer.status = std::atoi(answer.head.c_str() + 9);
  return answer;
}

/// POST of JSON on a connection of its own. @param headers  whole lines, each with its \r\n
inline RawAnswer PostJson(int port, const std::string& path, const std::string& body, const std::string& headers) {
  return RawExchange(port, "POST " + path +
                               " HTTP/1.1\r\nHost: 127.0.0.1\r\nConnection: close\r\nContent-Type: application/json\r\n"
                               "Content-Length: " +
                               std::to_string(body.size()) + "\r\n" + headers + "\r\n" + body);
}

}  // namespace evac
