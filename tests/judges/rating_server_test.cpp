#include "judges/rating_server.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <pthread.h>

#include <atomic>
#include <chrono>
#include <nlohmann/json.hpp>
#include <system_error>
#include <thread>

#include "core/error.h"
#include "judges/rating_http.h"
#include "tests/judges/rating_support.h"
#include "tests/support/raw_http.h"

namespace evac {
namespace {

using nlohmann::json;
using testing::HasSubstr;
using testing::Not;
using testing::StartsWith;

struct Heard : RawAnswer {
  json Json() const { return json::parse(body); }
};

/// A server at work over a small study, and what browsers and others say to it.
class RatingServerTest : public testing::Test {
 protected:
  RatingServerTest() : server(OptionsFor(study.folder())), thread([this] { server.Serve(); }) {}
  ~RatingServerTest() override {
    server.Stop();
    thread.join();
  }
  static RatingServerOptions OptionsFor(const std::filesystem::path& folder) {
    RatingServerOptions options;
    options.study = folder;
    options.limits.request_s = 1;
    return options;
  }

  Heard Raw(const std::string& bytes) const { return {RawExchange(server.port(), bytes)}; }
  Heard Get(const std::string& path, const std::string& headers = "") const {
    return Raw("GET " + path + " HTTP/1.1\r\nHost: 127.0.0.1\r\nConnection: close\r\n" + headers + "\r\n");
  }
  Heard Post(const std::string& path, const std::string& body, const std::string& headers) const {
    return {PostJson(server.port(), path, body, headers)};
  }

  /// Comes in by a link. @returns the headers of every later request.
  std::string Join(RaterRole role = RaterRole::kRater) {
    const std::string link = NewSecret();
    StudyStore store = study.Open();
    store.AddInvite(link, role, 1);
    const Heard heard =
        Post("/api/join", json{{"invite", link}, {"uuid", NewSecret()}, {"name", "<b>Ann</b>"}}.dump(), "");
    EXPECT_EQ(heard.status, 200) << heard.body;
    cookies.push_back(heard.head.substr(heard.head.find("Set-Cookie")));
    return With(CookieSetBy(heard.head));
  }
  /// Headers of a browser that has this cookie, and others before it.
  static std::string With(const std::string& cookie, const std::string& others = "") {
    const std::string session = cookie.substr(cookie.find('=') + 1);
    return "Cookie: " + others + cookie + "\r\nX-Evac-Csrf: " + CsrfOf(session) + "\r\n";
  }
  std::int64_t Epoch(const std::string& who) { return Post("/api/tab", "{}", who).Json().at("tab_epoch"); }
  json Next(const std::string& who, std::int64_t epoch) {
    return Post("/api/next", json{{"tab_epoch", epoch}}.dump(), who).Json();
  }
  static json Verdict(const std::string& clip, std::int64_t epoch) {
    return {{"client_uuid", NewSecret()}, {"presentation", clip}, {"tab_epoch", epoch},
            {"label", "success"},         {"coverage", 1},        {"rt_ms", 5000}};
  }

