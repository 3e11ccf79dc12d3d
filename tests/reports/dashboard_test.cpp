#include "reports/dashboard.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <httplib.h>

#include <fstream>
#include <future>
#include <nlohmann/json.hpp>
#include <thread>

#include "core/error.h"
#include "reports/dashboard_paths.h"
#include "reports/dashboard_run.h"
#include "tests/reports/stored_run.h"
#include "tests/support/command.h"
#include "tests/support/temp_folder.h"

namespace evac {
namespace {

using testing::AllOf;
using testing::HasSubstr;
using testing::Not;

DashboardOptions OptionsFor(std::vector<std::filesystem::path> runs, const std::string& host = "127.0.0.1") {
  DashboardOptions options;
  options.host = host;
  options.runs = std::move(runs);
  options.look_every_s = 0.05;
  options.program = "evac test";
  return options;
}

/// A dashboard at work, on a port of its own.
class Served {
 public:
  explicit Served(std::vector<std::filesystem::path> runs, const std::string& host = "127.0.0.1")
      : host_(host),
        dashboard_(OptionsFor(std::move(runs), host)),
        thread_([this] { dashboard_.Serve(); }) {}
  ~Served() {
    dashboard_.Stop();
    thread_.join();
  }
  int port() const { return dashboard_.port(); }
  httplib::Client Client() const {
    httplib::Client client(host_, dashboard_.port());
    client.set_read_timeout(60);
    return client;
  }
  /// Exactly these bytes as the path: nothing is tidied up on the way.
  int StatusOf(const std::string& path, const httplib::Headers& headers = {}) const {
    const auto answer = Client().Get(path.c_str(), headers);
    return answer ? answer->status : -1;
  }

