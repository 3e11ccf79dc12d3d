#include "judges/vlm_client.h"

#include <gmock/gmock.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <latch>
#include <thread>
#include <vector>

#include "core/error.h"
#include "tests/support/scripted_server.h"

namespace evac {
namespace {

using nlohmann::json;
using testing::HasSubstr;
using Trouble = std::optional<VlmOutcome>;

const std::string kGood = R"({"choices": [{"message": {"content": "hello"}, "finish_reason": "stop"}],
                              "usage": {"prompt_tokens": 100, "completion_tokens": 10}})";

/// A client of a server that answers its n-th request with the n-th of `answers`, the last of them for ever.
class Talk {
 public:
  explicit Talk(std::vector<ScriptedAnswer> answers, VlmBudget budget = {}, HttpLimits limits = {},
                std::uint64_t seed = 7)
      : server_([this, answers](const SeenRequest&) {
          return answers.at(std::min(answers.size() - 1, static_cast<std::size_t>(asked_++)));
        }),
        client_({.base_url = server_.Url() + "/v1/",
                 .bearer_key = "sk-secret",
                 .limits = limits,
                 .budget = budget,
                 .seed = seed,
                 .sleep_s = [this](double wait_s) { waits_s_.push_back(wait_s); }}) {}

  VlmSaid Ask() { return client_.Ask({{"model", "m"}}); }
  VlmClient& client() { return client_; }
  const std::vector<double>& waits_s() const { return waits_s_; }
  std::vector<SeenRequest> Seen() const { return server_.Seen(); }

 private:
  std::atomic<int> asked_ = 0;
  std::vector<double> waits_s_;
  ScriptedServer server_;
  VlmClient client_;
};

TEST(VlmClient, AsksAtTheUsualPlaceWithTheKeyInItsHeader) {
  Talk talk({Answer(200, kGood)});
  const VlmSaid said = talk.Ask();
  EXPECT_FALSE(said.trouble) << said.message;
  EXPECT_EQ(said.completion.text, "hello");
  ASSERT_EQ(talk.Seen().size(), 1u);
  EXPECT_EQ(talk.Seen()[0].path, "/v1/chat/completions");
  EXPECT_EQ(talk.Seen()[0].headers.at("authorization"), "Bearer sk-secret");
  EXPECT_EQ(json::parse(talk.Seen()[0].body), (json{{"model", "m"}}));
  EXPECT_EQ(talk.client().spent().prompt_tokens, 100);
}

TEST(VlmClient, A429WaitsAsLongAsTheServerSaysWithinTwoMinutes) {
  const auto limited = [](const std::string& after) { return Answer(429, "{}", "Retry-After: " + after + "\r\n"); };
  Talk talk({limited("7"), limited("-3"), limited("999999"), limited("Fri, 01 Jan 2100 00:00:00 GMT"),
             limited("Mon, 01 Jan 2001 00:00:00 GMT"), Answer(200, kGood)});
  EXPECT_FALSE(talk.Ask().trouble);
  EXPECT_THAT(talk.waits_s(), testing::ElementsAre(7, 0, 120, 120, 0));
}

/// A wait is drawn evenly, so that many clients do not come back together: of 24, the longest is near the most it may
/// be.
TEST(VlmClient, WithoutAHintTheLongestWaitDoublesEachTime) {
  std::array<double, 5> longest_s{};
  for (std::uint64_t seed = 0; seed < 24; ++seed) {
    Talk talk({Answer(503, "{}")}, {}, {}, seed);
    talk.Ask();
    ASSERT_EQ(talk.waits_s().size(), longest_s.size());
    for (std::size_t i = 0; i < longest_s.size(); ++i) {
      EXPECT_GT(talk.waits_s()[i], 0);
      longest_s[i] = std::max(longest_s[i], talk.waits_s()[i]);
    }
  }
  for (std::size_t i = 0; i < longest_s.size(); ++i) {
    EXPECT_LE(longest_s[i], 1 << i);
    EXPECT_GT(longest_s[i], 0.9 * (1 << i));
  }
}

