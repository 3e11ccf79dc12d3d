#pragma once

#include <filesystem>
#include <memory>
#include <string>

#include "judges/rating_desk.h"
#include "judges/rating_http.h"

namespace evac {

struct RatingServerOptions {
  std::filesystem::path study = {};
  std::string host = "127.0.0.1";  ///< address to listen at; any but a loopback one is open to the network
  int port = 0;                    ///< 0: any that is free
  std::string public_url = {};     ///< "https://rate.lab.org" of the reverse proxy in front of it; empty: none
  DeskOptions desk = {};
  HttpServerLimits limits = {};
};

/// A study's rating session over HTTP: pages, clips and verdicts for whoever came in by an invitation, and nobody else.
/// Sessions are HttpOnly, SameSite cookies with the study's id in their name; whatever changes something needs the
/// session's token in a header and comes from this site; clips are given out under a name of each rater's own. No TLS:
/// a reverse proxy does that (docs/rating_session.md).
class RatingServer {
 public:
  /// Listens from here on. @throws InvalidInput if there is no study, it is damaged,
  /// another server has it, the address is taken, or the public one is none (PublicUrl).
  explicit RatingServer(RatingServerOptions options);
  ~RatingServer();
  RatingServer(const RatingServer&) = delete;
  RatingServer& operator=(const RatingServer&) = delete;

  int port() const;
  /// What links begin with: "http://127.0.0.1:41234/" or the public one.
  std::string url() const;
  /// Answers until Stop, which any thread may call.
  void Serve();
  void Stop();

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

/// What a study's address is in the open, as browsers name it: "HTTPS://Rate.Lab.org:443/" is "https://rate.lab.org".
/// @throws InvalidInput unless it is http(s)://HOST or http(s)://HOST:PORT: pages and links stand at the root.
std::string PublicUrl(const std::string& given);

/// The token that requests of a session must carry in X-Evac-Csrf.
std::string CsrfOf(const std::string& session);

}  // namespace evac
