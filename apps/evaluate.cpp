#include "apps/evaluate.h"

#include <fmt/format.h>

#include <algorithm>
#include <cstdio>
#include <memory>
#include <set>
#include <utility>

#include "apps/factory.h"
#include "apps/for_shell.h"
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

/// The shard's failed episodes that are stored.
std::set<EpisodeKey> FailedOf(const Shard& shard, const Store& store) {
  std::set<EpisodeKey> failed;
  for (const Episode& episode : store.Episodes()) {
    if (IsFailure(episode.stop) && shard.Holds(episode.key.pair)) failed.insert(episode.key);
  }
  return failed;
}

/// @param again  failed episodes that are to run again: still to do, and not failed yet
Plan MakePlan(const Suite& suite, const Shard& shard, const Store& store, const std::set<EpisodeKey>& again = {}) {
  Plan plan;
  for (const SuiteWorld& world : suite.worlds) {
    for (const SuitePolicy& policy : suite.policies) {
      const std::vector<Job> jobs = JobsOf(suite, shard, world, policy);
      plan.total += static_cast<int>(jobs.size());
      plan.missing += static_cast<int>(MissingJobs(jobs, store).size());
    }
  }
  plan.missing += static_cast<int>(again.size());
  plan.failed = static_cast<int>(FailedOf(shard, store).size() - again.size());
  plan.allowed = AllowedFailures(suite, plan.total);
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
  const std::string command = options.go_on.empty() ? "evac resume " + ForShell(store.folder().string()) : options.go_on;
  return command + (retry_failed ? " --retry-failed" : "") + options.shard.Option() + (whole.empty() ? "" : ", then " + whole);
}

/// Before whatever may take seconds: who waits at the keyboard is not to wait for it.
void EndIfInterrupted() {
  if (IsInterrupted()) throw InternalError("interrupted");
}

/// A suite names the oracle or nobody. What has a verdict is not judged again.
void RunJudges(const Suite& suite, Store& store) {
  if (suite.judges.empty()) return;
  OracleJudge oracle(store);
  JudgeEpisodes(oracle, store, {.interrupted = IsInterrupted});
}

/// One run's state while it goes from pairing to pairing.
class Evaluation {
 public:
  Evaluation(const Suite& suite, const EvaluateOptions& options, Store& store)
      : suite_(suite),
        shard_(options.shard),
        store_(store),
        to_retry_(options.retry_failed ? FailedOf(shard_, store) : std::set<EpisodeKey>()),
        plan_(MakePlan(suite, shard_, store, to_retry_)),
        display_(plan_.total, plan_.total - plan_.missing, stderr) {}

  /// A policy that cannot be started or does not fit ends the run before its first episode: the suite that is mended is
  /// another one, and begins anew. Whoever runs first is greeted then, before any episode too.
  void GreetPolicies() {
    const std::vector<const SuitePolicy*> to_run = PoliciesToRun();
    for (const SuitePolicy* policy : to_run) {
      if (!policy->command.empty()) CommandLine(*policy, suite_);
    }
    for (std::size_t i = 1; i < to_run.size(); ++i) {
      EndIfInterrupted();
      const RunningPolicy greeted(*to_run[i], suite_, store_.folder(), IsInterrupted);
      Keep(*to_run[i], greeted);
    }
  }

  /// One world under every policy. @returns false if the run must end.
  bool RunWorld(const SuiteWorld& suite_world) {
    std::unique_ptr<World> world;
    for (const SuitePolicy& suite_policy : suite_.policies) {
      const std::vector<Job> to_run = JobsToRun(suite_world, suite_policy);
      if (to_run.empty()) continue;
      if (!world) world = MakeCheckedWorld(suite_world, suite_policy);
      display_.Begin(fmt::format("{} · {}@{}", suite_world.name, suite_policy.name, suite_policy.checkpoint));
      RunningPolicy policy(suite_policy, suite_, store_.folder(), IsInterrupted);
      Keep(suite_policy, policy);
      Probe(policy, *world, suite_world, suite_policy);
      EndIfInterrupted();  // a probe that was broken off says nothing
      JobQueue jobs(to_run);
      const Summary summary = RunEpisodes(policy.policy(), *world, jobs, store_, Options(suite_world, policy));
      store_.Count(suite_policy.name + "@" + suite_policy.checkpoint, policy.counters());
      const std::string wire = Sentence(policy.counters());
      if (!wire.empty()) display_.Say(fmt::format("{}@{}: {}", suite_policy.name, suite_policy.checkpoint, wire));
      plan_.failed += summary.failed;
      if (summary.failed > 0) display_.Say(fmt::format("{} episodes failed; the last: {}", summary.failed, summary.last_failure));
      if (summary.interrupted || summary.budget_spent) return End(summary);
      RunJudges(suite_, store_);  // nobody else may while this writes, and who looks meanwhile looks for verdicts
    }
    return true;
  }

  const std::string& why_ended() const { return why_ended_; }
  const Plan& plan() const { return plan_; }

