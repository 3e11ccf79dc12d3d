#include "judges/rating_server.h"

#include <fmt/format.h>

#include <cctype>
#include <chrono>
#include <mutex>
#include <regex>
#include <set>

#include "core/error.h"
#include "core/hash.h"
#include "core/secret.h"
#include "core/store_lock.h"
#include "judges/rating_assets.h"
#include "judges/rating_board.h"
#include "judges/rating_limits.h"
#include "judges/rating_worker.h"

namespace evac {
namespace {

using Json = nlohmann::ordered_json;

constexpr std::size_t kBoardRows = 200;  // a page; a large study has tens of thousands
/// With the study's id behind it: browsers send a host's cookies to all its ports, and studies share hosts.
constexpr const char* kCookie = "evac_rating_";
constexpr const char* kOldCookie = "evac_rating";  // of sessions that began before; sent by who has one yet
constexpr const char* kPolicy =
    "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' data: blob:; media-src 'self' blob:; "
    "connect-src 'self'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'";

std::int64_t Now_ms() {
  return std::chrono::duration_cast<std::chrono::milliseconds>(std::chrono::system_clock::now().time_since_epoch())
      .count();
}

bool IsLoopback(const std::string& host) { return host == "localhost" || host == "::1" || host.starts_with("127."); }

/// "127.0.0.1:8766" → "127.0.0.1", "[::1]:80" → "::1".
std::string HostName(const std::string& header) {
  if (header.starts_with('[')) {
    const std::size_t end = header.find(']');
    const bool is_whole = end != std::string::npos && (end + 1 == header.size() || header[end + 1] == ':');
    return is_whole ? header.substr(1, end - 1) : "";
  }
  return header.substr(0, header.find(':'));
}

HttpAnswer Said(const DeskAnswer& answer) {
  return {answer.status, "application/json", answer.body.dump(-1, ' ', false, Json::error_handler_t::replace)};
}

HttpAnswer Refused(int status, const char* error, const std::string& message) {
  return Said({status, {{"error", error}, {"message", message}}});
}

/// @throws InvalidInput if the study is damaged: before raters are let in
std::string IdOfWhole(const std::filesystem::path& folder) {
  const StudyStore study = StudyStore::Open(folder, StudyStore::Mode::kReadWrite);
  study.RequireWhole();
  study.Rubrics();
  study.Clips();
  return study.Id();
}

HttpAnswer Page(const std::string& type, std::string text) { return {200, type, std::move(text)}; }

}  // namespace

std::string PublicUrl(const std::string& given) {
  static const std::regex kForm("(https?)://([a-z0-9._-]+|\\[[0-9a-f:.]+\\])(:([0-9]{1,5}))?/?");
  constexpr std::size_t kLongest = 300;  // of a name 253
  std::string url = given.substr(0, kLongest + 1);
  for (char& c : url) c = static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
  std::smatch parts;
  const bool is_url = url.size() <= kLongest && std::regex_match(url, parts, kForm);
  const int own_port = is_url && parts[1] == "https" ? 443 : 80;
  const int port = is_url && parts[4].matched ? std::stoi(parts[4]) : own_port;
  if (!is_url || port < 1 || port > 65535)
    throw InvalidInput("--url: found '{}', wanted http://HOST or https://HOST, or one with :PORT, and no path", given);
  return parts[1].str() + "://" + parts[2].str() + (port == own_port ? "" : fmt::format(":{}", port));
}

std::string CsrfOf(const std::string& session) { return Sha256Hex("csrf " + session).substr(0, 32); }

struct RatingServer::Impl {
  explicit Impl(RatingServerOptions given)
      : options(std::move(given)),
        lock(options.study / "lock"),
        study_id(IdOfWhole(options.study)),
        writer(StudyStore::Open(options.study, StudyStore::Mode::kReadWrite), true),
        player(StudyStore::Open(options.study, StudyStore::Mode::kReadOnly), false),
        reader(StudyStore::Open(options.study, StudyStore::Mode::kReadOnly), false),
        http(options.host, options.port, options.limits,
             [this](HttpAsked asked, RatingHttp::Reply reply) { Answer(std::move(asked), std::move(reply)); }) {}

