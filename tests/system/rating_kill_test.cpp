#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <signal.h>
#include <sys/wait.h>

#include <atomic>
#include <chrono>
#include <fstream>
#include <mutex>
#include <nlohmann/json.hpp>
#include <set>
#include <sstream>
#include <stdexcept>
#include <thread>

#include "core/file.h"
#include "core/hash.h"
#include "core/secret.h"
#include "core/store_study.h"
#include "tests/reports/stored_run.h"
#include "tests/support/command.h"
#include "tests/support/raw_http.h"

/// What was answered 200 is on disk, whatever becomes of the server.
namespace evac::system_test {
namespace {

using nlohmann::json;

constexpr int kKills = 10;
constexpr int kMostTries = 30000;  // many minutes: what is not there by then will not come

/// `evac rate serve`, killed and started again at one port.
class MortalServer {
 public:
  explicit MortalServer(std::string study) : study_(std::move(study)), log_(study_ + "/serve.log") { Start(); }
  ~MortalServer() { Kill(); }

  void Start() {
    std::filesystem::remove(log_);
    process_ = StartCommand({Binary("evac"), "rate", "serve", study_, "--port", std::to_string(port)}, log_);
    int tries = 0;
    for (std::string url; url.empty();) {
      if (waitpid(process_, nullptr, WNOHANG) == process_) throw std::runtime_error("it ended: " + ReadFile(log_));
      if (++tries > kMostTries) throw std::runtime_error("it never said where it listens: " + ReadFile(log_));
      std::this_thread::sleep_for(std::chrono::milliseconds(10));
      std::ifstream(log_) >> url;
      if (url.starts_with("http://") && url.ends_with("/"))
        port = std::stoi(url.substr(url.rfind(':') + 1));
      else
        url.clear();
    }
  }
  void Kill() {
    kill(process_, SIGKILL);
    waitpid(process_, nullptr, 0);
  }

  std::atomic<int> port = 0;

 private:
  std::string study_, log_;
  pid_t process_ = 0;
};

/// One rater who never gives up and remembers what the server has answered.
class Stubborn {
 public:
  Stubborn(const MortalServer& server, const std::string& link) : server_(server) {
    const json joined = {{"invite", link}, {"uuid", NewSecret()}};
    RawAnswer answer;
    for (int tries = 0; session_.empty() && tries < kMostTries && IsWorthAnotherTry(answer); ++tries) {
      if (tries > 0) std::this_thread::sleep_for(std::chrono::milliseconds(20));
      answer = PostJson(server_.port, "/api/join", joined.dump(), "");
      cookie_ = CookieSetBy(answer.head);
      session_ = cookie_.substr(cookie_.find('=') + 1);
    }
    epoch_ = Insist("/api/tab", "{}").at("tab_epoch");
  }

  void RateAll() {
    for (;;) {
      const json next = Insist("/api/next", json{{"tab_epoch", epoch_}}.dump());
      if (next.contains("done")) return;
      const std::string uuid = NewSecret();
      Insist("/api/verdict", json{{"client_uuid", uuid},
                                  {"presentation", next.at("presentation")},
                                  {"tab_epoch", epoch_},
                                  {"label", "success"},
                                  {"coverage", 1}}
                                 .dump());
      answered.insert(uuid);
      std::this_thread::sleep_for(std::chrono::milliseconds(20));
    }
  }

  std::set<std::string> answered;

 private:
  /// Of a server that is away, busy or starting; what is refused for good would be refused for ever.
  static bool IsWorthAnotherTry(const RawAnswer& answer) {
    EXPECT_TRUE(answer.status == 0 || answer.status == 429 || answer.status == 503) << answer.status << answer.body;
    return !testing::Test::HasFailure();
  }

  /// What it answers in the end; that all is done where it will not.
  json Insist(const std::string& path, const std::string& body) {
    const std::string csrf = Sha256Hex("csrf " + session_).substr(0, 32);
    for (int tries = 0; tries < kMostTries; ++tries) {
      const RawAnswer answer =
          PostJson(server_.port, path, body, "Cookie: " + cookie_ + "\r\nX-Evac-Csrf: " + csrf + "\r\n");
      if (answer.status == 200) return json::parse(answer.body);
      if (!IsWorthAnotherTry(answer)) return {{"done", true}};
      std::this_thread::sleep_for(std::chrono::milliseconds(20));
    }
    ADD_FAILURE() << path << " is never answered";
    return {{"done", true}};
  }

  const MortalServer& server_;
  std::string cookie_, session_;
  std::int64_t epoch_ = 0;
};

TEST(RatingServer, KilledTenTimesLosesNoVerdictThatItAnsweredAndDoublesNone) {
  const StoredRun run("killed", std::string(30, 's'), std::string(30, 'f'));
  const std::string study = (run.folder().parent_path() / "study").string();
  ASSERT_EQ(
      RunCommand({Binary("evac"), "rate", "new", study, "--run", run.folder().string(), "--height", "64"}).exit_code,
      0);
  std::istringstream links(RunCommand({Binary("evac"), "rate", "invite", study, "--count", "4"}).out);
  MortalServer server(study);
  std::vector<std::unique_ptr<Stubborn>> raters;
  for (std::string link; links >> link;)
    raters.push_back(std::make_unique<Stubborn>(server, link.substr(link.size() - 32)));
  std::vector<std::thread> threads;
  for (const auto& rater : raters) threads.emplace_back([&rater] { rater->RateAll(); });
  for (int i = 0; i < kKills; ++i) {
    std::this_thread::sleep_for(std::chrono::milliseconds(150));
    server.Kill();
    server.Start();
  }
  for (std::thread& thread : threads) thread.join();
  std::multiset<std::string> stored, answered;
  for (const auto& rater : raters) answered.insert(rater->answered.begin(), rater->answered.end());
  for (const auto& row : StudyStore::Open(study, StudyStore::Mode::kReadOnly).VerdictTable().rows)
    stored.insert(row[6]);
  EXPECT_EQ(stored, answered);
  EXPECT_GE(answered.size(), 180u) << "sixty clips, three votes each";
}

}  // namespace
}  // namespace evac::system_test
