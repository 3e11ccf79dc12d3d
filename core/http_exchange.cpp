#include "core/http_exchange.h"

#include <curl/curl.h>
#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <charconv>
#include <chrono>
#include <cmath>
#include <ctime>
#include <memory>

#include "core/error.h"

namespace evac {
namespace {

using Clock = std::chrono::steady_clock;

struct CurlFree {
  void operator()(CURL* handle) const { curl_easy_cleanup(handle); }
  void operator()(curl_slist* list) const { curl_slist_free_all(list); }
  void operator()(CURLU* url) const { curl_url_cleanup(url); }
};

/// Initialised once for the whole program, before the first thread that asks.
bool IsReady() {
  static const bool is_ready = curl_global_init(CURL_GLOBAL_DEFAULT) == CURLE_OK;
  return is_ready;
}

/// What libcurl's callbacks see of one exchange.
struct Watch {
  const HttpLimits& limits;
  HttpReply reply;
  Clock::time_point last = Clock::now();
  bool has_begun = false;

  /// @returns why the wait is over, or nothing.
  std::string TooSlow() const {
    const double silent_s = std::chrono::duration<double>(Clock::now() - last).count();
    if (!has_begun && silent_s > limits.first_byte_s) return fmt::format("no byte within {} s", limits.first_byte_s);
    if (has_begun && silent_s > limits.idle_s) return fmt::format("silent for {} s in mid-answer", limits.idle_s);
    return "";
  }