TEST(VlmClient, WithoutAHintItGivesUpAfterSixTries) {
  Talk talk({Answer(503, "{}"), Answer(429, "{}", "Retry-After: soon\r\n"), Answer(503, R"({"error": "overloaded"})")});
  const VlmSaid said = talk.Ask();
  EXPECT_EQ(said.trouble, VlmOutcome::kHttpError);
  EXPECT_THAT(said.message, AllOf(HasSubstr("503"), HasSubstr("overloaded")));
  EXPECT_EQ(said.attempts, 6);
  EXPECT_EQ(talk.waits_s().size(), 5u);
}

TEST(VlmClient, WhatIsOnlyBrokenIsAskedAgain) {
  const ScriptedAnswer reset{{{0, "HTTP/1.1 200 OK\r\n"}}, true};
  const ScriptedAnswer half{{{0, "HTTP/1.1 200 OK\r\nContent-Length: 5000\r\n\r\n{\"choices\""}}};
  const ScriptedAnswer cut_chunks{{{0, "HTTP/1.1 200 OK\r\nTransfer-Encoding: chunked\r\n\r\nff\r\n{\"ch"}}};
  for (const ScriptedAnswer& bad :
       {Answer(500, "oops"), Answer(502, "<html>"), Answer(504, ""), Answer(520, ""), reset, half, cut_chunks,
        Answer(200, "<html>welcome</html>"), Answer(200, R"({"error": {"message": "out of memory"}})"),
        Answer(200, "{\"choices\": \"\xff\"}"), ScriptedAnswer{}}) {
    Talk talk({bad, Answer(200, kGood)});
    const VlmSaid said = talk.Ask();
    EXPECT_FALSE(said.trouble) << said.message;
    EXPECT_EQ(said.attempts, 2) << bad.pieces.size();
  }
}

