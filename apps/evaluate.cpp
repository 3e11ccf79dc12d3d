#include "apps/evaluate.h"

#include <fmt/format.h>

#include <algorithm>
#include <cstdio>
#include <memory>
#include <set>

#include "apps/factory.h"
#include "apps/interrupts.h"
#include "apps/progress_display.h"
#include "core/seed.h"
#include "core/version.h"
#include "harness/rollout.h"
#include "harness/scheduler.h"
#include "harness/start_probe.h"
#include "judges/judge_episodes.h"
#include "judges/oracle_judge.h"

namespace evac {
namespace {

/// On stderr, which may be a terminal that is closed by now.
template <typename... Args>
void Tell(fmt::format_string<Args...> format, Args&&... args) {
  std::fputs(fmt::format(format, std::forward<Args>(args)...).c_str(), stderr);
}

/// "12 repeats, 3 late_replies", or nothing where the wire was quiet.
std::string Sentence(const Counters& counters) {
  std::string text;
  for (const auto& [name, count] : counters) {
    if (count > 0) text += fmt::format("{}{} {}", text.empty() ? "" : ", ", count, name);
  }
  return text;
}

/// What is still to do, over all pairings of a world with a policy.
struct Plan {
  int total = 0;        ///< episodes of the suite
  int missing = 0;      ///< of those, not stored yet
  int failed = 0;       ///< stored as failed
  int allowed = 0;      ///< how many may fail before the run gives up
};

std::vector<Job> JobsOf(const Suite& suite, const Shard& shard, const SuiteWorld& world, const SuitePolicy& policy) {
  std::vector<Job> jobs = AllJobs(suite, world, policy);
  std::erase_if(jobs, [&](const Job& job) { return !shard.Holds(job.key.pair); });
  return jobs;
}

Plan MakePlan(const Suite& suite, const Shard& shard, const Store& store) {
  Plan plan;
  for (const SuiteWorld& world : suite.worlds) {
    for (const SuitePolicy& policy : suite.policies) {
      const std::vector<Job> jobs = JobsOf(suite, shard, world, policy);
      plan.total += static_cast<int>(jobs.size());
      plan.missing += static_cast<int>(MissingJobs(jobs, store).size());
    }
  }
  for (const Episode& episode : store.Episodes()) plan.failed += IsFailure(episode.stop) && shard.Holds(episode.key.pair);
  plan.allowed = static_cast<int>(suite.error_budget * plan.total);
  return plan;
}

/// What whoever reads the run may want to know, and no reason to refuse it.
void SayIfAnotherVersionBegan(const Store& store) {
  const std::string began = store.run().evac_version;
  if (began != EVAC_VERSION)
    Tell("evac: note: {} was begun by evac {}; evac {} goes on with it\n", store.folder().string(), began, EVAC_VERSION);
}

/// What goes on with this run as it was asked for.
std::string GoOn(const EvaluateOptions& options, const Store& store, bool retry_failed) {
  const std::string whole = options.part_of.empty() ? "" : fmt::format("the same {} command", options.part_of);
  if (!whole.empty() && !retry_failed) return whole;
  const std::string command = options.go_on.empty() ? fmt::format("evac resume {}", store.folder().string()) : options.go_on;
  return command + (retry_failed ? " --retry-failed" : "") + options.shard.Option() + (whole.empty() ? "" : ", then " + whole);
}

/// Before whatever may take seconds: who waits at the keyboard is not to wait for it.
void EndIfInterrupted() {
  if (IsInterrupted()) throw InternalError("interrupted");
}

/// Makes room for failed episodes to be run again. Their reasons are lost with them: not before their policies were greeted.
void RetryFailed(const Suite& suite, const Shard& shard, Store& store) {
  std::vector<EpisodeKey> failed;
  for (const Episode& episode : store.Episodes()) {
    if (IsFailure(episode.stop) && shard.Holds(episode.key.pair)) failed.push_back(episode.key);
  }
  for (const SuitePolicy& policy : suite.policies) {
    const auto is_its = [&](const EpisodeKey& key) {
      return key.pair.policy == policy.name && key.pair.checkpoint == policy.checkpoint;
    };
    if (std::ranges::none_of(failed, is_its)) continue;
    EndIfInterrupted();
    const RunningPolicy greeted(policy, suite, store.folder(), IsInterrupted);
  }
  for (const EpisodeKey& key : failed) store.RemoveFailed(key);
  store.RemoveOrphans();
}

/// One run's state while it goes from pairing to pairing.
class Evaluation {
 public:
  Evaluation(const Suite& suite, const Shard& shard, Store& store)
      : suite_(suite), shard_(shard), store_(store), plan_(MakePlan(suite, shard, store)), display_(plan_.total, plan_.total - plan_.missing, stderr) {}

