#include "apps/judge_with_vlm.h"

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <signal.h>

#include <atomic>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <utility>

#include "judges/vlm_prompt.h"
#include "tests/reports/stored_run.h"
#include "tests/support/scripted_server.h"

namespace evac {
namespace {

using nlohmann::json;
using testing::HasSubstr;

ScriptedAnswer Saying(const json& content) {
  return Answer(200, json{{"choices", {{{"message", {{"content", content.dump()}}}, {"finish_reason", "stop"}}}},
                          {"usage", {{"prompt_tokens", 3200}, {"completion_tokens", 80}}}}
                         .dump());
}

/// A model server that sees, takes eight images at most, and to which every clip is a failure.
ScriptedAnswer Cramped(const SeenRequest& request) {
  if (request.path == "/v1/models") return Answer(200, R"({"data": [{"id": "gloom", "root": "org/gloom"}]})");
  const json asked = json::parse(request.body);
  if (asked["response_format"]["json_schema"]["name"] == "numbers")
    return Saying({{"numbers", MakeSightTest({.model = "gloom"}).numbers}});
  int images = 0;
  for (const json& part : asked["messages"][1]["content"]) images += part["type"] == "image_url";
  if (images > 8) return Answer(400, R"({"error": {"message": "At most 8 image(s) may be provided in one prompt."}})");
  return Saying({{"observations", "nothing moves"},
                 {"stages", json::array()},
                 {"verdict", "failure"},
                 {"confidence", 0.9},
                 {"evidence_frames", {0}},
                 {"artefacts", {"none"}}});
}

class ASmallServer : public testing::Test {
 protected:
  ASmallServer() {
    const Store closed = std::move(run_.store());  // verdicts are written into the run
    std::ofstream(page_) << fmt::format("name: gloomy\nbase_url: {}/v1\nmodel: gloom\nprobe_share: 1\n", server_.Url());
  }

  std::string Judge(bool again = false, bool dry_run = false, bool retest = false) const {
    VlmJudgeArguments arguments;
    arguments.run = run_.folder();
    arguments.config = page_;
    arguments.again = again;
    arguments.dry_run = dry_run;
    arguments.retest = retest;
    testing::internal::CaptureStdout();
    const ExitCode code = JudgeWithVlm(arguments);
    const std::string printed = testing::internal::GetCapturedStdout();
    EXPECT_EQ(code, ExitCode::kOk);
    return printed;
  }

  std::size_t Verdicts() const {
    std::size_t count = 0;
    const Store store = Store::Open(run_.folder(), Store::Mode::kReadOnly);
    for (const auto& [episode, verdicts] : store.CurrentVerdicts()) {
      for (const auto& [judge, verdict] : verdicts) count += judge.ends_with(":small") ? 1 : 0;
    }
    return count;
  }

