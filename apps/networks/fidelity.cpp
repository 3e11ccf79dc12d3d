#include "apps/networks/fidelity.h"

#include <fmt/format.h>

#include <algorithm>
#include <map>

#include "apps/evaluate.h"
#include "apps/factory.h"
#include "apps/networks/fidelity_frames.h"
#include "apps/networks/fidelity_judge.h"
#include "apps/networks/fidelity_plans.h"
#include "apps/interrupts.h"
#include "core/version.h"
#include "harness/scheduler.h"
#include "worldmodel/evac_config.h"

namespace evac {
namespace {

namespace fs = std::filesystem;

/// One call's work: what it was asked, and what it has measured so far.
class Measuring {
 public:
  Measuring(const FidelityArguments& arguments, const Suite& suite)
      : arguments_(arguments),
        out_(arguments.out),
        suite_(suite),
        worlds_(WorldsOf(suite_)),
        model_(ReadEvacConfig(worlds_.model.evac->config)),
        chunk_(static_cast<int>(model_.chunk)),
        judge_(arguments.classifier) {
    input_.suite_hash = suite_.hash;
    input_.model_hash = worlds_.model.evac->hash;
  }

  ExitCode Closed() {
    Store store = Store::CreateOrContinue(out_ / "closed", {.suite_text = suite_.text,
                                                            .suite_hash = suite_.hash,
                                                            .suite_path = fs::absolute(suite_.path).lexically_normal().string(),
                                                            .evac_version = EVAC_VERSION});
    StateReality(out_, suite_);
    TakeRealityOf(store);
    const ExitCode exit_code = Evaluate(suite_, store, {});
    if (exit_code != ExitCode::kOk) return exit_code;
    judge_.Rate(store);
    const OutcomesOf outcomes(store, judge_.name());
    for (const Episode& episode : store.Episodes()) {
      if (episode.key.world != worlds_.real.name) continue;
      const EpisodeKey again{episode.key.pair, worlds_.again.name}, model{episode.key.pair, worlds_.model.name};
      input_.rows.push_back({"closed_loop", episode.key.pair, outcomes.Truth(episode.key), outcomes.Truth(again),
                             outcomes.Said(model), outcomes.Clip(episode.key), outcomes.Clip(model)});
    }
    input_.judge = judge_.QualityOn(store, worlds_.real.name, out_ / "masked");
    return ExitCode::kOk;
  }

  void Open() {
    const Store closed = Store::Open(out_ / "closed", Store::Mode::kReadOnly);
    const std::vector<Replay> replays = ReplaysOf(closed, worlds_.real.name, suite_);
    Store store = RunReplays({suite_, out_ / "open", "open loop", suite_.tasks, {worlds_.model}, out_ / "closed"}, replays);
    judge_.Rate(store);
    const OutcomesOf truth(closed, judge_.name()), imagined(store, judge_.name());
    DriftMeter drift(chunk_);
    for (const Replay& replay : replays) {
      const EpisodeKey real{replay.pair, worlds_.real.name}, model{replay.pair, worlds_.model.name};
      input_.rows.push_back({"open_loop", replay.pair, truth.Truth(real), std::nullopt, imagined.Said(model),
                             truth.Clip(real), imagined.Clip(model)});
      AddDrift(replay, truth.Clip(real), imagined.Clip(model), drift);
    }
    input_.open_loop = {drift.object_px(), drift.Chunks()};
  }

  /// What policies chose in the model, done in reality: whether the model is wrong about what it is told, or policies are
  /// led astray by what it shows them.
  void Executed() {
    const Store closed = Store::Open(out_ / "closed", Store::Mode::kReadOnly);
    const std::vector<Replay> replays = ReplaysOf(closed, worlds_.model.name, suite_);
    const Store store = RunReplays({suite_, out_ / "executed", "executed", suite_.tasks, {worlds_.again}}, replays);
    const OutcomesOf imagined(closed, judge_.name()), truth(store, judge_.name());
    for (const Replay& replay : replays) {
      const EpisodeKey really{replay.pair, worlds_.again.name}, model{replay.pair, worlds_.model.name};
      input_.rows.push_back({"executed", replay.pair, truth.Truth(really), std::nullopt, imagined.Said(model),
                             truth.Clip(really), imagined.Clip(model)});
    }
  }

  void Counterfactual() {
    const Store closed = Store::Open(out_ / "closed", Store::Mode::kReadOnly);
    const OutcomesOf outcomes(closed, judge_.name());
    std::vector<Replay> successes = ReplaysOf(closed, worlds_.real.name, suite_);
    std::erase_if(successes, [&](const Replay& replay) {
      return outcomes.Truth({replay.pair, worlds_.real.name}) != std::optional<bool>(true);
    });
    auto kinds = Counterfactuals(std::move(successes), suite_.tasks, arguments_.counterfactual_states);
    for (evac::Counterfactual& kind : kinds) {
      PointAt(kind.tasks, kind.replays);
      const std::string folder = "counterfactual_" + kind.name;
      Store store = RunReplays(
          {suite_, out_ / folder, folder, kind.tasks, {worlds_.real, worlds_.model}, {}, Earlier(folder)}, kind.replays);
      judge_.Rate(store);
      const OutcomesOf found(store, judge_.name());
      for (const Replay& replay : kind.replays) {
        const EpisodeKey real{replay.pair, worlds_.real.name}, model{replay.pair, worlds_.model.name};
        input_.rows.push_back({"counterfactual:" + kind.name, replay.pair, found.Truth(real), std::nullopt,
                               found.Said(model), found.Clip(real), found.Clip(model)});
      }
    }
  }