 private:
  std::string host_;
  Dashboard dashboard_;
  std::thread thread_;
};

TEST(Dashboard, ListsItsRunsWithTheirHistoryAndServesEachReport) {
  const StoredRun monday("monday", "sssf", "ssff"), tuesday("tuesday", "ssss", "ssff");
  const Served served({monday.folder(), tuesday.folder()});
  httplib::Client client = served.Client();
  const auto index = client.Get("/");
  ASSERT_TRUE(index);
  EXPECT_EQ(index->status, 200);
  EXPECT_THAT(index->body, HasSubstr("monday"));
  EXPECT_THAT(index->body, HasSubstr("href=\"runs/1/\""));
  const auto page = client.Get("/runs/1/");
  EXPECT_THAT(page->body, HasSubstr("Policy evaluation"));
  EXPECT_THAT(page->body, HasSubstr("\"run\":\"files/\""));
  EXPECT_THAT(page->get_header_value("X-Content-Type-Options"), "nosniff");
  const auto history = nlohmann::json::parse(client.Get("/history.json")->body);
  EXPECT_EQ(history.at("runs").at(0).at("rates").at(0).at("success_rate").at("value"), 0.75);
  EXPECT_EQ(history.at("runs").at(1).at("rates").at(0).at("success_rate").at("value"), 1.0);
  EXPECT_EQ(nlohmann::json::parse(client.Get("/runs/0/report.json")->body).at("episodes").size(), 8u);
}

TEST(Dashboard, ShowsWhatARunWroteMeanwhileAndTellsThatThereIsMore) {
  StoredRun run("growing", "ss", "ss");
  const Served served({run.folder()});
  httplib::Client client = served.Client();
  EXPECT_EQ(nlohmann::json::parse(client.Get("/runs/0/report.json")->body).at("episodes").size(), 4u);
  std::string heard;
  int pieces = 0;
  httplib::Client listener = served.Client();
  listener.Get("/events", [&](const char* bytes, std::size_t count) {
    heard.append(bytes, count);
    if (++pieces == 1) run.Add("41-0100", 's', 'f');  // what came first is the state before
    const std::size_t first = heard.find("data: ");
    const bool has_news = first != std::string::npos && heard.find("data: ", first + 1) != std::string::npos;
    return !has_news && pieces < 30;  // breath is drawn every ten seconds: no news will come
  });
  EXPECT_THAT(heard, testing::MatchesRegex("data: .*\n\n(.|\n)*data: .*\n\n")) << "the state, then news";
  EXPECT_EQ(nlohmann::json::parse(client.Get("/runs/0/report.json")->body).at("episodes").size(), 6u);
}

TEST(Dashboard, APageCarriesTheStampOfWhatItWasCountedFrom) {
  StoredRun run("stamped", "ss", "ss");
  TempFolder empty;
  const Served served({empty.path() / "soon", run.folder()});
  httplib::Client client = served.Client();
  const std::string then = StampOf(run.folder());
  const std::string page = client.Get("/runs/1/")->body, index = client.Get("/")->body;
  EXPECT_THAT(page, HasSubstr("data-run=\"1\" data-stamp=\"" + then + "\""));
  EXPECT_THAT(index, HasSubstr("data-stamp=\"[&quot;none none &quot;,&quot;" + then + "&quot;]\""));
  EXPECT_THAT(client.Get("/runs/0/")->body, AllOf(HasSubstr("data-stamp=\"none none \""), HasSubstr("class=\"live\"")));
  run.Add("41-0100", 's', 'f');
  EXPECT_NE(StampOf(run.folder()), then);
  EXPECT_THAT(client.Get("/runs/1/")->body, HasSubstr("data-stamp=\"" + StampOf(run.folder()) + "\""));
}

TEST(Dashboard, ToReadARunIsNoNewsOfIt) {
  StoredRun run("finished", "s", "s");
  { const Store closed = std::move(run.store()); }
  const Served served({run.folder()});
  const std::string page = served.Client().Get("/runs/0/")->body;
  EXPECT_THAT(page, HasSubstr("data-stamp=\"" + StampOf(run.folder()) + "\""));
}

TEST(Dashboard, InABrowserAPageThatWasOldWhenItsNewsCameSaysSo) {
  const StoredRun run("browsed", "s", "s");
  const Served served({run.folder(), run.folder()});
  httplib::Client client = served.Client();
  const std::string stamp = StampOf(run.folder());
  TempFolder folder;
  std::ofstream(folder / "index.html") << client.Get("/")->body;
  std::ofstream(folder / "run.html") << client.Get("/runs/1/")->body;
  const CommandResult read = RunCommand({"/usr/bin/python3", "-B", EVAC_SOURCE_DIR "/tests/reports/live_page.py",
                                         (folder / "index.html").string(), (folder / "run.html").string(), stamp});
  if (read.exit_code == 77) GTEST_SKIP() << read.out;
  EXPECT_EQ(read.exit_code, 0) << read.err << read.out;
  EXPECT_THAT(read.out, HasSubstr("0 failed"));
}

TEST(Dashboard, GivesVideosInPieces) {
  const StoredRun run("videos", "s", "s");
  const Served served({run.folder()});
  const std::string path = "/runs/0/files/videos/real/take/pick@1/41-0000-s1.mp4";
  httplib::Client client = served.Client();
  const auto whole = client.Get(path);
  ASSERT_TRUE(whole);
  ASSERT_EQ(whole->status, 200);
  EXPECT_EQ(whole->get_header_value("Content-Type"), "video/mp4");
  EXPECT_EQ(whole->body.substr(4, 4), "ftyp");
  const auto piece = client.Get(path, {httplib::make_range_header({{4, 7}})});
  EXPECT_EQ(piece->status, 206);
  EXPECT_EQ(piece->body, "ftyp");
  EXPECT_EQ(served.StatusOf("/runs/0/files/thumbs/real/take/pick@1/41-0000-s1.jpg"), 200);
}

TEST(Dashboard, NothingOutsideTheVideosAndThumbnailsOfARunIsGivenOut) {
  const StoredRun run("closed", "s", "s");
  TempFolder outside;
  std::ofstream(outside.path() / "secret.mp4") << "secret";
  std::filesystem::create_symlink(outside.path() / "secret.mp4", run.folder() / "videos" / "leak.mp4");
  std::filesystem::create_directory_symlink(outside.path(), run.folder() / "videos" / "there");
  const Served served({run.folder()});
  for (const std::string path :
       {"/runs/0/files/evac.sqlite", "/runs/0/files/videos/../evac.sqlite", "/runs/0/files/videos/../../x.mp4",
        "/runs/0/files/videos/%2e%2e/%2e%2e/etc/passwd", "/runs/0/files/videos/..%2f..%2fsecret.mp4",
        "/runs/0/files//etc/hosts.mp4", "/runs/0/files/videos/leak.mp4", "/runs/0/files/videos/there/secret.mp4",
        "/runs/0/files/videos", "/runs/0/files/videos/", "/runs/1/", "/runs/99999999999999999999/", "/runs/-1/",
        "/runs/0", "/index.html", "/runs/0/files/videos/real/take/pick@1/41-0000-s1.mp4%00.mp4"}) {
    EXPECT_EQ(served.StatusOf(path), 404) << path;
  }
}

TEST(Dashboard, AnswersReadersAloneAndNoOtherSitesName) {
  const StoredRun run("guarded", "s", "s");
  const Served served({run.folder()});
  httplib::Client client = served.Client();
  EXPECT_EQ(client.Post("/", "x", "text/plain")->status, 405);
  EXPECT_EQ(client.Delete("/runs/0/")->status, 405);
  EXPECT_EQ(served.StatusOf("/", {{"Host", "evil.example"}}), 403);
  EXPECT_EQ(served.StatusOf("/", {{"Host", "localhost:1234"}}), 200);
}

TEST(Dashboard, AnswersByTheLoopbackAddressThatItWasToldToListenAt) {
  const StoredRun run("elsewhere", "s", "s");
  const Served served({run.folder()}, "127.0.0.2");
  EXPECT_EQ(served.StatusOf("/"), 200);
  EXPECT_EQ(served.StatusOf("/", {{"Host", "127.0.0.2"}}), 200);
  for (const char* host : {"evil.example", "127.0.0.2.evil.example", "127.0.0.3"})
    EXPECT_EQ(served.StatusOf("/", {{"Host", host}}), 403) << host;
}

TEST(Dashboard, ARunThatIsNotThereYetIsListedWithTheReason) {
  TempFolder empty;
  const Served served({empty.path() / "<b>soon</b>"});
  httplib::Client client = served.Client();
  const std::string index = client.Get("/")->body;
  EXPECT_THAT(index, Not(HasSubstr("<b>soon")));
  EXPECT_THAT(index, HasSubstr("&lt;b&gt;soon"));
  EXPECT_EQ(served.StatusOf("/runs/0/"), 200);
}

TEST(Dashboard, AnAddressThatIsTakenIsRefused) {
  TempFolder empty;
  const Dashboard first({.runs = {empty.path()}});
  ASSERT_GT(first.port(), 0);
  const std::string taken = "127.0.0.1:" + std::to_string(first.port()) + " cannot be listened at";
  EXPECT_THAT([&] { Dashboard({.runs = {empty.path()}, .port = first.port()}); },
              testing::ThrowsMessage<Error>(HasSubstr(taken)));
}

TEST(Dashboard, AnAddressIsFreeAgainOnceItsDashboardIsGone) {
  const StoredRun run("again", "s", "s");
  int port = 0;
  {
    const Served served({run.folder()});
    ASSERT_EQ(served.StatusOf("/"), 200);
    port = served.port();
  }
  EXPECT_EQ(Dashboard({.runs = {run.folder()}, .port = port}).port(), port);
}

TEST(Dashboard, AnAddressOfNoMachineIsRefused) {
  TempFolder empty;
  EXPECT_THAT([&] { Dashboard({.runs = {empty.path()}, .host = "192.0.2.1"}); },
              testing::ThrowsMessage<Error>(HasSubstr("192.0.2.1:0 cannot be listened at")))
      << "RFC 5737 keeps it for documentation";
}

TEST(Dashboard, WhatCanBeListenedAtNoMoreIsSaidToBeSo) {
  TempFolder empty;
  Dashboard dashboard(OptionsFor({empty.path()}));
  std::future<void> served = std::async(std::launch::async, [&] { dashboard.Serve(); });
  ASSERT_TRUE(httplib::Client("127.0.0.1", dashboard.port()).Get("/"));
  for (int descriptor = 0; descriptor < 1024; ++descriptor) {
    sockaddr_in address{};
    socklen_t size = sizeof(address);
    const bool is_socket = ::getsockname(descriptor, reinterpret_cast<sockaddr*>(&address), &size) == 0;
    if (is_socket && ntohs(address.sin_port) == dashboard.port()) ::shutdown(descriptor, SHUT_RDWR);
  }
  EXPECT_THAT([&] { served.get(); },
              testing::ThrowsMessage<Error>(HasSubstr(dashboard.url() + " cannot be listened at any more")));
}

TEST(DashboardPath, OnlyWhatAPageNamesIsThere) {
  EXPECT_EQ(ParseDashboardPath("/")->view, DashboardView::kIndex);
  EXPECT_EQ(ParseDashboardPath("/runs/12/")->run, 12u);
  EXPECT_EQ(ParseDashboardPath("/runs/3/files/videos/a/b@1/c d.mp4")->file, "videos/a/b@1/c d.mp4");
  for (const std::string_view bad :
       {"", "runs/0/", "/runs//", "/runs/0x/", "/runs/+1/", "/runs/0/files/videos/a\\b.mp4",
        "/runs/0/files/videos/./a.mp4", "/runs/0/files/thumbs/a.mp4", "/events/"})
    EXPECT_FALSE(ParseDashboardPath(bad)) << bad;
}

TEST(DashboardPath, LoopbackHasFewNames) {
  for (const char* host : {"127.0.0.1", "127.0.0.1:80", "localhost:8765", "[::1]:1", "[::1]"})
    EXPECT_TRUE(IsLoopbackHost(host)) << host;
  for (const char* host :
       {"", "127.0.0.1.evil.example", "localhost.evil", "127.0.0.1:", "127.0.0.1:x", "[::1", "[::2]"})
    EXPECT_FALSE(IsLoopbackHost(host)) << host;
  EXPECT_TRUE(IsLoopbackHost("127.0.0.2:80", "127.0.0.2"));
  EXPECT_TRUE(IsLoopbackHost("localhost:80", "127.0.0.2"));
  for (const char* host : {"", ":80", "127.0.0.2:x", "127.0.0.20", "127.0.0.2.evil.example"})
    EXPECT_FALSE(IsLoopbackHost(host, "127.0.0.2")) << host;
  EXPECT_FALSE(IsLoopbackHost("127.0.0.2"));
  EXPECT_FALSE(IsLoopbackHost("", ""));
}

}  // namespace
}  // namespace evac