  // ---- every request

  void Answer(HttpAsked asked, RatingHttp::Reply reply) {
    const auto guarded = [this, reply = std::move(reply)](HttpAnswer answer) {
      AddHeaders(answer);
      reply(std::move(answer));
    };
    if (const auto refusal = WhyRefused(asked)) return guarded(*refusal);
    if (const auto page = StaticPage(asked)) return guarded(*page);
    if (asked.path == "/api/board")
      return reader.Push([this, asked](StudyStore& store) { return Board(asked, store); }, guarded);
    if (asked.path.starts_with("/clip/") && asked.method != "POST")
      return player.Push([this, asked](StudyStore& store) { return Routed(asked, store); }, guarded);
    writer.Push([this, asked](StudyStore& store) { return Routed(asked, store); }, guarded);
  }

  void AddHeaders(HttpAnswer& answer) const {
    for (const auto& header :
         std::initializer_list<std::pair<const char*, const char*>>{{"Content-Security-Policy", kPolicy},
                                                                    {"X-Content-Type-Options", "nosniff"},
                                                                    {"X-Frame-Options", "DENY"},
                                                                    {"Referrer-Policy", "no-referrer"},
                                                                    {"Cross-Origin-Resource-Policy", "same-origin"},
                                                                    {"Cross-Origin-Opener-Policy", "same-origin"},
                                                                    {"Cache-Control", "no-store"}})
      answer.headers.emplace_back(header.first, header.second);
  }

  /// Other sites, other names for this machine, and methods that nobody needs.
  std::optional<HttpAnswer> WhyRefused(const HttpAsked& asked) const {
    if (asked.method != "GET" && asked.method != "HEAD" && asked.method != "POST")
      return Refused(405, "method", "GET, HEAD and POST alone");
    const bool is_named = !options.public_url.empty() && asked.host == PublicHost();
    if (IsLoopback(options.host) && !is_named && !IsThisMachine(HostName(asked.host)))
      return Refused(403, "host", "another site's name points here");
    if (asked.method != "POST") return std::nullopt;
    if (!asked.origin.empty() && !IsOurs(asked.origin, asked.host))
      return Refused(403, "origin", "the request comes from another site");
    if (!asked.fetch_site.empty() && asked.fetch_site != "same-origin")
      return Refused(403, "origin", "the request comes from another site");
    if (!asked.content_type.starts_with("application/json"))
      return Refused(415, "type", "Content-Type: wanted application/json");
    return std::nullopt;
  }

  /// Exactly: "127.0.0.1.evil.example" is somebody else's.
  bool IsThisMachine(const std::string& name) const {
    return name == "localhost" || name == "127.0.0.1" || name == "::1" || name == options.host;
  }

  /// A proxy as it comes gives its own name for this server as the host: then --url alone says what browsers see.
  bool IsOurs(const std::string& origin, const std::string& host) const {
    return origin == "http://" + host || origin == "https://" + host ||
           (!options.public_url.empty() && origin == options.public_url);
  }

  std::string PublicHost() const {
    return options.public_url.substr(options.public_url.find("//") + 2);
  }

  static std::optional<HttpAnswer> StaticPage(const HttpAsked& asked) {
    if (asked.method == "POST") return std::nullopt;
    const bool is_link = asked.path.starts_with("/r/") && IsSecret(std::string_view(asked.path).substr(3));
    if (asked.path == "/" || is_link) return Page("text/html; charset=utf-8", RatingHtml());
    if (asked.path == "/rating.js") return Page("text/javascript; charset=utf-8", RatingJs());
    if (asked.path == "/rating.css") return Page("text/css; charset=utf-8", RatingCss());
    if (asked.path == "/favicon.svg") return Page("image/svg+xml", RatingIcon());
    if (!asked.path.starts_with("/api/") && !asked.path.starts_with("/clip/")) return Refused(404, "path", "not there");
    return std::nullopt;
  }

  // ---- who asks

  struct Caller {
    std::string session;
    std::optional<StudyRater> rater;
  };

