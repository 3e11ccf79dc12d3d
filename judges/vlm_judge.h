#pragma once

#include <filesystem>
#include <functional>
#include <string>
#include <vector>

#include "core/judge.h"
#include "core/store_calls.h"
#include "judges/vlm_client.h"
#include "judges/vlm_config.h"

namespace evac {

/// Behind the name of a judge that was shown fewer, smaller images, because the server takes no more; of a probe
/// ("NAME:flip:small") too.
inline constexpr const char* kVlmSmall = ":small";

/// Judges that are not the verdict of record but tell how far it can be trusted; each is a judge of its own name.
enum class VlmProbe {
  kNone,
  kFlip,    ///< "NAME:flip": asked whether the robot failed; a yes-sayer contradicts itself
  kRetest,  ///< "NAME:retest": the same question once more, past the cache
};

struct VlmJudgeOptions {
  std::filesystem::path run_folder{};
  VlmProbe probe = VlmProbe::kNone;
  bool offline = false;                ///< answers from the cache alone, else of small images; without any: left out
  std::string fingerprint{};           ///< of the server: VlmClient::Fingerprint
  std::function<std::string()> now{};  ///< ISO 8601, for the cache's history; must be given
};

/// A vision-language model behind an OpenAI-compatible server. Three wordings of one question, each answered in two
/// steps (what it sees, then the verdict); a verdict only where all agree and cite a frame, else cannot_tell. An error
/// of any wording is `invalid` with its class as the reason's first word, never a failure.
///
/// A server that finds the images too many or too large is asked with 8 frames of 336 px, or with fewer or smaller ones
/// where the page has such, if that is less than what it refused. The verdict is then given in the name "NAME:small":
/// another judge, whose verdict says all the same that the episode was asked about.
/// Rate throws an Error called `not_judged` (no clip, or nothing in the cache) or `judge_over` (VlmClient::WhyOver):
/// JudgeEpisodes stores nothing then.
class VlmJudge : public Judge {
 public:
  /// @param client, cache  outlive this.
  VlmJudge(const VlmConfig& config, VlmJudgeOptions options, VlmClient& client, CallCache& cache);

  std::string Name() const override;
  Verdict Rate(const Task& task, const Episode& episode) override;

 private:
  struct Clip;
  VlmAnswer AnswerOf(const Clip& clip, VlmWording wording);
  VlmAnswer Asked(const Clip& clip, VlmWording wording, JudgeCall& call);
  VlmSaid AskWhole(const nlohmann::json& request, JudgeCall& call);
  std::vector<VlmAnswer> AllWordings(const Clip& clip);

  VlmConfig config_;
  VlmJudgeOptions options_;
  VlmClient& client_;
  CallCache& cache_;
};

/// One verdict from the answers to all wordings.
/// @param answers  one or more; of the flip probe one
Verdict VerdictOf(const std::vector<VlmAnswer>& answers);

/// How many requests about these frames the cache has no answer to: what such a judge would send for them.
/// @param options  whose probe and fingerprint decide which answers are looked for
/// @param cache  null: there is none
long UnansweredOf(const Task& task, const std::vector<VlmFrame>& frames, const VlmConfig& config,
                  const VlmJudgeOptions& options, const CallCache* cache);

/// Sends coloured pictures with numbers and wants the numbers back: some servers drop images and answer all the same.
/// @throws InvalidInput if they do not come back.
void CheckThatItSees(VlmClient& client, const VlmSampling& sampling);

}  // namespace evac