  std::atomic<int> asked_ = 0, ctrl_c_at_ = 0;  ///< somebody presses it while that request is answered; 0: nobody does
  StoredRun run_{"run", "s", "f", 24};
  ScriptedServer server_{[this](const SeenRequest& request) {
    if (++asked_ == ctrl_c_at_) ::raise(SIGINT);
    return Cramped(request);
  }};
  std::filesystem::path page_ = run_.folder().parent_path() / "page.yaml";
};

TEST_F(ASmallServer, IsAskedOnceAboutEachEpisodeAndNotAnewAtEveryCall) {
  EXPECT_THAT(Judge(false, true), HasSubstr("2 clips, 8 requests"));
  EXPECT_THAT(Judge(), HasSubstr("2 rated (2 failure), 0 had a verdict already"));
  EXPECT_EQ(Verdicts(), 4u) << "two episodes, each with its probe";
  const std::size_t asked = server_.Seen().size();
  EXPECT_THAT(Judge(false, true), HasSubstr("0 clips, 0 requests"));
  const std::string second = Judge();
  EXPECT_THAT(second, HasSubstr("0 rated, 2 had a verdict already"));
  EXPECT_THAT(second, HasSubstr(":flip: 0 rated, 2 had a verdict already"));
  EXPECT_EQ(server_.Seen().size(), asked + 2) << "only who it is and whether it sees";
}

/// In a log nothing was to be read for hours.
TEST_F(ASmallServer, SaysHowFarItIsWhereNobodyLooksOn) {
  testing::internal::CaptureStderr();
  Judge();
  const std::string said = testing::internal::GetCapturedStderr();
  EXPECT_THAT(said, testing::ContainsRegex("2 of 2 episodes judged by vlm:gloomy-[0-9a-f]*, "));
  EXPECT_THAT(said, testing::ContainsRegex("2 of 2 episodes judged by vlm:gloomy-[0-9a-f]*:flip, "));
}

/// The first Ctrl-C killed the command in mid-answer, and said nothing.
TEST_F(ASmallServer, AtTheFirstCtrlCWhatIsJudgedStaysAndTheSameCommandGoesOn) {
  ::signal(SIGINT, SIG_DFL);  // as on a terminal, whatever the caller of the tests ignores
  ctrl_c_at_ = 8;  // who it is, whether it sees, three refused wordings; the last small one about the first episode
  try {
    Judge();
    ADD_FAILURE() << "it was interrupted";
  } catch (const Error& error) {
    EXPECT_THAT(testing::internal::GetCapturedStdout(), HasSubstr("1 rated (1 failure)"));
    EXPECT_EQ(error.exit_code(), ExitCode::kInternal);
    EXPECT_THAT(error.what(), testing::AllOf(HasSubstr("interrupted"),
                                             HasSubstr("what was judged is stored; the same command goes on")));
  }
  EXPECT_EQ(Verdicts(), 1u);
  EXPECT_EQ(asked_.load(), 8) << "nothing more is sent";
  EXPECT_THAT(Judge(), HasSubstr("1 rated (1 failure), 1 had a verdict already"));
  EXPECT_EQ(Verdicts(), 4u);
}

TEST_F(ASmallServer, WhatARetestWouldTakeIsSaidBefore) {
  EXPECT_THAT(Judge(false, true, true), HasSubstr("2 clips, 14 requests"));
  Judge();
  EXPECT_THAT(Judge(false, true, true), HasSubstr("2 clips, 6 requests")) << "the judge itself has been asked";
  Judge(false, false, true);
  EXPECT_THAT(Judge(false, true, true), HasSubstr("0 clips, 0 requests"));
}

TEST_F(ASmallServer, WhoseAnswersAloneCostSomethingHasItsPriceSaidBefore) {
  std::ofstream(page_, std::ios::app) << "budget: {usd_per_million_completion_tokens: 10}\n";
  EXPECT_THAT(Judge(false, true), HasSubstr("about 0.02 USD")) << "8 requests of 250 tokens";
}

/// Each call of the command had the whole budget anew.
TEST_F(ASmallServer, ABudgetIsForTheRunHoweverOftenTheCommandIsCalled) {
  std::ofstream(page_, std::ios::app) << "budget: {max_requests: 9}\n";
  const auto over = testing::ThrowsMessage<Error>(testing::AllOf(
      HasSubstr("the budget is spent: "), HasSubstr("requests were sent, as many as may be"),
      HasSubstr("what was judged is stored; the same command with a larger budget goes on")));
  const auto judge = [&] {
    try {
      Judge();
    } catch (const Error&) {
      testing::internal::GetCapturedStdout();
      throw;
    }
  };
  EXPECT_THAT(judge, over) << "one for whether it sees, six about the first episode, two about the second";
  const std::size_t asked = server_.Seen().size();
  EXPECT_EQ(asked, 10u) << "and who it is";
  EXPECT_THAT(judge, over) << "eight are spent, and one for whether it sees";
  EXPECT_THAT(judge, over);
  EXPECT_EQ(server_.Seen().size(), asked + 4) << "who it is and whether it sees, each time";
}

/// What was paid for already was counted again, and named a price.
TEST_F(ASmallServer, WhatTheCacheAnswersIsNoRequestThatIsStillToCome) {
  std::ofstream(page_, std::ios::app) << "clip: {frames: 6, tail_frames: 0, long_side_px: 64}\n";
  EXPECT_THAT(Judge(false, true), HasSubstr("2 clips, 8 requests"));
  EXPECT_FALSE(std::filesystem::exists(run_.folder() / "judge_calls.sqlite")) << "who only asks makes no file";
  Judge();
  const std::size_t asked = server_.Seen().size();
  EXPECT_THAT(Judge(true, true), HasSubstr("0 clips, 0 requests"));
  EXPECT_THAT(Judge(true, true, true), HasSubstr("2 clips, 6 requests")) << "a retest goes past the cache";
  EXPECT_EQ(server_.Seen().size(), asked);
  Judge(true);
  EXPECT_EQ(server_.Seen().size(), asked + 2) << "and so it is: only who it is and whether it sees";
}

TEST_F(ASmallServer, IsAskedAnewWhereThatIsWanted) {
  Judge();
  EXPECT_THAT(Judge(true, true), HasSubstr("2 clips, 8 requests"));
  EXPECT_THAT(Judge(true), HasSubstr("2 rated (2 failure), 0 had a verdict already"));
}

}  // namespace
}  // namespace evac
