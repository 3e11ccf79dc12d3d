#include <fmt/format.h>
#include <gmock/gmock.h>

#include <atomic>
#include <fstream>
#include <nlohmann/json.hpp>

#include "core/file.h"
#include "judges/vlm_prompt.h"
#include "tests/support/scripted_server.h"
#include "tests/support/temp_folder.h"
#include "tests/system/run_support.h"

namespace evac {
namespace {

using nlohmann::json;
using system_test::kFaults;
using system_test::List;
using system_test::RunWords;
using testing::HasSubstr;
using testing::Not;

const std::string kKey = "sk-nobody-may-read-this";

ScriptedAnswer Saying(const json& content) {
  return Answer(200, json{{"choices", {{{"message", {{"content", content.dump()}}}, {"finish_reason", "stop"}}}},
                          {"usage", {{"prompt_tokens", 3200}, {"completion_tokens", 80}}}}
                         .dump());
}

/// A model server that sees, and to which every clip is a failure.
ScriptedAnswer Gloomy(const SeenRequest& request) {
  if (request.headers.at("authorization") != "Bearer " + kKey)
    return Answer(401, R"({"error": {"message": "wrong key"}})");
  if (request.path == "/v1/models") return Answer(200, R"({"data": [{"id": "gloom", "root": "org/gloom"}]})");
  const json asked = json::parse(request.body);
  if (asked["response_format"]["json_schema"]["name"] == "numbers")
    return Saying({{"numbers", MakeSightTest({.model = "gloom"}).numbers}});
  return Saying({{"observations", "nothing moves"},
                 {"stages", json::array()},
                 {"verdict", "failure"},
                 {"confidence", 0.9},
                 {"evidence_frames", {0}},
                 {"artefacts", {"none"}}});
}

class VlmCommand : public testing::Test {
 protected:
  void SetUp() override {
    ASSERT_EQ(RunCommand(RunWords(kFaults, run_, {"initial_states.count=2", "judges=[oracle]"})).exit_code, 0);
    ::setenv("EVAC_TEST_VLM_KEY", kKey.c_str(), 1);
  }

  CommandResult Judge(const std::string& url, const std::vector<std::string>& more = {}) {
    const std::filesystem::path page = folder_ / "page.yaml";
    std::ofstream(page) << fmt::format(
        "name: gloomy\nbase_url: {}/v1\nmodel: gloom\nkey: {{env: EVAC_TEST_VLM_KEY}}\nprobe_share: 1\n", url);
    std::vector<std::string> words = {Binary("evac"), "judge",    run_.string(), "--judge",
                                      "vlm",          "--config", page.string()};
    words.insert(words.end(), more.begin(), more.end());
    return RunCommand(words);
  }

  TempFolder folder_;
  std::filesystem::path run_ = folder_ / "run";
};

TEST_F(VlmCommand, JudgesEveryEpisodeOnceAndKeepsTheKeyToItself) {
  auto server = std::make_unique<ScriptedServer>(Gloomy);
  const std::string url = server->Url();
  const CommandResult planned = Judge(url, {"--dry-run"});
  EXPECT_EQ(planned.exit_code, 0) << planned.err;
  EXPECT_THAT(planned.out, HasSubstr("2 clips, 8 requests, about"));
  EXPECT_TRUE(server->Seen().empty());

  const CommandResult judged = Judge(url);
  EXPECT_EQ(judged.exit_code, 0) << judged.err;
  EXPECT_THAT(judged.out,
              AllOf(HasSubstr("2 rated (2 failure)"), HasSubstr(":flip: 2 rated"), HasSubstr("9 requests")));
  const std::size_t asked = server->Seen().size();
  for (const json& episode : json::parse(List(run_))) {
    int verdicts = 0;
    for (const auto& [judge, label] : episode["verdicts"].items())
      verdicts += judge.starts_with("vlm:gloomy-") && label == "failure";
    EXPECT_EQ(verdicts, 2) << episode;
  }

  EXPECT_THAT(Judge(url).out, HasSubstr("0 rated, 2 had a verdict already"));
  EXPECT_EQ(server->Seen().size(), asked + 2) << "only who it is and whether it sees";
  server.reset();
  EXPECT_THAT(Judge(url, {"--offline", "--again"}).out, HasSubstr("2 rated (2 failure)"));

  for (const auto& entry : std::filesystem::recursive_directory_iterator(run_)) {
    if (entry.is_regular_file()) {
      EXPECT_THAT(ReadFile(entry.path()), Not(HasSubstr(kKey))) << entry.path();
    }
  }
  EXPECT_THAT(judged.out + judged.err, Not(HasSubstr(kKey)));
}

TEST_F(VlmCommand, AWrongKeyOrAServerWithoutEyesIsToldAtOnce) {
  const ScriptedServer server(Gloomy);
  ::setenv("EVAC_TEST_VLM_KEY", "another", 1);
  const CommandResult refused = Judge(server.Url());
  EXPECT_EQ(refused.exit_code, 2);
  EXPECT_THAT(refused.err, AllOf(HasSubstr("401"), HasSubstr("wrong key")));
  ::unsetenv("EVAC_TEST_VLM_KEY");
  EXPECT_THAT(Judge(server.Url()).err, HasSubstr("EVAC_TEST_VLM_KEY is not set"));

  ::setenv("EVAC_TEST_VLM_KEY", kKey.c_str(), 1);
  const ScriptedServer blind([](const SeenRequest& request) {
    return request.path == "/v1/models" ? Answer(404, "") : Saying({{"numbers", {1, 2, 3}}});
  });
  const CommandResult unseen = Judge(blind.Url());
  EXPECT_EQ(unseen.exit_code, 2);
  EXPECT_THAT(unseen.err, HasSubstr("does not see the images"));
  EXPECT_THAT(List(run_), Not(HasSubstr("vlm:")));
}

TEST_F(VlmCommand, AServerThatGivesOutEndsItWithCodeFourAndTheSameCommandGoesOn) {
  std::atomic<int> asked = 0;
  const ScriptedServer moody([&](const SeenRequest& request) {
    return ++asked > 8 && asked <= 12 ? Answer(403, R"({"error": {"message": "no credit left"}})") : Gloomy(request);
  });
  const CommandResult cut = Judge(moody.Url());
  EXPECT_EQ(cut.exit_code, 4) << cut.out;
  EXPECT_THAT(cut.err, AllOf(HasSubstr("no credit left"), HasSubstr("the same command goes on")));
  asked = 100;
  const CommandResult whole = Judge(moody.Url());
  EXPECT_EQ(whole.exit_code, 0) << whole.err;
}

TEST_F(VlmCommand, CalibrateSaysThatTwoEpisodesAreTooFew) {
  const ScriptedServer server(Gloomy);
  ASSERT_EQ(Judge(server.Url()).exit_code, 0);
  const CommandResult result =
      RunCommand({Binary("evac"), "judge", "calibrate", run_.string(), "--judge", "vlm", "--json"});  // not its probe
  EXPECT_EQ(result.exit_code, 3) << result.err;
  const json report = json::parse(result.out);
  EXPECT_EQ(report["rows"][0]["both_failure"], 2);
  EXPECT_EQ(report["probes"]["flip"]["same"], 2);
  EXPECT_FALSE(report["accepted"]);
}

}  // namespace
}  // namespace evac
