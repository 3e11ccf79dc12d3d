#pragma once

#include <map>
#include <optional>
#include <string>
#include <vector>

#include "core/types.h"

namespace evac {

/// What one request to a vision-language model came to. Only the first two are verdicts that a rate counts; none of the
/// others is ever a failure (docs/vlm_judge.md).
enum class VlmOutcome {
  kSuccess,
  kFailure,
  kCannotTell,
  kRefused,     ///< the model would not answer
  kParseError,  ///< it answered, but not with a verdict, also when asked again
  kTruncated,   ///< the answer was cut, or the server dropped images without saying so
  kTimeout,
  kHttpError,
  kUnsupportedMedia,  ///< the server takes no such images, or not as many
};
/// "success", "parse_error", …
const char* Name(VlmOutcome outcome);
/// Success, failure and cannot_tell as themselves; everything else is `invalid`.
Label LabelOf(VlmOutcome outcome);

struct VlmAnswer {
  VlmOutcome outcome = VlmOutcome::kParseError;
  std::string observations;              ///< what it saw, or what went wrong
  double confidence = 0;                 ///< of its verdict, in [0, 1]
  std::map<std::string, bool> stages{};  ///< stage → clearly reached; those it was unsure of are false
  std::vector<int> evidence_frames{};    ///< of those it was shown
};

/// What was asked for: an answer about anything else is none.
struct VlmQuestion {
  std::vector<std::string> stages;  ///< names
  std::vector<int> frames;          ///< numbers of the frames shown
  bool asks_for_failure = false;    ///< the flip probe: "did it fail?"; verdicts come back in plain sense either way
};

/// The text that the model wrote, without byte order mark and <think> blocks: strictly read, else its first balanced
/// object. Nothing is guessed from prose.
/// @returns kParseError with the reason if there is no object with a verdict in it.
VlmAnswer ParseVerdictText(const std::string& text, const VlmQuestion& question);

/// One chat completion.
struct VlmCompletion {
  std::optional<VlmOutcome> trouble;  ///< refused, truncated (cut at max_tokens), http_error ({"error": …} or no JSON)
  std::string message;                ///< of the trouble
  std::string text;                   ///< what the model wrote; of its reasoning where the content is empty
  std::optional<long> prompt_tokens, completion_tokens;  ///< as the server counted them, if it did
};
/// @param body  of an answer with status 200; any bytes.
VlmCompletion ParseCompletion(const std::string& body);

}  // namespace evac
