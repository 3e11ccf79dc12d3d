#include "tests/support/scripted_server.h"

#include <arpa/inet.h>
#include <fmt/format.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <cctype>
#include <mutex>
#include <sstream>
#include <thread>

namespace evac {
namespace {

/// @returns false if the client has gone.
bool ReadSome(int connection, std::string& text) {
  char bytes[65536];
  const ssize_t count = ::recv(connection, bytes, sizeof bytes, 0);
  if (count <= 0) return false;
  text.append(bytes, static_cast<std::size_t>(count));
  return true;
}

SeenRequest HeadOf(const std::string& head) {
  SeenRequest request;
  std::istringstream lines(head);
  lines >> request.method >> request.path;
  std::string line;
  std::getline(lines, line);
  while (std::getline(lines, line)) {
    const std::size_t colon = line.find(':');
    if (colon == std::string::npos) continue;
    std::string name = line.substr(0, colon);
    std::transform(name.begin(), name.end(), name.begin(), [](unsigned char c) { return std::tolower(c); });
    const std::size_t begin = line.find_first_not_of(' ', colon + 1), end = line.find_last_not_of("\r ");
    request.headers[name] = begin == std::string::npos ? "" : line.substr(begin, end + 1 - begin);
  }
  return request;
}

bool ReadRequest(int connection, SeenRequest& request) {
  std::string text;
  while (text.find("\r\n\r\n") == std::string::npos) {
    if (!ReadSome(connection, text)) return false;
  }
  const std::size_t end = text.find("\r\n\r\n");
  request = HeadOf(text.substr(0, end + 2));
  request.body = text.substr(end + 4);
  const auto length = request.headers.find("content-length");
  const std::size_t wanted = length == request.headers.end() ? 0 : std::stoul(length->second);
  while (request.body.size() < wanted) {
    if (!ReadSome(connection, request.body)) return false;
  }
  return true;
}

}  // namespace

struct ScriptedServer::Impl {
  Script script;
  int listener = -1;
  int port = 0;
  std::atomic<bool> is_over = false;
  mutable std::mutex mutex;
  std::vector<SeenRequest> seen;
  std::vector<std::thread> connections;
  std::thread acceptor;

  void Serve(int connection) {
    SeenRequest request;
    if (ReadRequest(connection, request)) {
      {
        const std::lock_guard lock(mutex);
        seen.push_back(request);
      }
      Send(connection, script(request));
    }
    ::close(connection);
  }

  void Send(int connection, const ScriptedAnswer& answer) {
    for (const auto& [pause_s, bytes] : answer.pieces) {
      for (double waited_s = 0; waited_s < pause_s && !is_over; waited_s += 0.02)
        std::this_thread::sleep_for(std::chrono::milliseconds(20));
      if (is_over || ::send(connection, bytes.data(), bytes.size(), MSG_NOSIGNAL) < 0) return;
    }
    if (!answer.resets) return;
    const linger hard{.l_onoff = 1, .l_linger = 0};
    ::setsockopt(connection, SOL_SOCKET, SO_LINGER, &hard, sizeof hard);
  }

  void Accept() {
    for (;;) {
      const int connection = ::accept4(listener, nullptr, nullptr, SOCK_CLOEXEC);
      if (connection < 0 || is_over) {
        if (connection >= 0) ::close(connection);
        return;
      }
      const std::lock_guard lock(mutex);
      connections.emplace_back([this, connection] { Serve(connection); });
    }
  }
};

ScriptedAnswer Answer(int status, const std::string& body, const std::string& headers) {
  return {{{0, fmt::format("HTTP/1.1 {} -\r\nContent-Length: {}\r\nConnection: close\r\n{}\r\n{}", status, body.size(),
                           headers, body)}}};
}

ScriptedServer::ScriptedServer(Script script) : impl_(std::make_unique<Impl>()) {
  impl_->script = std::move(script);
  impl_->listener = ::socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  socklen_t size = sizeof address;
  if (::bind(impl_->listener, reinterpret_cast<sockaddr*>(&address), size) != 0 || ::listen(impl_->listener, 64) != 0)
    throw std::runtime_error("no port on loopback");
  ::getsockname(impl_->listener, reinterpret_cast<sockaddr*>(&address), &size);
  impl_->port = ntohs(address.sin_port);
  impl_->acceptor = std::thread([this] { impl_->Accept(); });
}

ScriptedServer::~ScriptedServer() {
  impl_->is_over = true;
  ::shutdown(impl_->listener, SHUT_RDWR);
  impl_->acceptor.join();
  ::close(impl_->listener);
  for (std::thread& connection : impl_->connections) connection.join();
}

std::string ScriptedServer::Url() const { return fmt::format("http://127.0.0.1:{}", impl_->port); }

std::vector<SeenRequest> ScriptedServer::Seen() const {
  const std::lock_guard lock(impl_->mutex);
  return impl_->seen;
}

}  // namespace evac