TEST(VlmClient, ARequestThatIsRefusedIsNotRepeated) {
  for (const int status : {400, 413, 422}) {
    Talk talk({Answer(status, R"({"error": {"message": "This model's maximum context length is 4096"}})")});
    const VlmSaid said = talk.Ask();
    EXPECT_TRUE(said.was_rejected);
    EXPECT_THAT(said.message, HasSubstr("maximum context length"));
    EXPECT_EQ(talk.Seen().size(), 1u);
    EXPECT_FALSE(talk.client().WhyOver());
  }
  Talk talk({Answer(415, "{}")});
  EXPECT_EQ(talk.Ask().trouble, VlmOutcome::kUnsupportedMedia);
}

TEST(VlmClient, AWrongKeyEndsEverythingAtOnceAndIsNotRepeatedInTheMessage) {
  for (const int status : {401, 403}) {
    Talk talk({Answer(status, R"({"error": {"message": "bad key"}})")});
    talk.Ask();
    ASSERT_TRUE(talk.client().WhyOver());
    EXPECT_THAT(*talk.client().WhyOver(), AllOf(HasSubstr("bad key"), testing::Not(HasSubstr("sk-secret"))));
    talk.Ask();
    EXPECT_EQ(talk.Seen().size(), 1u) << "nothing more is sent";
  }
}

/// The rest of the run was stored as errors, one episode after another, and never asked about again.
TEST(VlmClient, CreditThatIsUsedUpEndsEverythingAtOnce) {
  Talk talk({Answer(402, R"({"error": {"message": "Insufficient credits"}})")});
  EXPECT_EQ(talk.Ask().trouble, VlmOutcome::kHttpError);
  EXPECT_THAT(talk.client().WhyOver().value_or("it goes on"), HasSubstr("status 402: Insufficient credits"));
  talk.Ask();
  EXPECT_EQ(talk.Seen().size(), 1u) << "nothing more is sent";
}

TEST(VlmClient, AStatusThatNobodyForesawIsOneOfTheTroublesInARow) {
  for (const int status : {301, 405, 410, 451}) {
    Talk talk({Answer(status, "{}")});
    for (int i = 0; i < 10; ++i) EXPECT_EQ(talk.Ask().attempts, 1) << "it is not asked again";
    EXPECT_EQ(std::count(talk.waits_s().begin(), talk.waits_s().end(), 60), 1) << status;
    EXPECT_FALSE(talk.client().WhyOver());
    talk.Ask();
    EXPECT_THAT(talk.client().WhyOver().value_or("it goes on"), HasSubstr("in a row failed, also after a pause"));
  }
  Talk refused({Answer(422, "{}")});
  for (int i = 0; i < 12; ++i) refused.Ask();
  EXPECT_FALSE(refused.client().WhyOver()) << "of that request alone";
}

TEST(VlmClient, AfterTenTroublesInARowItPausesOnceAndThenGivesUp) {
  Talk talk({Answer(500, "oops")});
  EXPECT_EQ(talk.Ask().attempts, 6);
  EXPECT_FALSE(talk.client().WhyOver());
  talk.Ask();
  EXPECT_THAT(*talk.client().WhyOver(), HasSubstr("in a row failed"));
  EXPECT_EQ(talk.Seen().size(), 11u);
  EXPECT_EQ(std::count(talk.waits_s().begin(), talk.waits_s().end(), 60), 1);
}

/// Failures of requests that were under way when the pause began counted as failures after it, and nothing was waited
/// for: the eleventh of those that were sent together ended the run.
TEST(VlmClient, WhatWasSentBeforeThePauseDoesNotSayThatItDidNotHelp) {
  constexpr int kTogether = 24;
  for (const bool helps : {true, false}) {
    std::latch all_are_sent(kTogether);
    std::atomic<int> asked = 0;
    std::atomic<bool> has_paused = false;
    std::vector<double> waits_s;  // one waits at a time
    const ScriptedServer server([&](const SeenRequest&) {
      if (asked++ < kTogether) all_are_sent.arrive_and_wait();
      return has_paused && helps ? Answer(200, kGood) : Answer(500, "oops");
    });
    VlmClient client({.base_url = server.Url(), .sleep_s = [&](double wait_s) {
                        waits_s.push_back(wait_s);
                        if (wait_s == 60) has_paused = true;
                      }});
    {
      std::vector<std::jthread> raters;
      for (int i = 0; i < kTogether; ++i) raters.emplace_back([&client] { client.Ask({{"model", "m"}}); });
    }
    EXPECT_GE(std::count(waits_s.begin(), waits_s.end(), 60), 1);
    const std::string why_over = client.WhyOver().value_or("it goes on");
    EXPECT_THAT(why_over, HasSubstr(helps ? "it goes on" : "in a row failed, also after a pause"));
  }
}

TEST(VlmClient, AGoodAnswerEndsARowOfTroubles) {
  std::vector<ScriptedAnswer> answers;
  for (int i = 0; i < 40; ++i) answers.push_back(i % 5 == 4 ? Answer(200, kGood) : Answer(500, "oops"));
  Talk talk(answers);
  for (int i = 0; i < 8; ++i) EXPECT_FALSE(talk.Ask().trouble);
  EXPECT_FALSE(talk.client().WhyOver());
}

TEST(VlmClient, SlownessOfEachKindIsATimeout) {
  const HttpLimits limits{.connect_s = 5, .first_byte_s = 0.3, .idle_s = 0.3, .total_s = 3};
  const ScriptedAnswer silent{{{20, "HTTP/1.1 200 OK\r\n\r\n"}}};
  const ScriptedAnswer stops{{{0, "HTTP/1.1 200 OK\r\nContent-Length: 500\r\n\r\n{"}, {20, "}"}}};
  ScriptedAnswer drips{{{0, "HTTP/1.1 200 OK\r\nContent-Length: 500\r\n\r\n"}}};
  for (int i = 0; i < 200; ++i) drips.pieces.push_back({0.1, " "});
  for (const ScriptedAnswer& slow : {silent, stops, drips}) {
    Talk talk({slow}, {}, limits);
    const VlmSaid said = talk.Ask();
    EXPECT_EQ(said.trouble, VlmOutcome::kTimeout) << said.message;
    EXPECT_EQ(said.attempts, 2);
  }
}

TEST(VlmClient, AHugeAnswerIsCutOffAndNotAskedForAgain) {
  ScriptedAnswer huge{{{0, "HTTP/1.1 200 OK\r\nContent-Length: 50000000\r\n\r\n"}}};
  for (int i = 0; i < 50; ++i) huge.pieces.push_back({0, std::string(1000000, ' ')});
  Talk talk({huge});
  const VlmSaid said = talk.Ask();
  EXPECT_EQ(said.trouble, VlmOutcome::kHttpError);
  EXPECT_THAT(said.message, HasSubstr("larger than 4194304 bytes"));
  EXPECT_EQ(talk.Seen().size(), 1u);
}

TEST(VlmClient, NothingIsSentBeyondTheBudget) {
  const std::vector<std::pair<VlmBudget, std::string>> budgets = {
      {{.max_requests = 2}, "2 requests were sent"},
      {{.max_tokens = 220}, "220 tokens are spent of 220"},
      {{.max_usd = 0.0003, .usd_per_million_prompt_tokens = 1, .usd_per_million_completion_tokens = 10}, "USD"}};
  for (const auto& [budget, why] : budgets) {
    Talk talk({Answer(200, kGood)}, budget);
    for (int i = 0; i < 4; ++i) talk.Ask();
    EXPECT_EQ(talk.Seen().size(), 2u);
    ASSERT_TRUE(talk.client().WhyOver()) << why;
    EXPECT_THAT(*talk.client().WhyOver(), AllOf(HasSubstr("the budget is spent"), HasSubstr(why)));
  }
}

TEST(VlmClient, TheBudgetHoldsOverWhatEarlierCallsSpent) {
  Talk talk({Answer(200, kGood)}, {.max_tokens = 440});
  talk.client().CountEarlier({.requests = 2, .prompt_tokens = 200, .completion_tokens = 20});
  for (int i = 0; i < 4; ++i) talk.Ask();
  EXPECT_EQ(talk.Seen().size(), 2u);
  EXPECT_THAT(talk.client().WhyOver().value_or("it goes on"),
              HasSubstr("440 tokens are spent of 440 (with 2 requests of earlier calls)"));
  EXPECT_EQ(talk.client().spent().requests, 2) << "of its own";
}

/// Six tries and their waits went on for minutes after Ctrl-C.
TEST(VlmClient, NothingIsSentAfterAnInterruptAndNoBudgetIsBlamed) {
  bool is_interrupted = false;
  const ScriptedServer server([](const SeenRequest&) { return Answer(503, "{}"); });
  VlmClient client({.base_url = server.Url(),
                    .sleep_s = [&](double) { is_interrupted = true; },
                    .interrupted = [&] { return is_interrupted; }});
  client.Ask({{"model", "m"}});
  client.Ask({{"model", "m"}});
  EXPECT_EQ(server.Seen().size(), 1u);
  EXPECT_EQ(client.WhyOver(), "interrupted");
}

TEST(VlmClient, TheServersNameOfTheModelIsTheSameAtEveryStart) {
  const auto models = [](const std::string& created) {
    return Answer(200, R"({"data": [{"id": "other"}, {"id": "m", "root": "org/m", "created": )" + created + "}]}");
  };
  Talk first({models("1")}), second({models("2")});
  EXPECT_EQ(first.client().Fingerprint("m"), second.client().Fingerprint("m"));
  EXPECT_THAT(first.client().Fingerprint("m"), HasSubstr("org/m"));
  EXPECT_EQ(Talk({Answer(404, "")}).client().Fingerprint("m"), "");
  try {
    first.client().Fingerprint("qwen");
    FAIL() << "there is no such model";
  } catch (const Error& error) {
    EXPECT_THAT(error.what(), AllOf(HasSubstr("no model 'qwen'"), HasSubstr("other, m")));
    EXPECT_EQ(error.exit_code(), ExitCode::kInvalidInput);
  }
}

TEST(VlmClient, AUrlThatIsNoneAndAServerThatIsNotThereAreInvalidInput) {
  EXPECT_THROW(VlmClient({.base_url = "localhost:8000"}), Error);
  EXPECT_THROW(VlmClient({.base_url = "file:///etc/passwd"}), Error);
  VlmClient nobody({.base_url = "http://127.0.0.1:9"});
  EXPECT_THROW(nobody.Fingerprint("m"), Error);
}

}  // namespace
}  // namespace evac