  SmallStudy study{6};
  RatingServer server;
  std::thread thread;
  std::vector<std::string> cookies;
};

TEST_F(RatingServerTest, AVerdictThatIsAnswered200IsInTheFile) {
  const std::string ann = Join();
  const std::int64_t epoch = Epoch(ann);
  const std::string clip = Next(ann, epoch).at("presentation");
  const Heard said = Post("/api/verdict", Verdict(clip, epoch).dump(), ann);
  ASSERT_EQ(said.status, 200) << said.body;
  const StudyStore beside = StudyStore::Open(study.folder(), StudyStore::Mode::kReadOnly);
  EXPECT_EQ(beside.CurrentVerdict(clip)->label, "success");
}

TEST_F(RatingServerTest, ManyAtOnceLoseNothingAndDoubleNothing) {
  constexpr int kRaters = 12, kEach = 8;
  std::vector<std::string> who;
  for (int i = 0; i < kRaters; ++i) who.push_back(Join());
  std::vector<std::thread> raters;
  std::atomic<int> stored = 0;
  for (const std::string& one : who) {
    raters.emplace_back([&, one] {
      const std::int64_t epoch = Epoch(one);
      for (int k = 0; k < kEach; ++k) {
        const json next = Next(one, epoch);
        if (next.contains("done")) break;
        const std::string body = Verdict(next.at("presentation"), epoch).dump();
        const Heard first = Post("/api/verdict", body, one), second = Post("/api/verdict", body, one);
        EXPECT_EQ(first.status, 200);
        EXPECT_EQ(first.Json().at("verdict"), second.Json().at("verdict"));
        ++stored;
      }
    });
  }
  for (std::thread& rater : raters) rater.join();
  EXPECT_EQ(static_cast<int>(study.Open().VerdictTable().rows.size()), stored.load());
  EXPECT_GE(stored, 36) << "twelve clips, three votes each";
}

TEST_F(RatingServerTest, WithoutAnInvitationThereIsAPageAndNothingElse) {
  EXPECT_EQ(Get("/").status, 200);
  EXPECT_EQ(Get("/r/" + NewSecret()).status, 200) << "the page; what the link is worth says only joining";
  EXPECT_EQ(Get("/rating.js").status, 200);
  for (const char* path : {"/api/me", "/api/mine", "/api/history", "/api/board", "/api/examples", "/api/guesses"})
    EXPECT_EQ(Get(path).status, 401) << path;
  EXPECT_EQ(Post("/api/next", "{}", "").status, 401);
  EXPECT_EQ(Post("/api/join", json{{"invite", NewSecret()}, {"uuid", NewSecret()}}.dump(), "").status, 404);
  const std::string ann = Join();
  EXPECT_THAT(cookies.back(), HasSubstr("HttpOnly; SameSite=Lax"));
  EXPECT_EQ(Get("/api/board", ann).status, 403) << "a rater sees no board";
  const std::string lead = Join(RaterRole::kLead);
  EXPECT_EQ(Get("/api/board", lead).status, 200);
  EXPECT_EQ(Get("/api/board?from=200", lead).status, 200);
  EXPECT_EQ(Get("/api/board?from=all", lead).status, 422);
  EXPECT_EQ(Post("/api/next", "{\"tab_epoch\":0}", lead).status, 403);
}

TEST_F(RatingServerTest, ClipsAreForWhomTheyWereShownTo) {
  const std::string ann = Join(), bob = Join();
  const std::string clip = Next(ann, Epoch(ann)).at("presentation");
  const Heard whole = Get("/clip/" + clip, ann);
  EXPECT_EQ(whole.status, 200);
  EXPECT_EQ(whole.body.substr(4, 4), "ftyp");
  EXPECT_EQ(Get("/clip/" + clip, bob).status, 404);
  EXPECT_EQ(Get("/clip/" + clip).status, 401);
  const Heard part = Get("/clip/" + clip, ann + "Range: bytes=4-7\r\n");
  EXPECT_EQ(part.status, 206);
  EXPECT_EQ(part.body, "ftyp");
  EXPECT_EQ(Get("/clip/" + clip, ann + "Range: bytes=99999999-\r\n").status, 416);
  EXPECT_THAT(whole.head, Not(HasSubstr("ETag")));
  EXPECT_THAT(whole.head, Not(HasSubstr("Last-Modified")));
  for (const StudyClip& other : study.Open().Clips())
    EXPECT_EQ(std::filesystem::file_size(study.folder() / other.file), whole.body.size()) << "all are of one length";
}

TEST_F(RatingServerTest, ARangeIsIgnoredWhereItMeansNothingAndRefusedWithTheSize) {
  const std::string ann = Join();
  const std::string path = "/clip/" + Next(ann, Epoch(ann)).at("presentation").get<std::string>();
  const std::string size = std::to_string(Get(path, ann).body.size());
  for (const char* ignored : {"items=0-3", "bytes=0-1,4-5", "bytes=5-4", "bytes=x-"}) {
    const Heard whole = Get(path, ann + "Range: " + ignored + "\r\n");
    EXPECT_EQ(whole.status, 200) << ignored;
    EXPECT_EQ(std::to_string(whole.body.size()), size) << ignored;
    EXPECT_THAT(whole.head, Not(HasSubstr("Content-Range"))) << ignored;
  }
  for (const std::string range : {"bytes=4-7", "bytes=99999999-"}) {
    const Heard head = Raw("HEAD " + path + " HTTP/1.1\r\nHost: 127.0.0.1\r\nConnection: close\r\n" + ann +
                           "Range: " + range + "\r\n\r\n");
    EXPECT_EQ(head.status, 200) << "a range is for GET alone: " << range;
    EXPECT_THAT(head.head, HasSubstr("Content-Length: " + size));
    EXPECT_EQ(head.body, "");
  }
  for (const char* outside : {"bytes=99999999-", "bytes=-0"}) {
    const Heard refused = Get(path, ann + "Range: " + outside + "\r\n");
    EXPECT_EQ(refused.status, 416) << outside;
    EXPECT_THAT(refused.head, HasSubstr("Content-Range: bytes */" + size)) << outside;
  }
}

TEST_F(RatingServerTest, NoPathLeadsToAFile) {
  const std::string ann = Join();
  const std::string file = study.Open().Clips()[0].file;
  for (const std::string path :
       {"/study.sqlite", "/clips/", "/clip/", "/clip/../study.sqlite", "/clip/..%2fstudy.sqlite", "/../../etc/passwd",
        "//etc/passwd", "/clip/%2e%2e/%2e%2e/etc/passwd", "/clip/....//study.sqlite", "/r/../study.sqlite",
        "/rating.js/..", "/api/", "/api/verdict", "/clip/00000000000000000000000000000000"})
    EXPECT_EQ(Get(path, ann).status, 404) << path;
  EXPECT_EQ(Get("/" + file, ann).status, 404);
  EXPECT_EQ(Get("/clip/" + file.substr(6, 32), ann).status, 404) << "the file's own name is nobody's";
}

TEST_F(RatingServerTest, OtherSitesChangeNothing) {
  const std::string ann = Join();
  const std::string cookie = ann.substr(0, ann.find("\r\n") + 2);
  EXPECT_EQ(Post("/api/tab", "{}", cookie).status, 403) << "no token";
  EXPECT_EQ(Post("/api/tab", "{}", cookie + "X-Evac-Csrf: " + std::string(32, 'a') + "\r\n").status, 403);
  EXPECT_EQ(Post("/api/tab", "{}", ann + "Origin: http://evil.example\r\n").status, 403);
  EXPECT_EQ(Post("/api/tab", "{}", ann + "Origin: null\r\n").status, 403);
  EXPECT_EQ(Post("/api/tab", "{}", ann + "Sec-Fetch-Site: cross-site\r\n").status, 403);
  EXPECT_EQ(Post("/api/tab", "{}", ann + "Origin: http://127.0.0.1\r\nSec-Fetch-Site: same-origin\r\n").status, 200);
  for (const std::string host :
       {"127.0.0.1.evil.example", "127.evil.example", "localhost.evil.example", "[::1].evil", ""})
    EXPECT_EQ(Raw("GET /api/me HTTP/1.1\r\nHost: " + host + "\r\nConnection: close\r\n" + ann + "\r\n").status, 403)
        << host;
  EXPECT_EQ(Raw("GET /api/me HTTP/1.1\r\nHost: evil.example\r\nConnection: close\r\n" + ann + "\r\n").status, 403)
      << "a name that was made to point here";
  EXPECT_EQ(Raw("POST /api/tab HTTP/1.1\r\nHost: 127.0.0.1\r\nConnection: close\r\nContent-Type: "
                "text/plain\r\nContent-Length: 2\r\n" +
                ann + "\r\n{}")
                .status,
            415)
      << "what a form can send is not taken";
  const Heard page = Get("/");
  EXPECT_THAT(page.head, HasSubstr("default-src 'none'; script-src 'self'"));
  EXPECT_THAT(page.head, HasSubstr("frame-ancestors 'none'"));
  EXPECT_THAT(page.head, HasSubstr("nosniff"));
  EXPECT_THAT(page.body, Not(HasSubstr("<script>"))) << "no script in the page: the policy forbids it";
}

TEST_F(RatingServerTest, WhatIsMalformedTooLargeOrAmbiguousIsRefusedAndTheServerGoesOn) {
  const std::string ann = Join();
  const std::string start = "POST /api/tab HTTP/1.1\r\nHost: 127.0.0.1\r\nContent-Type: application/json\r\n" + ann;
  EXPECT_EQ(Raw(start + "Content-Length: 2\r\nTransfer-Encoding: chunked\r\n\r\n0\r\n\r\n").status, 400)
      << "two lengths";
  EXPECT_EQ(Raw(start + "Content-Length: 2\r\nContent-Length: 3\r\n\r\n{} ").status, 400);
  EXPECT_EQ(Raw(start + "Transfer-Encoding: chunked\r\n\r\n2\r\n{}\r\n0\r\n\r\n").status, 400);
  EXPECT_EQ(Raw(start + "Content-Length: 10000000\r\n\r\n{}").status, 413);
  EXPECT_EQ(Raw(start + "X: " + std::string(20000, 'x') + "\r\n\r\n").status, 431);
  EXPECT_EQ(Raw("GET / HTTP/1.1\r\nHost: 127.0.0.1\r\nHost: evil\r\n\r\n").status, 400);
  EXPECT_EQ(Raw("GET / HTTP/1.1\r\n\r\n").status, 400) << "no host";
  EXPECT_EQ(Raw("nonsense\r\n\r\n").status, 400);
  EXPECT_EQ(Raw("DELETE / HTTP/1.1\r\nHost: 127.0.0.1\r\nConnection: close\r\n\r\n").status, 405);
  EXPECT_EQ(Raw("GET / HTTP/1.1\r\nHost: 127.0.0.1\r\n").status, 0) << "half a request: closed after a second";
  EXPECT_EQ(Post("/api/verdict", std::string(60000, '['), ann).status, 422);
  EXPECT_EQ(Post("/api/verdict", "\xff\xfe", ann).status, 422);
  EXPECT_EQ(Get("/api/me", ann).status, 200);
}

/// On phones and tablets the help and the brief told of keys without their names.
TEST_F(RatingServerTest, NoStyleHidesEveryKeysName) {
  const std::string css = Get("/rating.css").body;
  EXPECT_THAT(css, HasSubstr("button kbd"));
  EXPECT_THAT(css, Not(HasSubstr("{kbd{display:none}")));
}

TEST_F(RatingServerTest, TextsAreKeptAsTheyAreAndDoNothing) {
  const std::string ann = Join();
  const std::int64_t epoch = Epoch(ann);
  const std::string nasty = "'); DROP TABLE verdicts; -- <script>alert(1)</script> \u202e ${7*7} \"quoted\"";
  json verdict = Verdict(Next(ann, epoch).at("presentation"), epoch);
  verdict["note"] = nasty;
  ASSERT_EQ(Post("/api/verdict", verdict.dump(), ann).status, 200);
  EXPECT_EQ(study.Open().VerdictByUuid(verdict.at("client_uuid"))->note, nasty);
  EXPECT_EQ(Get("/api/me", ann).Json().at("name"), "<b>Ann</b>");
  EXPECT_THAT(Get("/api/mine", ann).head, HasSubstr("Content-Type: application/json"));
}

TEST_F(RatingServerTest, WhoGuessesIsSlowedDown) {
  int refused = 0;
  for (int i = 0; i < 60; ++i)
    refused += Get("/api/me", "Cookie: evac_rating=" + NewSecret() + "\r\n").status == 429 ? 1 : 0;
  EXPECT_GT(refused, 20);
}

TEST_F(RatingServerTest, SlowClientsHinderNobody) {
  std::vector<int> slow;
  for (int i = 0; i < 200; ++i) {
    const int socket = ConnectTo(server.port());
    ASSERT_GE(socket, 0);
    ::send(socket, "GET / HT", 8, MSG_NOSIGNAL);
    slow.push_back(socket);
  }
  EXPECT_EQ(Get("/api/me", Join()).status, 200);
  for (const int socket : slow) {
    char byte = 0;
    EXPECT_EQ(::recv(socket, &byte, 1, 0), 0) << "every one of them is closed, without an answer";
    close(socket);
  }
}

TEST_F(RatingServerTest, TwoStudiesOnOneHostDoNotTakeEachOthersSessions) {
  Join();
  const std::string link = NewSecret();
  SmallStudy other(2);  // of the same name and seed
  {
    StudyStore store = other.Open();
    store.AddInvite(link, RaterRole::kRater, 1);
  }
  RatingServer second(OptionsFor(other.folder()));
  std::thread at_work([&] { second.Serve(); });
  const Heard joined{PostJson(second.port(), "/api/join", json{{"invite", link}, {"uuid", NewSecret()}}.dump(), "")};
  const std::string mine = CookieSetBy(cookies.back()), theirs = CookieSetBy(joined.head);
  EXPECT_NE(mine.substr(0, mine.find('=')), theirs.substr(0, theirs.find('='))) << "a browser keeps one of each name";
  const Heard here = Get("/api/me", With(mine, theirs + "; "));
  EXPECT_EQ(here.status, 200) << here.body;
  const Heard there{RawExchange(second.port(), "GET /api/me HTTP/1.1\r\nHost: 127.0.0.1\r\nConnection: close\r\n" +
                                                   With(theirs, mine + "; ") + "\r\n")};
  EXPECT_EQ(there.status, 200) << there.body;
  EXPECT_EQ(here.Json().at("study"), there.Json().at("study"));
  EXPECT_NE(here.Json().at("study_id"), there.Json().at("study_id")) << "by which the page keeps their answers apart";
  EXPECT_EQ(Get("/api/me", With(theirs)).status, 401);
  second.Stop();
  at_work.join();
}

TEST_F(RatingServerTest, ASessionUnderTheNameThatAllStudiesSharedGoesOn) {
  Join();
  const std::string cookie = CookieSetBy(cookies.back()), old = "evac_rating" + cookie.substr(cookie.find('='));
  EXPECT_EQ(Get("/api/me", With(old)).status, 200);
  EXPECT_EQ(Post("/api/tab", "{}", With(old)).status, 200);
  EXPECT_EQ(Get("/api/me", With(cookie, "evac_rating=" + NewSecret() + "; ")).status, 200) << "that one is another's";
}

TEST(StudyId, StaysWithItsStudyAndIsNoOthers) {
  const SmallStudy study(1), alike(1);
  const std::string id = study.Open().Id();
  EXPECT_EQ(study.Open().Id(), id);
  EXPECT_NE(alike.Open().Id(), id) << "of the same name, seed and clips";
  EXPECT_EQ(id.find_first_not_of("0123456789abcdef"), std::string::npos);
}

/// While it lives no thread can be started that is not told its stack: there is no room for one.
class NoRoomForThreads {
 public:
  NoRoomForThreads() {
    pthread_getattr_default_np(&before_);
    pthread_attr_t huge;
    pthread_attr_init(&huge);
    pthread_attr_setstacksize(&huge, std::size_t{1} << 56);
    pthread_setattr_default_np(&huge);
    pthread_attr_destroy(&huge);
  }
  ~NoRoomForThreads() {
    pthread_setattr_default_np(&before_);
    pthread_attr_destroy(&before_);
  }

