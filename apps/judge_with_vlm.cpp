#include "apps/judge_with_vlm.h"

#include <fmt/chrono.h>
#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <ctime>
#include <memory>
#include <thread>

#include "apps/interrupts.h"
#include "apps/judge_with_progress.h"
#include "core/file.h"
#include "core/seed.h"
#include "core/store_calls.h"
#include "judges/vlm_judge.h"

namespace evac {
namespace {

constexpr long kTextTokens = 700;  ///< of rubric, captions and question

std::string Now() { return fmt::format("{:%Y-%m-%dT%H:%M:%SZ}", fmt::gmtime(std::time(nullptr))); }

/// The same episodes every time, whatever else the run holds.
bool IsProbed(const Episode& episode, double share) {
  return SplitMix64(SeedFor(0, "probe " + episode.key.Id())).Uniform() < share;
}

bool HasVerdict(const std::map<std::string, Verdict>& verdicts, const std::string& judge) {
  return verdicts.contains(judge) || verdicts.contains(judge + kVlmSmall);
}

/// What earlier calls about a run paid for, found under what the server said of itself last. Writes nothing.
class EarlierAnswers {
 public:
  EarlierAnswers(const VlmConfig& config, const std::filesystem::path& run) : config_(config) {
    const std::filesystem::path file = run / CallCache::kFile;
    if (!std::filesystem::exists(StatusOf(file))) return;
    cache_ = std::make_unique<CallCache>(file);
    const auto fingerprint = cache_->Fingerprint(config.base_url, config.sampling.model);
    if (!fingerprint) cache_.reset();
    fingerprint_ = fingerprint.value_or("");
  }

  long Lacking(const Task& task, const std::vector<VlmFrame>& frames, VlmProbe probe) const {
    return UnansweredOf(task, frames, config_, {.probe = probe, .fingerprint = fingerprint_}, cache_.get());
  }

