#include "apps/evaluate.h"

#include <fmt/format.h>

#include <csignal>
#include <memory>

#include "apps/factory.h"
#include "apps/progress_display.h"
#include "harness/rollout.h"
#include "harness/scheduler.h"
#include "judges/judge_episodes.h"
#include "judges/oracle_judge.h"

namespace evac {
namespace {

volatile std::sig_atomic_t g_interrupted = 0;

/// While it lives, the first Ctrl-C ends the run in order, the second at once.
class CatchInterrupts {
 public:
  CatchInterrupts() {
    g_interrupted = 0;
    for (const int signal : {SIGINT, SIGTERM}) {
      std::signal(signal, [](int caught) {
        g_interrupted = 1;
        std::signal(caught, SIG_DFL);
      });
    }
  }
  ~CatchInterrupts() {
    for (const int signal : {SIGINT, SIGTERM}) std::signal(signal, SIG_DFL);
  }
};

/// What is still to do, over all pairings of a world with a policy.
struct Plan {
  int total = 0;        ///< episodes of the suite
  int missing = 0;      ///< of those, not stored yet
  int failed = 0;       ///< stored as failed
  int allowed = 0;      ///< how many may fail before the run gives up
};

Plan MakePlan(const Suite& suite, const Store& store) {
  Plan plan;
  for (const SuiteWorld& world : suite.worlds) {
    for (const SuitePolicy& policy : suite.policies) {
      const std::vector<Job> jobs = AllJobs(suite, world, policy);
      plan.total += static_cast<int>(jobs.size());
      plan.missing += static_cast<int>(MissingJobs(jobs, store).size());
    }
  }
  for (const Episode& episode : store.Episodes()) plan.failed += IsFailure(episode.stop);
  plan.allowed = static_cast<int>(suite.error_budget * plan.total);
  return plan;
}

void RetryFailed(Store& store) {
  for (const Episode& episode : store.Episodes()) {
    if (IsFailure(episode.stop)) store.RemoveFailed(episode.key);
  }
}

/// One run's state while it goes from pairing to pairing.
class Evaluation {
 public:
  Evaluation(const Suite& suite, Store& store)
      : suite_(suite), store_(store), plan_(MakePlan(suite, store)), display_(plan_.total, plan_.total - plan_.missing, stderr) {}

  /// One world under every policy. @returns false if the run must end.
  bool RunWorld(const SuiteWorld& suite_world) {
    std::unique_ptr<World> world;
    for (const SuitePolicy& suite_policy : suite_.policies) {
      JobQueue jobs(MissingJobs(AllJobs(suite_, suite_world, suite_policy), store_));
      if (jobs.size() == 0) continue;
      if (!world) world = MakeCheckedWorld(suite_world);
      display_.Begin(fmt::format("{} · {}@{}", suite_world.name, suite_policy.name, suite_policy.checkpoint));
      RunningPolicy policy(suite_policy, suite_, store_.folder());
      store_.AddPolicy({suite_policy.name, suite_policy.checkpoint, policy.declaration()});
      const Summary summary = RunEpisodes(policy.policy(), *world, jobs, store_, Options(suite_world, policy));
      store_.Count(suite_policy.name + "@" + suite_policy.checkpoint, policy.counters());
      plan_.failed += summary.failed;
      if (summary.failed > 0) display_.Say(fmt::format("{} episodes failed; the last: {}", summary.failed, summary.last_failure));
      if (summary.interrupted || summary.budget_spent) return End(summary);
    }
    return true;
  }

  const std::string& why_ended() const { return why_ended_; }
  const Plan& plan() const { return plan_; }

 private:
  /// A task page that the world cannot start from ends the run here, once, and not in every episode.
  std::unique_ptr<World> MakeCheckedWorld(const SuiteWorld& suite_world) {
    std::unique_ptr<World> world = MakeWorld(suite_world, suite_);
    for (const Task& task : suite_.tasks) world->Reset(0, task, suite_.initial_states.front(), 0);
    return world;
  }

  RolloutOptions Options(const SuiteWorld& world, const RunningPolicy& policy) {
    RolloutOptions options;
    options.lanes = suite_.lanes;
    options.lane = {.chunk_size = suite_.chunk_size,
                    .policy_chunk_size = policy.chunk_size(),
                    .video = suite_.video,
                    .keep_initial_scene = world.is_real};
    options.failures_left = plan_.allowed - plan_.failed;
    options.on_progress = [this](const Progress& progress) { display_.Show(progress, ProgressDisplay::Clock::now()); };
    options.interrupted = [] { return g_interrupted != 0; };
    return options;
  }

  bool End(const Summary& summary) {
    why_ended_ = summary.interrupted
                     ? std::string("interrupted")
                     : fmt::format("the error budget is spent: {} episodes failed, {} of {} may (error_budget {}); the last: {}", plan_.failed,
                                   plan_.allowed, plan_.total, suite_.error_budget, summary.last_failure);
    return false;
  }

  const Suite& suite_;
  Store& store_;
  Plan plan_;
  ProgressDisplay display_;
  std::string why_ended_;
};

void RunJudges(const Suite& suite, Store& store) {
  for (const std::string& name : suite.judges) {
    if (name != "oracle") throw InvalidInput("{}: field judges: found '{}', wanted oracle", suite.path.string(), name);
    OracleJudge oracle(store);
    JudgeEpisodes(oracle, store, {});
  }
}

}  // namespace

ExitCode Evaluate(const Suite& suite, Store& store, const EvaluateOptions& options) {
  const CatchInterrupts catch_interrupts;
  if (options.retry_failed) RetryFailed(store);
  store.RemoveOrphans();
  Declare(suite, store);
  std::string why_ended;
  {
    Evaluation evaluation(suite, store);
    for (const SuiteWorld& world : RealFirst(suite.worlds)) {
      if (!evaluation.RunWorld(world)) break;
    }
    why_ended = evaluation.why_ended();
  }
  RunJudges(suite, store);
  const Plan now = MakePlan(suite, store);
  fmt::print(stderr, "{} of {} episodes stored in {}, {} failed\n", now.total - now.missing, now.total, store.folder().string(), now.failed);
  if (why_ended.empty() && now.failed > now.allowed) {
    why_ended = fmt::format("{} episodes failed, {} of {} may (error_budget {})", now.failed, now.allowed, now.total, suite.error_budget);
  }
  if (why_ended.empty()) return ExitCode::kOk;
  fmt::print(stderr, "evac: {}\n      go on with: evac resume {}{}\n", why_ended, store.folder().string(), now.failed > 0 ? " --retry-failed" : "");
  return ExitCode::kInternal;
}

}  // namespace evac