 private:
  pthread_attr_t before_{};
};

TEST(RatingHttp, AThreadThatCannotBeStartedLeavesAServerWithFewer) {
  RatingHttp http("127.0.0.1", 0, {.threads = 3}, [](const HttpAsked&, const RatingHttp::Reply& reply) { reply({}); });
  RawAnswer answer;
  std::thread asking([&] {
    answer = RawExchange(http.port(), "GET / HTTP/1.1\r\nHost: 127.0.0.1\r\nConnection: close\r\n\r\n");
    http.Stop();
  });
  {
    const NoRoomForThreads none;
    EXPECT_THROW(std::thread([] {}).join(), std::system_error) << "the test tests nothing";
    http.Serve();
  }
  asking.join();
  EXPECT_EQ(answer.status, 200);
}

/// A clip that took longer than answer_s was cut, and asked for again from its first byte, for ever.
TEST(RatingHttp, AnAnswerThatIsTakenPieceByPieceIsSentToItsEndAndOneThatNobodyTakesIsCut) {
  constexpr std::size_t kBytes = 48 << 20;  // more than all that systems keep for a socket
  constexpr int kPieces = 90;
  RatingHttp http("127.0.0.1", 0, {.answer_s = 2}, [](const HttpAsked&, const RatingHttp::Reply& reply) {
    reply({.body = std::string(kBytes, 'x')});
  });
  std::thread at_work([&] { http.Serve(); });
  const auto ask = [&] {
    const int socket = ConnectTo(http.port()), room = 1 << 20;
    ::setsockopt(socket, SOL_SOCKET, SO_RCVBUF, &room, sizeof room);
    const std::string asked = "GET / HTTP/1.1\r\nHost: 127.0.0.1\r\nConnection: close\r\n\r\n";
    ::send(socket, asked.data(), asked.size(), MSG_NOSIGNAL);
    return socket;
  };
  std::string place(65536, ' ');
  const auto take = [&](int socket, std::size_t most) {  // @returns how much came; less than `most` at the end alone
    std::size_t taken = 0;
    for (ssize_t count; taken < most && (count = ::recv(socket, place.data(), place.size(), 0)) > 0;)
      taken += static_cast<std::size_t>(count);
    return taken;
  };
  const int idle = ask(), steady = ask();
  std::size_t taken = 0;
  for (int piece = 1; piece <= kPieces; ++piece) {  // 4.5 s and more: longer than answer_s, with no pause as long
    taken += take(steady, kBytes / kPieces);
    std::this_thread::sleep_for(std::chrono::milliseconds(50));
  }
  taken += take(steady, 2 * kBytes);
  EXPECT_GT(taken, kBytes) << "body and head";
  const std::size_t left = take(idle, 2 * kBytes);
  EXPECT_LT(left, kBytes) << "of one who took nothing for longer than answer_s";
  close(steady);
  close(idle);
  http.Stop();
  at_work.join();
}

TEST(PublicUrl, IsAsBrowsersNameItOrIsRefused) {
  const std::vector<std::pair<std::string, std::string>> named = {{"https://rate.lab.org", "https://rate.lab.org"},
                                                                  {"HTTPS://Rate.Lab.org:443/", "https://rate.lab.org"},
                                                                  {"http://10.0.0.5:80", "http://10.0.0.5"},
                                                                  {"https://rate:80", "https://rate:80"},
                                                                  {"http://[::1]:08766/", "http://[::1]:8766"}};
  for (const auto& [given, wanted] : named) EXPECT_EQ(PublicUrl(given), wanted);
  for (const std::string wrong :
       {"rate.lab.org", "https://", "ftp://rate.lab.org", "https://rate.lab.org/studies", "https://rate.lab.org?a",
        "https://ann@rate.lab.org", "https://rate.lab.org:0", "https://rate.lab.org:65536", "https://rate.lab.org:",
        "https://rate lab.org", "https://rate.lab.org#"})
    EXPECT_THAT([&] { PublicUrl(wrong); },
                testing::ThrowsMessage<Error>(HasSubstr("--url: found '" + wrong + "', wanted http")));
}

/// Browsers say "Host: rate.lab.org": every page was "another site's name points here".
TEST(RatingServerBehindAProxy, IsFoundUnderItsNameHoweverThatWasWritten) {
  SmallStudy study(2);
  RatingServerOptions options;
  options.study = study.folder();
  options.public_url = "https://rate.lab.org/studies";
  EXPECT_THROW(RatingServer{options}, Error) << "pages stand at the root";
  options.public_url = "HTTPS://Rate.Lab.org:443/";
  RatingServer server(options);
  EXPECT_EQ(server.url(), "https://rate.lab.org/");
  std::thread at_work([&] { server.Serve(); });
  const std::string asked = "GET / HTTP/1.1\r\nConnection: close\r\nHost: ";
  EXPECT_EQ(RawExchange(server.port(), asked + "rate.lab.org\r\n\r\n").status, 200);
  EXPECT_EQ(RawExchange(server.port(), asked + "evil.example\r\n\r\n").status, 403);
  server.Stop();
  at_work.join();
}

/// nginx and Apache name the server that they pass to: whatever changed something was "from another site".
TEST(RatingServerBehindAProxy, TakesWhatItsPageSendsThroughAProxyThatKeepsTheHostToItself) {
  SmallStudy study(2);
  const std::string link = NewSecret();
  {
    StudyStore store = study.Open();
    store.AddInvite(link, RaterRole::kRater, 1);
  }
  RatingServerOptions options;
  options.study = study.folder();
  options.public_url = "https://Rate.Lab.org:443/";
  RatingServer server(options);
  std::thread at_work([&] { server.Serve(); });
  const std::string body = json{{"invite", link}, {"uuid", NewSecret()}}.dump();
  const auto join_from = [&](const std::string& origin) {  // PostJson says "Host: 127.0.0.1"
    const std::string headers = "Origin: " + origin + "\r\nSec-Fetch-Site: same-origin\r\n";
    return PostJson(server.port(), "/api/join", body, headers).status;
  };
  EXPECT_EQ(join_from("https://rate.lab.org.evil.example"), 403);
  EXPECT_EQ(join_from("http://rate.lab.org"), 403) << "not as it is served";
  EXPECT_EQ(join_from("https://rate.lab.org"), 200);
  server.Stop();
  at_work.join();
}

TEST_F(RatingServerTest, AStudyHasOneServer) {
  EXPECT_THROW(RatingServer another(OptionsFor(study.folder())), Error);
  EXPECT_THAT(server.url(), StartsWith("http://127.0.0.1:"));
}

}  // namespace
}  // namespace evac