 private:
  const VlmConfig& config_;
  std::unique_ptr<CallCache> cache_;  ///< null: no call was made
  std::string fingerprint_;
};

/// Which questions the next call has about an episode. @param verdicts  that it has
std::vector<VlmProbe> QuestionsAbout(const Episode& episode, const std::map<std::string, Verdict>& verdicts,
                                     const VlmConfig& config, const VlmJudgeArguments& arguments) {
  const std::string judge = config.JudgeName();
  const auto asks = [&](const std::string& name) { return arguments.again || !HasVerdict(verdicts, name); };
  std::vector<VlmProbe> questions;
  if (asks(judge)) questions.push_back(VlmProbe::kNone);
  if (!IsProbed(episode, config.probe_share)) return questions;
  if (asks(judge + ":flip")) questions.push_back(VlmProbe::kFlip);
  if (arguments.retest && asks(judge + ":retest")) questions.push_back(VlmProbe::kRetest);
  return questions;
}

/// What the same call without --dry-run would ask for.
ExitCode SayWhatItWouldCost(const VlmConfig& config, const Store& store, const VlmJudgeArguments& arguments) {
  std::map<std::string, Task> tasks;
  for (Task& task : store.Tasks()) tasks.emplace(task.id, std::move(task));
  auto current = store.CurrentVerdicts();
  const EarlierAnswers earlier(config, store.folder());
  long requests = 0, tokens = 0, clips = 0;
  for (const Episode& episode : store.Episodes()) {
    if (IsFailure(episode.stop) || episode.video.empty()) continue;
    const auto questions = QuestionsAbout(episode, current[episode.key.Id()], config, arguments);
    if (questions.empty()) continue;
    const Task& task = tasks.at(episode.key.pair.task);
    const auto frames = ReadVlmFrames(store.folder() / episode.video, task, config.clip);
    long asked = 0;
    for (const VlmProbe probe : questions) asked += earlier.Lacking(task, frames, probe);
    if (asked == 0) continue;  // all of it is in the cache
    ++clips;
    requests += asked;
    tokens += asked * (EstimatedTokens(frames) + kTextTokens);
  }
  const VlmSpent estimate{.requests = requests, .prompt_tokens = tokens, .completion_tokens = requests * 250};
  fmt::print("{}: {} clips, {} requests, about {} prompt tokens", config.JudgeName(), clips, requests, tokens);
  const VlmBudget& prices = config.budget;
  if (prices.usd_per_million_prompt_tokens > 0 || prices.usd_per_million_completion_tokens > 0)
    fmt::print(", about {:.2f} USD", estimate.Usd(prices));
  fmt::print("\n");
  return ExitCode::kOk;
}

/// A server may want minutes; who interrupts waits for none of them.
void SleepUnlessInterrupted(double wait_s) {
  using Seconds = std::chrono::duration<double>;
  constexpr double kLook_s = 0.05;
  for (double left_s = wait_s; left_s > 0 && !IsInterrupted(); left_s -= kLook_s)
    std::this_thread::sleep_for(Seconds(std::min(left_s, kLook_s)));
}

VlmClientOptions ClientOptions(const VlmConfig& config, bool offline) {
  return {.base_url = config.base_url,
          .bearer_key = offline ? "" : config.Key(),
          .limits = config.limits,
          .budget = config.budget,
          .seed = static_cast<std::uint64_t>(config.sampling.seed),
          .sleep_s = SleepUnlessInterrupted,
          .interrupted = IsInterrupted};
}

/// Who answers, and whether it sees; without a network, who answered last.
std::string Greet(const VlmConfig& config, VlmClient& client, CallCache& cache, bool offline) try {
  const std::string& model = config.sampling.model;
  if (offline) {
    const auto known = cache.Fingerprint(config.base_url, model);
    if (!known) throw InvalidInput("--offline: {} was never asked for {} in this run", config.base_url, model);
    return *known;
  }
  const std::string fingerprint = client.Fingerprint(model);
  CheckThatItSees(client, config.sampling);
  cache.SetFingerprint(config.base_url, model, fingerprint);
  return fingerprint;
} catch (const Error&) {
  if (IsInterrupted()) throw InternalError("interrupted");
  throw;
}

/// What this judge's questions about the run cost before, its probes' among them.
VlmSpent SpentBefore(const std::vector<CallTotals>& totals, const std::string& judge) {
  VlmSpent spent;
  for (const CallTotals& of : totals) {
    if (of.judge != judge && !of.judge.starts_with(judge + ":")) continue;
    spent.requests += of.attempts;
    spent.prompt_tokens += of.prompt_tokens;
    spent.completion_tokens += of.completion_tokens;
  }
  return spent;
}

/// Beside the counting, for who looks on; a log would be full of it.
void ShowVerdict(const Verdict& verdict) {
  if (::isatty(STDERR_FILENO))
    fmt::print(stderr, "{}: {} ({})\n", verdict.episode_id, Name(verdict.label), verdict.reason);
}

}  // namespace

ExitCode JudgeWithVlm(const VlmJudgeArguments& arguments) {
  const VlmConfig config = VlmConfig::FromFile(arguments.config);
  Store store = Store::Open(arguments.run, Store::Mode::kReadWrite);
  for (const Task& task : store.Tasks()) {
    if (task.rubric.version == kNoRubric)
      throw InvalidInput("{}: task {} has no rubric: nobody said what success is; wanted a run of a suite with `rubric: {{success: …}}` "
                         "beside its `recording` (docs/suite.md)", arguments.run.string(), task.id);
  }
  if (arguments.dry_run) return SayWhatItWouldCost(config, store, arguments);
  const CatchInterrupts catch_interrupts;
  const VlmSpent before = SpentBefore(TotalsOfCalls(store.folder()), config.JudgeName());
  CallCache cache(store.folder() / CallCache::kFile);
  VlmClient client(ClientOptions(config, arguments.offline));
  VlmJudgeOptions options{.run_folder = store.folder(), .offline = arguments.offline, .now = Now};
  options.fingerprint = Greet(config, client, cache, arguments.offline);
  client.CountEarlier(before);  // where all is judged, a spent budget is none of anybody's concern
  for (const VlmProbe probe : {VlmProbe::kNone, VlmProbe::kFlip, VlmProbe::kRetest}) {
    if (probe == VlmProbe::kRetest && !arguments.retest) continue;
    options.probe = probe;
    VlmJudge judge(config, options, client, cache);
    AskedProgress progress(judge.Name());
    JudgeOptions how{.again = arguments.again,
                     .also_called = {judge.Name() + kVlmSmall},
                     .interrupted = IsInterrupted,
                     .on_verdict = ShowVerdict,
                     .on_asked = [&](int done, int total) { progress.Show(done, total); }};
    if (probe != VlmProbe::kNone)
      how.wanted = [&](const Episode& episode) { return IsProbed(episode, config.probe_share); };
    const JudgeSummary summary = JudgeEpisodes(judge, store, how);
    fmt::print("{}: {}\n", judge.Name(), Sentence(summary));
    if (!summary.why_over.empty())
      throw InternalError("{}\n      what was judged is stored; the same command{} goes on from there", summary.why_over,
                          summary.why_over.starts_with(kBudgetIsSpent) ? " with a larger budget" : "");
  }
  const VlmSpent spent = client.spent();
  fmt::print("{} requests, {} prompt and {} completion tokens", spent.requests, spent.prompt_tokens,
             spent.completion_tokens);
  if (before.requests > 0)
    fmt::print("; before {}, {} and {}", before.requests, before.prompt_tokens, before.completion_tokens);
  fmt::print("\n");
  return ExitCode::kOk;
}

}  // namespace evac
