#include "judges/vlm_judge.h"

#include <fmt/format.h>

#include <algorithm>
#include <atomic>
#include <cctype>
#include <chrono>
#include <cmath>
#include <future>
#include <iterator>

#include "core/error.h"
#include "core/hash.h"
#include "judges/json_text.h"

namespace evac {
namespace {

using nlohmann::json;
using Clock = std::chrono::steady_clock;

constexpr long kFewestTokensPerFrame = 60;
constexpr double kFewestOfEstimate = 0.75;  // of patches of 28 px; some models' have 32
constexpr const char* kNoAnswer = "no answer in the cache";
constexpr VlmClipOptions kSmall{.frames = 8, .tail_frames = 0, .long_side_px = 336};

/// What a server says of a request that holds more than it takes, in capitals or not. vLLM: "At most 8 image(s) may be
/// provided in one prompt."
bool IsAboutSize(std::string message) {
  for (char& c : message) c = static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
  for (const char* words : {"context length", "context window", "maximum context", "too many images", "too large",
                            "at most", "limit-mm-per-prompt", "status 413"}) {
    if (message.find(words) != std::string::npos) return true;
  }
  return false;
}

VlmAnswer Troubled(VlmOutcome outcome, const std::string& message) {
  return {.outcome = outcome, .observations = message};
}

/// A server that counts far too few prompt tokens has thrown pictures away and said nothing. Small pictures cost few.
bool HasLostImages(const VlmCompletion& completion, const std::vector<VlmFrame>& frames) {
  const long of_estimate = std::lround(kFewestOfEstimate * static_cast<double>(EstimatedTokens(frames)));
  const long fewest = std::min(kFewestTokensPerFrame * static_cast<long>(frames.size()), of_estimate);
  return completion.prompt_tokens && *completion.prompt_tokens < fewest;
}

/// What a server is shown that takes no more: in nothing more than what it refused.
VlmClipOptions Smaller(const VlmClipOptions& refused) {
  return {.frames = std::min(kSmall.frames, refused.frames),
          .tail_frames = kSmall.tail_frames,
          .long_side_px = std::min(kSmall.long_side_px, refused.long_side_px),
          .jpeg_quality = std::min(kSmall.jpeg_quality, refused.jpeg_quality)};
}

/// Of a call, in the cache: all that decides the answer.
std::string KeyOf(const json& request, const VlmJudgeOptions& options) {
  return Sha256Hex(fmt::format("{}\n{}\n{}\n{}", kVlmVersion, options.fingerprint,
                               options.probe == VlmProbe::kRetest ? "again" : "", request.dump()));
}

std::vector<VlmWording> WordingsOf(VlmProbe probe) {
  if (probe == VlmProbe::kFlip) return {VlmWording::kFlipped};
  return {std::begin(kVlmWordings), std::end(kVlmWordings)};
}

std::size_t Bytes(const std::vector<VlmFrame>& frames) {
  std::size_t bytes = 0;
  for (const VlmFrame& frame : frames) bytes += frame.jpeg.size();
  return bytes;
}

bool IsLess(const std::vector<VlmFrame>& frames, const std::vector<VlmFrame>& than) {
  return frames.size() < than.size() || EstimatedTokens(frames) < EstimatedTokens(than) || Bytes(frames) < Bytes(than);
}

bool Agree(const std::vector<VlmAnswer>& answers) {
  return std::all_of(answers.begin(), answers.end(), [&](const VlmAnswer& answer) {
    return answer.outcome == answers.front().outcome && !answer.evidence_frames.empty();
  });
}

double ProbabilityOfSuccess(const std::vector<VlmAnswer>& answers) {
  double sum = 0;
  for (const VlmAnswer& answer : answers) {
    if (answer.outcome == VlmOutcome::kSuccess) sum += 0.5 + answer.confidence / 2;
    if (answer.outcome == VlmOutcome::kFailure) sum += 0.5 - answer.confidence / 2;
    if (answer.outcome == VlmOutcome::kCannotTell) sum += 0.5;
  }
  return sum / static_cast<double>(answers.size());
}

std::string VotesSentence(const std::vector<VlmAnswer>& answers) {
  std::string text;
  for (const VlmAnswer& answer : answers) {
    text += fmt::format("{}{}", text.empty() ? "" : ", ", Name(answer.outcome));
    if (answer.evidence_frames.empty()) text += " without a frame";
  }
  return text;
}

}  // namespace

/// What all wordings of one episode share.
struct VlmJudge::Clip {
  const Task& task;
  std::vector<VlmFrame> frames;
  mutable std::atomic<bool> is_too_large = false;  ///< the server said so
};

Verdict VerdictOf(const std::vector<VlmAnswer>& answers) {
  Verdict verdict;
  for (const VlmAnswer& answer : answers) {
    if (LabelOf(answer.outcome) != Label::kInvalid) continue;
    verdict.label = Label::kInvalid;
    verdict.reason = fmt::format("{}: {}", Name(answer.outcome), answer.observations);
    return verdict;
  }
  verdict.label = Agree(answers) ? LabelOf(answers.front().outcome) : Label::kCannotTell;
  verdict.probability = ProbabilityOfSuccess(answers);
  verdict.reason =
      Agree(answers) ? answers.front().observations
                     : fmt::format("its answers differ ({}): {}", VotesSentence(answers), answers.front().observations);
  for (const VlmAnswer& answer : answers) {
    for (const auto& [stage, reached] : answer.stages) {
      const auto [entry, is_new] = verdict.stages.try_emplace(stage, reached);
      entry->second = entry->second && reached;
    }
  }
  return verdict;
}

VlmJudge::VlmJudge(const VlmConfig& config, VlmJudgeOptions options, VlmClient& client, CallCache& cache)
    : config_(config), options_(std::move(options)), client_(client), cache_(cache) {}

std::string VlmJudge::Name() const {
  const char* suffix = options_.probe == VlmProbe::kFlip     ? ":flip"
                       : options_.probe == VlmProbe::kRetest ? ":retest"
                                                             : "";
  return config_.JudgeName() + suffix;
}

Verdict VlmJudge::Rate(const Task& task, const Episode& episode) {
  if (episode.video.empty()) throw InvalidInput("{}: it has no clip", episode.key.Id()).Called("not_judged");
  std::string name = Name();
  const std::filesystem::path video = options_.run_folder / episode.video;
  std::vector<VlmAnswer> answers;
  const Clip clip{task, ReadVlmFrames(video, task, config_.clip)};
  if (options_.offline && UnansweredOf(task, clip.frames, config_, options_, &cache_) > 0) {
    clip.is_too_large = true;  // perhaps: of a request that was refused the cache knows no answer
  } else {
    answers = AllWordings(clip);
  }
  if (clip.is_too_large) {
    const Clip small{task, ReadVlmFrames(video, task, Smaller(config_.clip))};
    if (IsLess(small.frames, clip.frames)) {
      answers = AllWordings(small);
      name += kVlmSmall;
    }
  }
  if (answers.empty()) throw InvalidInput(kNoAnswer).Called("not_judged");
  Verdict verdict = VerdictOf(answers);
  verdict.episode_id = episode.key.Id();
  verdict.judge = name;
  verdict.rubric_version = task.rubric.version;
  return verdict;
}

/// Side by side: a server answers several at once sooner than one after another.
std::vector<VlmAnswer> VlmJudge::AllWordings(const Clip& clip) {
  std::vector<std::future<VlmAnswer>> asked;
  for (const VlmWording wording : WordingsOf(options_.probe))
    asked.push_back(std::async(std::launch::async, [this, &clip, wording] { return AnswerOf(clip, wording); }));
  for (const auto& answer : asked) answer.wait();
  std::vector<VlmAnswer> answers;
  for (auto& answer : asked) answers.push_back(answer.get());
  return answers;
}

VlmAnswer VlmJudge::AnswerOf(const Clip& clip, VlmWording wording) {
  const json request = VlmRequest(clip.task, clip.frames, wording, config_.sampling);
  JudgeCall call{.key = KeyOf(request, options_), .judge = Name(), .attempts = 0};
  if (const auto known = cache_.Find(call.key))
    return ParseVerdictText(known->response, QuestionOf(clip.task, clip.frames, wording));
  if (options_.offline) throw InvalidInput(kNoAnswer).Called("not_judged");
  const auto before = Clock::now();
  const VlmAnswer answer = Asked(clip, wording, call);
  call.latency_ms = std::chrono::duration_cast<std::chrono::milliseconds>(Clock::now() - before).count();
  call.created_at = options_.now();
  if (call.attempts > 0) cache_.Add(call);  // what was never sent is no call
  if (const auto why = client_.WhyOver(); why && LabelOf(answer.outcome) == Label::kInvalid)
    throw InternalError("{}", *why).Called("judge_over");
  return answer;
}

/// Asks, again with more room if the answer was cut, and once more for JSON alone if it was none.
/// Fills in what came and what all of it took, for the cache.
VlmAnswer VlmJudge::Asked(const Clip& clip, VlmWording wording, JudgeCall& call) {
  const json request = VlmRequest(clip.task, clip.frames, wording, config_.sampling);
  const VlmQuestion question = QuestionOf(clip.task, clip.frames, wording);
  VlmSaid said = AskWhole(request, call);
  if (said.trouble) {
    call.response = said.message;
    call.status = evac::Name(*said.trouble);
    if (!said.was_rejected) return Troubled(*said.trouble, said.message);
    if (IsAboutSize(said.message)) clip.is_too_large = true;
    return Troubled(VlmOutcome::kUnsupportedMedia, said.message);
  }
  if (HasLostImages(said.completion, clip.frames)) {
    call.status = evac::Name(VlmOutcome::kTruncated);
    call.response = fmt::format("the server counted {} prompt tokens for {} images: it drops some of them",
                                *said.completion.prompt_tokens, clip.frames.size());
    return Troubled(VlmOutcome::kTruncated, call.response);
  }
  VlmAnswer answer = ParseVerdictText(said.completion.text, question);
  if (answer.outcome == VlmOutcome::kParseError) {
    const VlmSaid repaired = AskWhole(RepairRequest(request, said.completion.text, answer.observations), call);
    if (!repaired.trouble) {
      answer = ParseVerdictText(repaired.completion.text, question);
      said = repaired;
    }
  }
  call.response = said.completion.text;
  call.status = answer.outcome == VlmOutcome::kParseError ? evac::Name(answer.outcome) : "ok";
  return answer;
}

VlmSaid VlmJudge::AskWhole(const json& request, JudgeCall& call) {
  const auto ask = [&](const json& what) {
    VlmSaid said = client_.Ask(what);
    call.attempts += said.attempts;
    call.prompt_tokens += said.prompt_tokens;
    call.completion_tokens += said.completion_tokens;
    return said;
  };
  VlmSaid said = ask(request);
  if (said.trouble != VlmOutcome::kTruncated) return said;
  json longer = request;
  longer["max_tokens"] = 2 * request.at("max_tokens").get<int>();
  VlmSaid again = ask(longer);
  return again.attempts > 0 ? again : said;  // the budget may have ended between the two
}

long UnansweredOf(const Task& task, const std::vector<VlmFrame>& frames, const VlmConfig& config,
                  const VlmJudgeOptions& options, const CallCache* cache) {
  long unanswered = 0;
  for (const VlmWording wording : WordingsOf(options.probe))
    unanswered += !cache || !cache->Find(KeyOf(VlmRequest(task, frames, wording, config.sampling), options));
  return unanswered;
}

void CheckThatItSees(VlmClient& client, const VlmSampling& sampling) {
  const SightTest test = MakeSightTest(sampling);
  const VlmSaid said = client.Ask(test.request);
  if (said.trouble)
    throw InvalidInput("the model server did not answer three pictures: {}: {}", Name(*said.trouble), said.message);
  if (HasSeen(said.completion.text, test.numbers)) return;
  throw InvalidInput(
      "the model does not see the images: pictures of {}, {} and {} were answered with: {}\n"
      "      Some servers drop images without saying so (too short a context, a model without eyes)",
      test.numbers[0], test.numbers[1], test.numbers[2], Excerpt(said.completion.text));
}

}  // namespace evac
