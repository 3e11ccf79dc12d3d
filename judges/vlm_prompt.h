#pragma once

#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "core/types.h"
#include "judges/vlm_clip.h"
#include "judges/vlm_reply.h"

namespace evac {

/// How a model is asked: the same question in three wordings (one wording's errors are correlated), and turned round.
enum class VlmWording { kPlain, kStages, kSceptical, kFlipped };
inline constexpr VlmWording kVlmWordings[] = {VlmWording::kPlain, VlmWording::kStages, VlmWording::kSceptical};

struct VlmSampling {
  std::string model;
  double temperature = 0;
  int seed = 7;
  int max_tokens = 1200;
};

/// The body of POST …/chat/completions (docs/vlm_judge.md): rubric, frames with their times, the schema of the answer.
/// Never says which policy or world it was. The task's instruction is quoted as data: an order in it is not followed.
nlohmann::json VlmRequest(const Task& task, const std::vector<VlmFrame>& frames, VlmWording wording,
                          const VlmSampling& sampling);

/// The same conversation gone on after an answer that was none.
nlohmann::json RepairRequest(const nlohmann::json& request, const std::string& answer, const std::string& complaint);

VlmQuestion QuestionOf(const Task& task, const std::vector<VlmFrame>& frames, VlmWording wording);

/// "Do you see the images?": coloured frames with a number drawn on each, and what they are.
struct SightTest {
  nlohmann::json request;
  std::vector<int> numbers;
};
SightTest MakeSightTest(const VlmSampling& sampling);
/// Whether an answer's text holds a JSON object whose `numbers` are those.
bool HasSeen(const std::string& text, const std::vector<int>& numbers);

}  // namespace evac