  Caller CallerOf(const HttpAsked& asked, const StudyStore& store) const {
    Caller caller;
    for (const std::string& name : {kCookie + study_id, std::string(kOldCookie)}) {
      caller.session = std::string(CookieOf(asked.cookie, name));
      if (IsSecret(caller.session)) caller.rater = store.RaterOfSession(caller.session);
      if (caller.rater) break;
    }
    return caller;
  }

  /// Nothing if the caller may go on. Whoever guesses is slowed down by address, raters by their session.
  std::optional<HttpAnswer> WhyNot(const HttpAsked& asked, const Caller& caller, std::int64_t now_ms) {
    const std::lock_guard guard(limits_mutex);
    if (!caller.rater) {
      if (!strangers.Allow(asked.peer, now_ms)) return Refused(429, "slow", "too many requests without an invitation");
      return Refused(401, "session", "this page needs an invitation link");
    }
    if (!raters.Allow(caller.session, now_ms)) return Refused(429, "slow", "too many requests");
    if (caller.rater->status != "active") return Refused(403, "withdrawn", "this rater has left the study");
    if (asked.method == "POST" && !SameSecret(asked.csrf, CsrfOf(caller.session)))
      return Refused(403, "csrf", "X-Evac-Csrf: wanted this session's token");
    return std::nullopt;
  }

  // ---- what is asked for

  HttpAnswer Routed(const HttpAsked& asked, StudyStore& store) {
    const std::int64_t now_ms = Now_ms();
    RatingDesk desk(store, options.desk);
    if (asked.path == "/api/join" && asked.method == "POST") return Join(asked, desk, now_ms);
    const Caller caller = CallerOf(asked, store);
    if (const auto refusal = WhyNot(asked, caller, now_ms)) return *refusal;
    if (asked.method == "POST") return Changed(asked, desk, *caller.rater, now_ms);
    if (asked.path.starts_with("/clip/")) return Clip(asked, desk, *caller.rater);
    if (asked.path == "/api/me") {
      DeskAnswer answer = desk.Me(*caller.rater, now_ms);
      answer.body["csrf"] = CsrfOf(caller.session);
      answer.body["study_id"] = study_id;
      return Said(answer);
    }
    if (asked.path == "/api/examples") return Said(desk.Examples(*caller.rater));
    if (asked.path == "/api/history") return Said(desk.History(*caller.rater));
    if (asked.path == "/api/guesses") return Said(desk.ToGuess(*caller.rater));
    if (asked.path == "/api/mine") return Said(desk.Mine(*caller.rater));
    return Refused(404, "path", "not there");
  }

  template <typename Body, typename Do>
  static HttpAnswer With(const Parsed<Body>& parsed, const Do& act) {
    if (!parsed.value) return Refused(422, "body", parsed.problem);
    return Said(act(*parsed.value));
  }

  HttpAnswer Changed(const HttpAsked& asked, RatingDesk& desk, const StudyRater& rater, std::int64_t now_ms) const {
    const std::string& path = asked.path;
    const std::string& body = asked.body;
    if (path == "/api/tab") return Said(desk.TakeTab(rater));
    if (path == "/api/next") return With(ParseNext(body), [&](auto& b) { return desk.Next(rater, b, now_ms); });
    if (path == "/api/open") return With(ParsePresentation(body), [&](auto& b) { return desk.Open(rater, b, now_ms); });
    if (path == "/api/heartbeat")
      return With(ParsePresentation(body), [&](auto& b) { return desk.Heartbeat(rater, b, now_ms); });
    if (path == "/api/verdict") {
      return With(ParseVerdict(body), [&](HumanVerdict verdict) {
        verdict.ua_hash = Sha256Hex(asked.user_agent);
        return desk.Submit(rater, std::move(verdict), now_ms);
      });
    }
    if (path == "/api/retract")
      return With(ParseRetract(body), [&](auto& b) { return desk.Retract(rater, b, now_ms); });
    if (path == "/api/unplayable")
      return With(ParsePresentation(body), [&](auto& b) { return desk.Unplayable(rater, b, now_ms); });
    if (path == "/api/guess") return With(ParseGuess(body), [&](auto& b) { return desk.Guess(rater, b, now_ms); });
    if (path == "/api/withdraw")
      return With(ParseWithdraw(body), [&](auto& b) { return desk.Withdraw(rater, b, now_ms); });
    return Refused(404, "path", "not there");
  }