 private:
  /// What it declares; where that is not what the suite calls it, it is said, once.
  void Keep(const SuitePolicy& entry, const RunningPolicy& policy) {
    store_.AddPolicyAsItIsNow({entry.name, entry.checkpoint, policy.declaration()});
    const std::string other = policy.declared_otherwise();
    if (!other.empty() && noted_.insert(other).second) display_.Say("evac: note: " + other);
  }

  /// What the store does not have yet, and what failed where that is to run again.
  std::vector<Job> JobsToRun(const SuiteWorld& world, const SuitePolicy& policy) const {
    std::vector<Job> jobs = JobsOf(suite_, shard_, world, policy);
    std::erase_if(jobs, [&](const Job& job) { return store_.Has(job.key) && !to_retry_.contains(job.key); });
    return jobs;
  }

  /// On what a world, or a policy in it, is tried: each task's first job of the suite, whatever the shard and whatever is
  /// done, so that a run that goes on ends where one that was never interrupted does, and what cannot begin later is its own
  /// episode's failure in both. What imagines is tried where this run has seen a beginning.
  /// @param is_its  of an episode: its task was tried before it
  template <typename IsIts>
  std::vector<Job> FirstJobs(const SuiteWorld& world, const SuitePolicy& policy, const IsIts& is_its) const {
    std::set<std::string> tried;
    for (const Episode& episode : store_.Episodes()) {
      if (is_its(episode.key) && !to_retry_.contains(episode.key)) tried.insert(episode.key.pair.task);
    }
    std::set<std::pair<std::string, std::string>> seen;
    for (const PairKey& pair : store_.InitialScenes()) seen.insert({pair.task, pair.initial_state});
    const bool begins_as_seen = world.evac && !suite_.recording;
    std::vector<Job> jobs;
    for (const Job& job : AllJobs(suite_, world, policy)) {
      const PairKey& pair = job.key.pair;
      if (begins_as_seen && !seen.contains({pair.task, pair.initial_state})) continue;
      if (tried.insert(pair.task).second) jobs.push_back(job);
    }
    return jobs;
  }

  /// Those with an episode to do, whose turn comes first at the front.
  std::vector<const SuitePolicy*> PoliciesToRun() const {
    std::vector<const SuitePolicy*> policies;
    for (const SuiteWorld& world : RealFirst(suite_.worlds)) {
      for (const SuitePolicy& policy : suite_.policies) {
        const bool is_there = std::ranges::find(policies, &policy) != policies.end();
        if (!is_there && !JobsToRun(world, policy).empty()) policies.push_back(&policy);
      }
    }
    return policies;
  }

  /// A task page that the world cannot start from ends the run here, once, and not in every episode.
  std::unique_ptr<World> MakeCheckedWorld(const SuiteWorld& suite_world, const SuitePolicy& policy) {
    std::unique_ptr<World> world = MakeWorld(suite_world, suite_, &store_);
    const auto is_its = [&](const EpisodeKey& key) { return key.world == suite_world.name; };
    for (const Job& job : FirstJobs(suite_world, policy, is_its)) {
      EndIfInterrupted();
      CheckStart(*world, *job.task, job.initial);
    }
    return world;
  }

  /// A policy that keeps to other conventions than it declared ends the run here, not in a hundred odd episodes.
  void Probe(RunningPolicy& policy, World& world, const SuiteWorld& suite_world, const SuitePolicy& suite_policy) {
    if (suite_.start_probe == StartProbe::kOff) return;
    const auto is_its = [&](const EpisodeKey& key) {
      return key.world == suite_world.name && key.pair.policy == suite_policy.name &&
             key.pair.checkpoint == suite_policy.checkpoint;
    };
    for (const Job& job : FirstJobs(suite_world, suite_policy, is_its)) {
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

  RolloutOptions Options(const SuiteWorld& world, RunningPolicy& policy) {
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
    options.check_policy = [&policy] { policy.CheckFiles(); };
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
  const std::set<EpisodeKey> to_retry_;  ///< failed when this began
  Plan plan_;
  ProgressDisplay display_;
  std::set<std::string> noted_;  ///< of policies, already
  std::string why_ended_;
};

/// @returns why it ended before its last episode, or nothing.
std::string RunWorlds(const Suite& suite, const EvaluateOptions& options, Store& store) try {
  Evaluation evaluation(suite, options, store);
  evaluation.GreetPolicies();
  for (const SuiteWorld& world : RealFirst(suite.worlds)) {
    if (!evaluation.RunWorld(world)) break;
  }
  return evaluation.why_ended();
} catch (const Error& error) {
  if (IsInterrupted()) return "interrupted";
  if (error.exit_code() != ExitCode::kInternal) throw;
  throw InternalError("{}\n      what was stored is intact; once that is mended, go on with: {}", error.what(),
                      GoOn(options, store, options.retry_failed));
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
  store.AddPlan(PlannedOf(suite));
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
