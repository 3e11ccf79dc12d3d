#pragma once

#include <cstddef>
#include <optional>
#include <string>

namespace evac {

/// How long a server may take and how much it may say (docs/vlm_judge.md).
struct HttpLimits {
  double connect_s = 5;
  double first_byte_s = 60;  ///< from the connection to the first byte of the answer
  double idle_s = 30;        ///< between two pieces of the answer
  double total_s = 180;
  std::size_t max_reply_bytes = 4u << 20;
};

struct HttpRequest {
  std::string url;         ///< http:// or https://; certificates are checked against the system's authorities
  std::string body;        ///< JSON to be posted; empty: GET
  std::string bearer_key;  ///< sent as Authorization, never part of a message; empty: none
};

/// What came back, or why nothing whole did.
struct HttpReply {
  enum class Trouble { kNone, kTimeout, kNetwork, kTooLarge };

  Trouble trouble = Trouble::kNone;
  std::string message;  ///< of the trouble: "no byte within 60 s"
  int status = 0;       ///< 200, 429, …; 0 where there was trouble before it
  std::optional<double>
      retry_after_s;  ///< the header Retry-After, seconds or a date, from now: as it says, perhaps negative
  std::string body;
};

/// One request and its answer, by libcurl, which nothing else here knows. Follows no redirects; a server on this
/// machine is never asked through a proxy.
/// @throws InvalidInput for a URL that is none.
HttpReply Exchange(const HttpRequest& request, const HttpLimits& limits = {});

}  // namespace evac
