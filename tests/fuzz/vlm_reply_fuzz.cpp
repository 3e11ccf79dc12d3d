#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <string>

#include "judges/vlm_reply.h"

/// Whatever a model server sends: a completion or its trouble; whatever a model writes: a verdict that keeps to the
/// question, or none.
namespace {

void Require(bool holds) {
  if (!holds) std::abort();
}

void Check(const evac::VlmAnswer& answer, const evac::VlmQuestion& question) {
  if (answer.outcome == evac::VlmOutcome::kParseError) return Require(!answer.observations.empty());
  Require(evac::LabelOf(answer.outcome) != evac::Label::kInvalid);
  Require(answer.confidence >= 0 && answer.confidence <= 1);
  for (const int frame : answer.evidence_frames)
    Require(std::count(question.frames.begin(), question.frames.end(), frame) == 1);
  for (const auto& [stage, reached] : answer.stages)
    Require(std::count(question.stages.begin(), question.stages.end(), stage) == 1);
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const std::string bytes(reinterpret_cast<const char*>(data), size);
  const evac::VlmQuestion question{.stages = {"grasp", "lift"}, .frames = {0, 5, 10}};
  Check(evac::ParseVerdictText(bytes, question), question);
  const evac::VlmCompletion completion = evac::ParseCompletion(bytes);
  if (completion.trouble) return Require(!completion.message.empty()), 0;
  Require(!completion.text.empty());
  Check(evac::ParseVerdictText(completion.text, question), question);
  return 0;
}
