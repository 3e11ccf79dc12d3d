#include "judges/vlm_reply.h"

#include <gmock/gmock.h>

#include "judges/json_text.h"

namespace evac {
namespace {

const VlmQuestion kQuestion{.stages = {"grasp", "lift"}, .frames = {0, 5, 10}, .asks_for_failure = false};

std::string Verdict(const std::string& verdict, const std::string& confidence = "0.9",
                    const std::string& evidence = "[5]") {
  return R"({"observations": "it lifts {the} bottle", "stages": [{"id": "grasp", "reached": "yes"}, )"
         R"({"id": "lift", "reached": "unclear"}], "verdict": )" +
         verdict + R"(, "confidence": )" + confidence + R"(, "evidence_frames": )" + evidence +
         R"(, "artefacts": ["none"]})";
}

VlmOutcome OutcomeOf(const std::string& text) { return ParseVerdictText(text, kQuestion).outcome; }

TEST(VlmVerdictText, AStrictObjectIsReadWhole) {
  const VlmAnswer answer = ParseVerdictText(Verdict("\"success\""), kQuestion);
  EXPECT_EQ(answer.outcome, VlmOutcome::kSuccess);
  EXPECT_EQ(answer.observations, "it lifts {the} bottle");
  EXPECT_EQ(answer.confidence, 0.9);
  EXPECT_EQ(answer.evidence_frames, std::vector<int>{5});
  EXPECT_EQ(answer.stages, (std::map<std::string, bool>{{"grasp", true}, {"lift", false}}));
}

TEST(VlmVerdictText, AnObjectIsFoundInProseFencesMarksAndAfterThinking) {
  const std::string object = Verdict("\"failure\"");
  for (const std::string& text :
       {"Here is my verdict:\n" + object + "\nI hope it helps.", "```json\n" + object + "\n```",
        "\xEF\xBB\xBF" + object, "<think>{\"verdict\": \"success\"} or not?</think>\n" + object,
        "it must be {\"verdict\": \"success\"}</think>" + object, object + "\n" + Verdict("\"success\"")})
    EXPECT_EQ(OutcomeOf(text), VlmOutcome::kFailure) << text;
}

TEST(VlmVerdictText, WhatIsNoJsonIsAParseErrorAndNeverGuessed) {
  for (const std::string& text :
       {std::string("Yes, the robot succeeded."), std::string("success"), std::string(),
        "<think>" + Verdict("\"success\""), Verdict("\"success\"").substr(0, 60), Verdict("\"success\"", "NaN"),
        Verdict("'success'"), Verdict("\"success\"", "0.9", "[5,]"), std::string(5000, '{'),
        std::string(5000, '[') + std::string(5000, ']'), std::string("{\"verdict\": \"\xff\xfe\"}"),
        std::string("[1, 2]")})
    EXPECT_EQ(OutcomeOf(text), VlmOutcome::kParseError) << Excerpt(text);
}

TEST(VlmVerdictText, OnlyTheTableOfSynonymsIsUnderstood) {
  for (const char* word : {"\"Success.\"", "\"succeeded\"", "\"SUCCESSFUL\"", "true"})
    EXPECT_EQ(OutcomeOf(Verdict(word)), VlmOutcome::kSuccess) << word;
  for (const char* word : {"\"failed\"", "\"Fail!\"", "\"unsuccessful\"", "false"})
    EXPECT_EQ(OutcomeOf(Verdict(word)), VlmOutcome::kFailure) << word;
  for (const char* word : {"\"cannot tell\"", "\"unclear\"", "\"Unsure\""})
    EXPECT_EQ(OutcomeOf(Verdict(word)), VlmOutcome::kCannotTell) << word;
  for (const char* word : {"\"yes\"", "\"not a success\"", "1", "null", "[\"success\"]", "{\"is\": \"success\"}"})
    EXPECT_EQ(OutcomeOf(Verdict(word)), VlmOutcome::kParseError) << word;
}

TEST(VlmVerdictText, WhatTheSchemaForbidsIsAParseErrorThatSaysWhat) {
  const auto complaint = [](const std::string& text) { return ParseVerdictText(text, kQuestion).observations; };
  EXPECT_THAT(complaint(Verdict("\"success\"", "1.2")), testing::HasSubstr("confidence is 1.2"));
  EXPECT_THAT(complaint(Verdict("\"success\"", "0.9", "[7]")), testing::HasSubstr("frame 7, which was not shown"));
  EXPECT_THAT(complaint(R"({"verdict": "success"})"), testing::HasSubstr("observations"));
  std::string other_stage = Verdict("\"success\"");
  other_stage.replace(other_stage.find("grasp"), 5, "dance");
  EXPECT_THAT(complaint(other_stage), testing::HasSubstr("'dance', which the rubric does not have"));
}

TEST(VlmVerdictText, ABareTrueAnswersTheQuestionThatWasAsked) {
  VlmQuestion flipped = kQuestion;
  flipped.asks_for_failure = true;
  EXPECT_EQ(ParseVerdictText(Verdict("true"), flipped).outcome, VlmOutcome::kFailure);
  EXPECT_EQ(ParseVerdictText(Verdict("\"success\""), flipped).outcome, VlmOutcome::kSuccess);
}

std::string Completion(const std::string& message, const std::string& reason = "stop") {
  return R"({"choices": [{"message": )" + message + R"(, "finish_reason": ")" + reason +
         R"("}], "usage": {"prompt_tokens": 3200, "completion_tokens": 90}})";
}

TEST(VlmCompletion, TextIsTakenFromContentPartsOrReasoning) {
  for (const char* message :
       {R"({"content": "hello"})", R"({"content": [{"type": "text", "text": "hel"}, {"type": "text", "text": "lo"}]})",
        R"({"content": "", "reasoning_content": "hello"})", R"({"content": null, "reasoning": "hello"})"}) {
    const VlmCompletion completion = ParseCompletion(Completion(message));
    EXPECT_FALSE(completion.trouble) << message << completion.message;
    EXPECT_EQ(completion.text, "hello");
    EXPECT_EQ(completion.prompt_tokens, 3200);
    EXPECT_EQ(completion.completion_tokens, 90);
  }
}

TEST(VlmCompletion, RefusalsAreToldFromErrorsAndFromCutAnswers) {
  const auto trouble = [](const std::string& body) { return ParseCompletion(body).trouble; };
  EXPECT_EQ(trouble(Completion(R"({"refusal": "I cannot help", "content": null})")), VlmOutcome::kRefused);
  EXPECT_EQ(trouble(Completion(R"({"content": "{"})", "content_filter")), VlmOutcome::kRefused);
  EXPECT_EQ(trouble(Completion(R"({"content": null})")), VlmOutcome::kRefused);
  EXPECT_EQ(trouble(R"({"choices": []})"), VlmOutcome::kRefused);
  EXPECT_EQ(trouble(Completion(R"({"content": "{"})", "length")), VlmOutcome::kTruncated);
  EXPECT_EQ(trouble(R"({"error": {"message": "overloaded"}})"), VlmOutcome::kHttpError);
  EXPECT_EQ(trouble("<html>502 Bad Gateway</html>"), VlmOutcome::kHttpError);
  EXPECT_EQ(trouble(Completion("{\"content\": \"\xc3\x28\"}")), VlmOutcome::kHttpError) << "invalid UTF-8";
  for (const char* body :
       {"", "[]", "null", R"({"choices": 7})", R"({"choices": [7]})", R"({"choices": [{"message": []}]})"})
    EXPECT_TRUE(trouble(body)) << body;
}

}  // namespace
}  // namespace evac