  /// A policy that cannot be started or does not fit ends the run before its first episode: the suite that is mended is
  /// another one, and begins anew. Whoever runs first is greeted then, before any episode too.
  void GreetPolicies() const {
    const std::vector<const SuitePolicy*> to_run = PoliciesToRun();
    for (const SuitePolicy* policy : to_run) {
      if (!policy->command.empty()) CommandLine(*policy, suite_);
    }
    for (std::size_t i = 1; i < to_run.size(); ++i) {
      EndIfInterrupted();
      const RunningPolicy greeted(*to_run[i], suite_, store_.folder(), IsInterrupted);
    }
  }

  /// One world under every policy. @returns false if the run must end.
  bool RunWorld(const SuiteWorld& suite_world) {
    std::unique_ptr<World> world;
    for (const SuitePolicy& suite_policy : suite_.policies) {
      JobQueue jobs(MissingJobs(JobsOf(suite_, shard_, suite_world, suite_policy), store_));
      if (jobs.size() == 0) continue;
      if (!world) world = MakeCheckedWorld(suite_world, suite_policy);
      display_.Begin(fmt::format("{} · {}@{}", suite_world.name, suite_policy.name, suite_policy.checkpoint));
      RunningPolicy policy(suite_policy, suite_, store_.folder(), IsInterrupted);
      store_.AddPolicy({suite_policy.name, suite_policy.checkpoint, policy.declaration()});
      Probe(policy, *world, suite_world, suite_policy);
      const Summary summary = RunEpisodes(policy.policy(), *world, jobs, store_, Options(suite_world, policy));
      store_.Count(suite_policy.name + "@" + suite_policy.checkpoint, policy.counters());
      const std::string wire = Sentence(policy.counters());
      if (!wire.empty()) display_.Say(fmt::format("{}@{}: {}", suite_policy.name, suite_policy.checkpoint, wire));
      plan_.failed += summary.failed;
      if (summary.failed > 0) display_.Say(fmt::format("{} episodes failed; the last: {}", summary.failed, summary.last_failure));
      if (summary.interrupted || summary.budget_spent) return End(summary);
    }
    return true;
  }

  const std::string& why_ended() const { return why_ended_; }
  const Plan& plan() const { return plan_; }

 private:
  /// Those with an episode to do, whose turn comes first at the front.
  std::vector<const SuitePolicy*> PoliciesToRun() const {
    std::vector<const SuitePolicy*> policies;
    for (const SuiteWorld& world : RealFirst(suite_.worlds)) {
      for (const SuitePolicy& policy : suite_.policies) {
        const bool is_there = std::ranges::find(policies, &policy) != policies.end();
        if (!is_there && !MissingJobs(JobsOf(suite_, shard_, world, policy), store_).empty()) policies.push_back(&policy);
      }
    }
    return policies;
  }

  /// A task page that the world cannot start from ends the run here, once, and not in every episode.
  std::unique_ptr<World> MakeCheckedWorld(const SuiteWorld& suite_world, const SuitePolicy& policy) {
    std::unique_ptr<World> world = MakeWorld(suite_world, suite_, &store_);
    std::set<std::string> seen;
    for (const Job& job : MissingJobs(JobsOf(suite_, shard_, suite_world, policy), store_)) {
      if (!seen.insert(job.key.pair.task).second) continue;
      EndIfInterrupted();
      CheckStart(*world, *job.task, job.initial);
    }
    return world;
  }

  /// A policy that keeps to other conventions than it declared ends the run here, not in a hundred odd episodes.
  void Probe(RunningPolicy& policy, World& world, const SuiteWorld& suite_world, const SuitePolicy& suite_policy) {
    if (suite_.start_probe == StartProbe::kOff) return;
    std::set<std::string> seen;
    for (const Job& job : MissingJobs(JobsOf(suite_, shard_, suite_world, suite_policy), store_)) {
      if (!seen.insert(job.key.pair.task).second) continue;
      EndIfInterrupted();
      std::string certain;
      for (const Suspicion& suspicion : ProbeStart(policy.policy(), world, job)) {
        const std::string sentence = fmt::format("policy {}@{}, task {}, first chunk: {}", suite_policy.name, suite_policy.checkpoint,
                                                 job.key.pair.task, suspicion.sentence);
        const bool ends = suspicion.is_certain && suite_.start_probe == StartProbe::kRefuse;
        if (ends) certain += (certain.empty() ? "" : "\n      ") + sentence;
        if (!ends) display_.Say("warning: " + sentence);
      }
      if (!certain.empty()) throw InvalidInput("{}\n      See docs/conventions.md; if it is meant so, set policy.start_probe to warn", certain);
    }
  }