  void Heard() {
    has_begun = true;
    last = Clock::now();
  }
};

std::size_t TakeBody(char* bytes, std::size_t, std::size_t count, void* user) {
  Watch& watch = *static_cast<Watch*>(user);
  watch.Heard();
  if (watch.reply.body.size() + count > watch.limits.max_reply_bytes) {
    watch.reply.trouble = HttpReply::Trouble::kTooLarge;
    watch.reply.message = fmt::format("the answer is larger than {} bytes", watch.limits.max_reply_bytes);
    return 0;
  }
  watch.reply.body.append(bytes, count);
  return count;
}

/// "120", or "Fri, 01 Jan 2100 00:00:00 GMT". Nothing if it is neither.
std::optional<double> FromNow_s(const std::string& header) {
  double seconds = 0;
  const auto [end, error] = std::from_chars(header.data(), header.data() + header.size(), seconds);
  if (error == std::errc() && end == header.data() + header.size() && std::isfinite(seconds)) return seconds;
  const std::time_t at = curl_getdate(header.c_str(), nullptr);
  if (at < 0) return std::nullopt;
  return std::difftime(at, std::time(nullptr));
}

std::size_t TakeHeader(char* bytes, std::size_t, std::size_t count, void* user) {
  Watch& watch = *static_cast<Watch*>(user);
  watch.Heard();
  std::string line(bytes, count);
  const std::size_t colon = line.find(':');
  std::string name = line.substr(0, colon);
  std::transform(name.begin(), name.end(), name.begin(), [](unsigned char c) { return std::tolower(c); });
  if (name != "retry-after" || colon == std::string::npos) return count;
  const std::size_t begin = line.find_first_not_of(" \t", colon + 1), end = line.find_last_not_of(" \t\r\n");
  if (begin != std::string::npos && begin <= end)
    watch.reply.retry_after_s = FromNow_s(line.substr(begin, end - begin + 1));
  return count;
}

int Look(void* user, curl_off_t, curl_off_t, curl_off_t, curl_off_t) {
  Watch& watch = *static_cast<Watch*>(user);
  const std::string too_slow = watch.TooSlow();
  if (too_slow.empty()) return 0;
  watch.reply.trouble = HttpReply::Trouble::kTimeout;
  watch.reply.message = too_slow;
  return 1;
}

bool IsOnThisMachine(const std::string& url) {
  const std::unique_ptr<CURLU, CurlFree> parts(curl_url());
  char* host = nullptr;
  if (curl_url_set(parts.get(), CURLUPART_URL, url.c_str(), 0) != CURLUE_OK ||
      curl_url_get(parts.get(), CURLUPART_HOST, &host, 0) != CURLUE_OK) {
    throw InvalidInput("found '{}', wanted a URL such as http://localhost:8000/v1", url);
  }
  const std::string name = host;
  curl_free(host);
  return name == "localhost" || name == "[::1]" || name.starts_with("127.");
}

void SetLimits(CURL* handle, const HttpLimits& limits) {
  curl_easy_setopt(handle, CURLOPT_PROTOCOLS_STR, "http,https");
  curl_easy_setopt(handle, CURLOPT_NOSIGNAL, 1L);
  curl_easy_setopt(handle, CURLOPT_CONNECTTIMEOUT_MS, static_cast<long>(1e3 * limits.connect_s));
  curl_easy_setopt(handle, CURLOPT_TIMEOUT_MS, static_cast<long>(1e3 * limits.total_s));
}

void SetCallbacks(CURL* handle, Watch& watch) {
  curl_easy_setopt(handle, CURLOPT_WRITEFUNCTION, TakeBody);
  curl_easy_setopt(handle, CURLOPT_WRITEDATA, &watch);
  curl_easy_setopt(handle, CURLOPT_HEADERFUNCTION, TakeHeader);
  curl_easy_setopt(handle, CURLOPT_HEADERDATA, &watch);
  curl_easy_setopt(handle, CURLOPT_XFERINFOFUNCTION, Look);
  curl_easy_setopt(handle, CURLOPT_XFERINFODATA, &watch);
  curl_easy_setopt(handle, CURLOPT_NOPROGRESS, 0L);
}

using Headers = std::unique_ptr<curl_slist, CurlFree>;

Headers HeadersOf(const HttpRequest& request) {
  Headers headers(curl_slist_append(nullptr, "Content-Type: application/json"));
  curl_slist_append(headers.get(), "Expect:");  // no waiting for "100 Continue", which some servers never say
  if (!request.bearer_key.empty())
    curl_slist_append(headers.get(), ("Authorization: Bearer " + request.bearer_key).c_str());
  return headers;
}

void NameTrouble(CURLcode code, const char* details, HttpReply& reply) {
  if (code == CURLE_OK || reply.trouble != HttpReply::Trouble::kNone) return;
  const bool timed_out = code == CURLE_OPERATION_TIMEDOUT;
  reply.trouble = timed_out ? HttpReply::Trouble::kTimeout : HttpReply::Trouble::kNetwork;
  reply.message = *details != '\0' ? details : curl_easy_strerror(code);
}

}  // namespace

HttpReply Exchange(const HttpRequest& request, const HttpLimits& limits) {
  if (!IsReady()) throw InternalError("libcurl does not start");
  const bool is_local = IsOnThisMachine(request.url);
  const std::unique_ptr<CURL, CurlFree> handle(curl_easy_init());
  const Headers headers = HeadersOf(request);
  Watch watch{limits, {}};
  char details[CURL_ERROR_SIZE] = "";
  curl_easy_setopt(handle.get(), CURLOPT_URL, request.url.c_str());
  curl_easy_setopt(handle.get(), CURLOPT_HTTPHEADER, headers.get());
  curl_easy_setopt(handle.get(), CURLOPT_ERRORBUFFER, details);
  if (is_local) curl_easy_setopt(handle.get(), CURLOPT_PROXY, "");
  if (!request.body.empty()) {
    curl_easy_setopt(handle.get(), CURLOPT_POSTFIELDSIZE_LARGE, static_cast<curl_off_t>(request.body.size()));
    curl_easy_setopt(handle.get(), CURLOPT_POSTFIELDS, request.body.data());
  }
  SetLimits(handle.get(), limits);
  SetCallbacks(handle.get(), watch);
  NameTrouble(curl_easy_perform(handle.get()), details, watch.reply);
  long status = 0;
  curl_easy_getinfo(handle.get(), CURLINFO_RESPONSE_CODE, &status);
  watch.reply.status = static_cast<int>(status);
  return watch.reply;
}

}  // namespace evac
