#pragma once

#include <cstddef>
#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "judges/rating_words.h"

namespace evac {

/// A request as it came: bytes from outside, within the limits below.
struct HttpAsked {
  std::string method, path, query;  ///< path with its leading '/', not decoded
  std::string host, origin, cookie, range, content_type, csrf, user_agent, fetch_site;
  std::string body;
  std::string peer;  ///< address of the other end
};

struct HttpAnswer {
  int status = 200;
  std::string content_type = "application/json";
  std::string body = {};
  std::vector<std::pair<std::string, std::string>> headers = {};
  std::optional<std::filesystem::path> file = {};  ///< sent instead of `body`
  std::optional<ByteRange> part = {};              ///< of the file; nothing: all of it
};

/// How much a client may ask for, and how long it may take.
struct HttpServerLimits {
  std::size_t header_bytes = 8192, body_bytes = 65536;
  int idle_s = 75;     ///< a connection that asks nothing
  int request_s = 10;  ///< from a request's first byte to its last
  int answer_s = 60;   ///< in which nothing of an answer is taken
  std::size_t connections = 1000;
  int threads = 2;
};

/// An HTTP/1.1 server, by Boost.Beast, which nothing else here knows. A connection costs a socket, not a thread: a
/// thousand that do nothing hinder nobody. What is malformed, too large, chunked or has two lengths is answered 4xx and
/// closed; what is too slow is closed without an answer, or in the middle of one.
class RatingHttp {
 public:
  using Reply = std::function<void(HttpAnswer)>;
  /// Called by several threads; `reply` may be called later, by any thread, once.
  using Handler = std::function<void(HttpAsked, Reply)>;

  /// Listens from here on. @param port  0: any that is free. @throws InvalidInput if the address cannot be had.
  RatingHttp(const std::string& host, int port, const HttpServerLimits& limits, Handler handler);
  ~RatingHttp();
  int port() const;
  /// Answers until Stop, which any thread may call; with fewer threads where no more can be had.
  void Serve();
  void Stop();

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace evac