  RolloutOptions Options(const SuiteWorld& world, const RunningPolicy& policy) {
    RolloutOptions options;
    options.lanes = suite_.lanes;
    options.lane = {.chunk_size = suite_.chunk_size,
                    .policy_chunk_size = policy.chunk_size(),
                    .latency = suite_.latency,
                    .video = suite_.video,
                    .film = world.film,
                    .keep_initial_scene = world.is_real};
    options.failures_left = plan_.allowed - plan_.failed;
    options.on_progress = [this](const Progress& progress) { display_.Show(progress, ProgressDisplay::Clock::now()); };
    options.interrupted = IsInterrupted;
    return options;
  }

  bool End(const Summary& summary) {
    why_ended_ = summary.interrupted
                     ? std::string("interrupted")
                     : fmt::format("the error budget is spent: {} episodes failed, {} of {} may (error_budget {}){}", plan_.failed,
                                   plan_.allowed, plan_.total, suite_.error_budget,
                                   summary.last_failure.empty() ? "" : "; the last: " + summary.last_failure);
    return false;
  }

  const Suite& suite_;
  Shard shard_;
  Store& store_;
  Plan plan_;
  ProgressDisplay display_;
  std::string why_ended_;
};

/// A suite names the oracle or nobody.
void RunJudges(const Suite& suite, Store& store) {
  if (suite.judges.empty()) return;
  OracleJudge oracle(store);
  JudgeEpisodes(oracle, store, {.interrupted = IsInterrupted});
}

/// @returns why it ended before its last episode, or nothing.
std::string RunWorlds(const Suite& suite, const EvaluateOptions& options, Store& store) try {
  if (options.retry_failed) RetryFailed(suite, options.shard, store);
  Evaluation evaluation(suite, options.shard, store);
  evaluation.GreetPolicies();
  for (const SuiteWorld& world : RealFirst(suite.worlds)) {
    if (!evaluation.RunWorld(world)) break;
  }
  return evaluation.why_ended();
} catch (const Error& error) {
  if (IsInterrupted()) return "interrupted";
  if (error.exit_code() != ExitCode::kInternal) throw;
  throw InternalError("{}\n      what was stored is intact; once that is mended, go on with: {}", error.what(), GoOn(options, store, false));
}

}  // namespace

bool Shard::Holds(const PairKey& pair) const {
  const std::string name = fmt::format("{} {} {} {}", pair.task, pair.initial_state, pair.policy, pair.checkpoint);
  return SeedFor(0, name) % static_cast<std::uint64_t>(of) == static_cast<std::uint64_t>(number - 1);
}

std::string Shard::Option() const { return of == 1 ? std::string() : fmt::format(" --shard {}/{}", number, of); }

ExitCode Evaluate(const Suite& suite, Store& store, const EvaluateOptions& options) {
  const CatchInterrupts catch_interrupts;
  SayIfAnotherVersionBegan(store);
  store.RemoveOrphans();
  Declare(suite, store);
  std::string why_ended = RunWorlds(suite, options, store);
  if (!IsInterrupted()) RunJudges(suite, store);
  if (why_ended.empty() && IsInterrupted()) why_ended = "interrupted";
  const Plan now = MakePlan(suite, options.shard, store);
  Tell("{} of {} episodes stored in {}, {} failed\n", now.total - now.missing, now.total, store.folder().string(), now.failed);
  if (why_ended.empty() && now.failed > now.allowed) {
    why_ended = fmt::format("{} episodes failed, {} of {} may (error_budget {})", now.failed, now.allowed, now.total, suite.error_budget);
  }
  if (why_ended.empty()) return ExitCode::kOk;
  Tell("evac: {}\n      go on with: {}\n", why_ended, GoOn(options, store, now.failed > 0));
  return ExitCode::kInternal;
}

}  // namespace evac