  HttpAnswer Join(const HttpAsked& asked, RatingDesk& desk, std::int64_t now_ms) {
    {
      const std::lock_guard guard(limits_mutex);
      if (!strangers.Allow(asked.peer, now_ms)) return Refused(429, "slow", "too many requests without an invitation");
    }
    const Parsed<JoinBody> body = ParseJoin(asked.body);
    if (!body.value) return Refused(422, "body", body.problem);
    const DeskAnswer answer = desk.Join(*body.value, now_ms);
    HttpAnswer said = Said(answer);
    if (!answer.session.empty()) {
      const bool is_secure = options.public_url.starts_with("https://");
      said.headers.emplace_back("Set-Cookie",
                                fmt::format("{}{}={}; Path=/; HttpOnly; SameSite=Lax; Max-Age=7776000{}", kCookie,
                                            study_id, answer.session, is_secure ? "; Secure" : ""));
    }
    return said;
  }

  /// A clip, or a part of it, under the name this rater has for it.
  static HttpAnswer Clip(const HttpAsked& asked, const RatingDesk& desk, const StudyRater& rater) {
    const auto file = desk.ClipFile(rater, asked.path.substr(6));
    std::error_code error;
    const auto size = file ? std::filesystem::file_size(*file, error) : 0;
    if (!file || error) return Refused(404, "clip", "there is no such clip");
    HttpAnswer answer{200, "video/mp4", "", {{"Accept-Ranges", "bytes"}}, file, std::nullopt};
    if (asked.method != "GET" || !IsOneRange(asked.range)) return answer;
    answer.part = ParseRange(asked.range, size);
    if (!answer.part) {
      answer = Refused(416, "range", "Range: wanted bytes inside the file");
      answer.headers.emplace_back("Content-Range", fmt::format("bytes */{}", size));
      return answer;
    }
    answer.status = 206;
    answer.headers.emplace_back("Content-Range", fmt::format("bytes {}-{}/{}", answer.part->first,
                                                             answer.part->first + answer.part->count - 1, size));
    return answer;
  }

  HttpAnswer Board(const HttpAsked& asked, StudyStore& store) {
    const Caller caller = CallerOf(asked, store);
    if (const auto refusal = WhyNot(asked, caller, Now_ms())) return *refusal;
    if (caller.rater->role != RaterRole::kLead) return Refused(403, "role", "the board is the lead's");
    const auto from = ParseFrom(asked.query);
    if (!from) return Refused(422, "query", "found '" + asked.query + "', wanted from=NUMBER");
    return Said({200, RatingBoard(store, tally, Now_ms(), {.from = *from, .count = kBoardRows})});
  }

  RatingServerOptions options;
  RunLock lock;
  const std::string study_id;
  std::mutex limits_mutex;
  RateLimiter strangers{{.burst = 30, .per_s = 0.5}}, raters{{.burst = 120, .per_s = 30}};
  RatingTally tally;  // the reader's thread's
  // Who looks at clips or at the board waits for nobody's verdict to be written, and nobody's verdict for them.
  RatingWorker writer, player, reader;
  RatingHttp http;
};

RatingServer::RatingServer(RatingServerOptions options) {
  if (!std::filesystem::exists(options.study / "study.sqlite"))
    throw InvalidInput("{}: there is no study (study.sqlite is missing)", options.study.string());
  if (!options.public_url.empty()) options.public_url = PublicUrl(options.public_url);
  impl_ = std::make_unique<Impl>(std::move(options));
}

RatingServer::~RatingServer() { Stop(); }

int RatingServer::port() const { return impl_->http.port(); }

std::string RatingServer::url() const {
  if (!impl_->options.public_url.empty()) return impl_->options.public_url + "/";
  const std::string& host = impl_->options.host;
  return fmt::format("http://{}:{}/", host.find(':') == std::string::npos ? host : "[" + host + "]", port());
}

void RatingServer::Serve() { impl_->http.Serve(); }

void RatingServer::Stop() {
  impl_->http.Stop();
  impl_->writer.Stop();
  impl_->player.Stop();
  impl_->reader.Stop();
}

}  // namespace evac
