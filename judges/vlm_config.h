#pragma once

#include <filesystem>
#include <string>

#include "judges/vlm_client.h"
#include "judges/vlm_clip.h"
#include "judges/vlm_prompt.h"

namespace evac {

/// A model server and how it is asked: one YAML page (docs/vlm_judge.md).
struct VlmConfig {
  std::string name;                  ///< "qwen3-vl": letters, digits, - _ .
  std::string base_url{};            ///< of an OpenAI-compatible server, with its /v1
  std::string key_env{};             ///< the environment variable that holds the key, or
  std::filesystem::path key_file{};  ///< the file; both empty: the server wants none
  VlmSampling sampling{};
  VlmClipOptions clip{};
  double probe_share = 0.1;  ///< of episodes that are asked the flipped question as well
  HttpLimits limits{};
  VlmBudget budget{};

  /// @throws InvalidInput naming file and field: one that is not known, out of range, or a budget or price below 0.
  static VlmConfig FromFile(const std::filesystem::path& path);

  /// "vlm:qwen3-vl-1a2b3c4d": the digits are of all that decides an answer, where the server stands excepted.
  std::string JudgeName() const;
  /// @throws InvalidInput if the variable is not set or the file cannot be read. Never printed, never stored.
  std::string Key() const;
};

/// Of prompts and parser: another number asks everything anew.
inline constexpr int kVlmVersion = 1;

}  // namespace evac