  void Horizon() {
    const Store closed = Store::Open(out_ / "closed", Store::Mode::kReadOnly);
    const auto frames = static_cast<std::size_t>(arguments_.horizon_chunks * chunk_);
    std::vector<Task> tasks = suite_.tasks;
    for (Task& task : tasks) {
      task.still.enabled = false;
      task.max_chunks = arguments_.horizon_chunks * chunk_ / suite_.chunk_size + 1;
    }
    std::vector<Replay> replays =
        LongRollouts(ReplaysOf(closed, worlds_.real.name, suite_), {arguments_.horizon_states, frames});
    PointAt(tasks, replays);
    const Store store =
        RunReplays({suite_, out_ / "horizon", "horizon", tasks, {worlds_.real, worlds_.model}, {}, Earlier("horizon")}, replays);
    const OutcomesOf found(store, judge_.name());
    DriftMeter drift(chunk_);
    for (const Replay& replay : replays)
      AddDrift(replay, found.Clip({replay.pair, worlds_.real.name}), found.Clip({replay.pair, worlds_.model.name}), drift);
    input_.horizon = drift.Chunks();
  }

  /// Measured anew every time.
  void Speed() {
    const Store closed = Store::Open(out_ / "closed", Store::Mode::kReadOnly);
    input_.seconds_per_chunk =
        SecondsPerChunk(worlds_.model, suite_, closed, ReplaysOf(closed, worlds_.real.name, suite_), chunk_);
  }

  void Finish() {
    if (judge_.name().empty())
      fmt::print(stderr, "evac: warning: nobody judges the imagined clips: give --classifier WEIGHTS (docs/classifier_judge.md)\n");
    FinishFidelity(out_, std::move(input_));
  }

 private:
  /// That part's run in the folder of `--reality`; empty: none was given.
  fs::path Earlier(const std::string& part) const {
    return arguments_.reality.empty() ? fs::path() : fs::path(arguments_.reality) / part;
  }

  void TakeRealityOf(Store& store) const {
    if (arguments_.reality.empty()) return;
    RequireSameReality(arguments_.reality, suite_);
    Declare(suite_, store);
    std::set<EpisodeKey> wanted;
    for (const SuiteWorld& world : {worlds_.real, worlds_.again}) {
      for (const SuitePolicy& policy : suite_.policies) {
        for (const Job& job : AllJobs(suite_, world, policy)) wanted.insert(job.key);
      }
    }
    TakeReality(Earlier("closed"), wanted, store);
  }

  /// Replays are of `suite_.tasks`; here are others of the same names.
  static void PointAt(const std::vector<Task>& tasks, std::vector<Replay>& replays) {
    for (Replay& replay : replays)
      replay.task = &*std::find_if(tasks.begin(), tasks.end(), [&](const Task& task) { return task.id == replay.pair.task; });
  }

  void AddDrift(const Replay& replay, const std::string& real, const std::string& model, DriftMeter& drift) const {
    if (real.empty() || model.empty()) return;
    drift.Add({replay.task, out_ / real, out_ / model, replay.actions, suite_.video.scale,
               model_.pose_map.tool_length_m});
  }

  const FidelityArguments& arguments_;
  fs::path out_;
  Suite suite_;
  FidelityWorlds worlds_;
  nn::ModelConfig model_;
  int chunk_;  ///< K
  FidelityJudge judge_;
  FidelityInput input_;
};

bool Asks(const FidelityArguments& arguments, const char* part) {
  return std::find(arguments.parts.begin(), arguments.parts.end(), part) != arguments.parts.end();
}

}  // namespace

FidelityWorlds WorldsOf(const Suite& suite) {
  FidelityWorlds found;
  for (const SuiteWorld& world : suite.worlds) {
    if (world.is_real) found.real = world;
    if (world.evac) found.model = world;
  }
  for (const SuiteWorld& world : suite.worlds) {
    if (!world.is_real && world.type == "mujoco" && world.profile == found.real.profile) found.again = world;
  }
  const auto require = [&](const SuiteWorld& world, const char* wanted) {
    if (world.name.empty()) throw InvalidInput("{}: field worlds: wanted {}", suite.path.string(), wanted);
  };
  require(found.real, "one with role: real");
  require(found.model, "one of type evac");
  require(found.again, "another of type mujoco with the real world's profile: reality once more");
  return found;
}

ExitCode RunFidelity(const FidelityArguments& arguments) {
  for (const std::string& part : arguments.parts) {
    static const std::set<std::string> kParts = {"closed", "open", "executed", "counterfactual", "horizon"};
    if (!kParts.contains(part)) throw InvalidInput("--parts: found '{}', wanted some of closed, open, executed, counterfactual, horizon", part);
  }
  const CatchInterrupts catch_interrupts;
  const Suite suite = ReadSuite(arguments.suite, arguments.assignments);
  if (suite.recording) return RunRecordedFidelity(arguments, suite);
  Measuring measuring(arguments, suite);
  const ExitCode closed = measuring.Closed();  // what all other parts are made from
  if (closed != ExitCode::kOk) return closed;
  if (Asks(arguments, "open")) measuring.Open();
  if (Asks(arguments, "executed")) measuring.Executed();
  if (Asks(arguments, "counterfactual")) measuring.Counterfactual();
  if (Asks(arguments, "horizon")) measuring.Horizon();
  measuring.Speed();
  measuring.Finish();
  return ExitCode::kOk;
}

}  // namespace evac
