#include "judges/vlm_reply.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cctype>
#include <nlohmann/json.hpp>
#include <utility>

#include "core/error.h"
#include "judges/json_text.h"

namespace evac {
namespace {

using nlohmann::json;

VlmAnswer NoVerdict(const std::string& why) { return {.outcome = VlmOutcome::kParseError, .observations = why}; }

std::string Lower(std::string text) {
  std::erase_if(text, [](unsigned char c) { return std::isspace(c) || c == '.' || c == '!'; });
  std::transform(text.begin(), text.end(), text.begin(), [](unsigned char c) { return std::tolower(c); });
  return text;
}

/// The closed table of what counts as a verdict's name.
std::optional<VlmOutcome> OutcomeNamed(const json& verdict) {
  if (verdict.is_boolean()) return verdict.get<bool>() ? VlmOutcome::kSuccess : VlmOutcome::kFailure;
  if (!verdict.is_string()) return std::nullopt;
  const std::string name = Lower(verdict.get<std::string>());
  for (const char* alias : {"success", "succeeded", "successful"})
    if (name == alias) return VlmOutcome::kSuccess;
  for (const char* alias : {"failure", "failed", "fail", "unsuccessful"})
    if (name == alias) return VlmOutcome::kFailure;
  for (const char* alias : {"cannot_tell", "cannottell", "can'ttell", "unclear", "unsure"})
    if (name == alias) return VlmOutcome::kCannotTell;
  return std::nullopt;
}

/// A bare `true` answers the question that was asked; a word says what it says.
VlmOutcome InPlainSense(VlmOutcome outcome, const json& verdict, const VlmQuestion& question) {
  if (!question.asks_for_failure || !verdict.is_boolean()) return outcome;
  return outcome == VlmOutcome::kSuccess ? VlmOutcome::kFailure : VlmOutcome::kSuccess;
}

void TakeStages(const json& object, const VlmQuestion& question, VlmAnswer& answer) {
  for (const json& stage : object.at("stages")) {
    const std::string id = stage.at("id").get<std::string>(), reached = stage.at("reached").get<std::string>();
    if (std::find(question.stages.begin(), question.stages.end(), id) == question.stages.end())
      throw InvalidInput("stages names '{}', which the rubric does not have", id);
    if (reached != "yes" && reached != "no" && reached != "unclear")
      throw InvalidInput("stage {} was reached '{}', wanted yes, no or unclear", id, reached);
    answer.stages[id] = reached == "yes";
  }
}

void TakeEvidence(const json& object, const VlmQuestion& question, VlmAnswer& answer) {
  for (const json& number : object.at("evidence_frames")) {
    const int frame = number.get<int>();
    if (std::find(question.frames.begin(), question.frames.end(), frame) == question.frames.end())
      throw InvalidInput("evidence_frames names frame {}, which was not shown", frame);
    answer.evidence_frames.push_back(frame);
  }
}

/// The schema of the request, checked here: many servers take it and do not keep it.
VlmAnswer CheckedAnswer(const json& object, const VlmQuestion& question) try {
  VlmAnswer answer;
  const json& verdict = object.at("verdict");
  const std::optional<VlmOutcome> outcome = OutcomeNamed(verdict);
  if (!outcome) return NoVerdict("verdict is " + verdict.dump(-1, ' ', true, json::error_handler_t::replace));
  answer.outcome = InPlainSense(*outcome, verdict, question);
  answer.observations = object.at("observations").get<std::string>();
  answer.confidence = object.at("confidence").get<double>();
  if (!(answer.confidence >= 0 && answer.confidence <= 1))
    return NoVerdict(fmt::format("confidence is {}, wanted 0 … 1", answer.confidence));
  TakeStages(object, question, answer);
  TakeEvidence(object, question, answer);
  return answer;
} catch (const json::exception& error) {
  return NoVerdict(error.what());
} catch (const Error& error) {
  return NoVerdict(error.what());
}

/// A completion's message: text, parts of text, or, where both are empty, what it thought aloud.
std::string TextOf(const json& message) {
  const json content = message.value("content", json());
  std::string text;
  if (content.is_string()) text = content.get<std::string>();
  if (content.is_array()) {
    for (const json& part : content) {
      if (part.is_object()) text += part.value("text", "");
    }
  }
  if (text.find_first_not_of(" \t\r\n") != std::string::npos) return text;
  for (const char* key : {"reasoning_content", "reasoning"}) {
    if (message.contains(key) && message[key].is_string()) return message[key].get<std::string>();
  }
  return "";
}

VlmCompletion Trouble(VlmOutcome outcome, std::string message) {
  VlmCompletion completion;
  completion.trouble = outcome;
  completion.message = std::move(message);
  return completion;
}

std::optional<long> Tokens(const json& reply, const char* key) {
  const json usage = reply.value("usage", json());
  if (!usage.is_object() || !usage.contains(key) || !usage[key].is_number_integer()) return std::nullopt;
  return usage[key].get<long>();
}

VlmCompletion CompletionOf(const json& reply) {
  if (!reply.is_object()) return Trouble(VlmOutcome::kHttpError, "the answer is no JSON object");
  if (reply.contains("error") && !reply["error"].is_null())
    return Trouble(VlmOutcome::kHttpError, "the answer holds an error: " + Excerpt(reply["error"].dump()));
  const json choices = reply.value("choices", json());
  if (!choices.is_array() || choices.empty()) return Trouble(VlmOutcome::kRefused, "the answer has no choices");
  const json message = choices[0].value("message", json::object());
  const json reason = choices[0].value("finish_reason", json());
  VlmCompletion completion;
  if (message.contains("refusal") && message["refusal"].is_string()) {
    completion = Trouble(VlmOutcome::kRefused, "refused: " + Excerpt(message["refusal"].get<std::string>()));
  } else if (reason == "content_filter") {
    completion = Trouble(VlmOutcome::kRefused, "stopped by the server's content filter");
  } else if (reason == "length") {
    completion = Trouble(VlmOutcome::kTruncated, "cut at max_tokens");
  } else {
    completion.text = TextOf(message);
    if (completion.text.empty()) completion = Trouble(VlmOutcome::kRefused, "the answer is empty");
  }
  completion.prompt_tokens = Tokens(reply, "prompt_tokens");
  completion.completion_tokens = Tokens(reply, "completion_tokens");
  return completion;
}

}  // namespace

const char* Name(VlmOutcome outcome) {
  constexpr std::array kNames = {"success",   "failure", "cannot_tell", "refused",          "parse_error",
                                 "truncated", "timeout", "http_error",  "unsupported_media"};
  return kNames.at(static_cast<std::size_t>(outcome));
}

Label LabelOf(VlmOutcome outcome) {
  if (outcome == VlmOutcome::kSuccess) return Label::kSuccess;
  if (outcome == VlmOutcome::kFailure) return Label::kFailure;
  return outcome == VlmOutcome::kCannotTell ? Label::kCannotTell : Label::kInvalid;
}

VlmAnswer ParseVerdictText(const std::string& text, const VlmQuestion& question) {
  const std::string plain = WithoutThinking(text);
  std::optional<json> object = ParseJson(plain);
  if (!object) {
    const std::optional<std::string> first = FirstBalancedObject(plain);
    if (!first) return NoVerdict("no JSON object in: " + Excerpt(plain));
    object = ParseJson(*first);
  }
  if (!object || !object->is_object()) return NoVerdict("no JSON object in: " + Excerpt(plain));
  return CheckedAnswer(*object, question);
}

VlmCompletion ParseCompletion(const std::string& body) try {
  const std::optional<json> reply = ParseJson(body);
  if (!reply) return Trouble(VlmOutcome::kHttpError, "the answer is no JSON: " + Excerpt(body));
  return CompletionOf(*reply);
} catch (const json::exception& error) {
  return Trouble(VlmOutcome::kHttpError, std::string("the answer is no chat completion: ") + error.what());
}

}  // namespace evac
