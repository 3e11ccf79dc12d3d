#include "apps/networks/fidelity.h"

#include <fmt/format.h>

#include <algorithm>
#include <iterator>
#include <map>

#include "apps/evaluate.h"
#include "apps/factory.h"
#include "apps/judge_with_progress.h"
#include "apps/networks/fidelity_frames.h"
#include "apps/networks/fidelity_judge.h"
#include "apps/networks/fidelity_plans.h"
#include "apps/interrupts.h"
#include "core/version.h"
#include "harness/scheduler.h"
#include "judges/oracle_judge.h"
#include "worldmodel/evac_config.h"

namespace evac {
namespace {

namespace fs = std::filesystem;

bool Asks(const FidelityArguments& arguments, const char* part) {
  return std::find(arguments.parts.begin(), arguments.parts.end(), part) != arguments.parts.end();
}

/// They would be passed over in silence.
void RefuseOptionsOfOtherParts(const FidelityArguments& given) {
  const FidelityArguments none;
  struct PartOption {
    const char *option, *part;
    bool is_given;
  };
  const PartOption options[] = {
      {"--counterfactual-states", "counterfactual", given.counterfactual_states != none.counterfactual_states},
      {"--horizon-states", "horizon", given.horizon_states != none.horizon_states},
      {"--horizon-chunks", "horizon", given.horizon_chunks != none.horizon_chunks}};
  for (const auto& [option, part, is_given] : options) {
    if (is_given && !Asks(given, part))
      throw InvalidInput("{}: is of part {}, which --parts leaves out: wanted that part too, or no {}", option, part,
                         option);
  }
}

/// One call's work: what it was asked, and what it has measured so far.
class Measuring {
 public:
  Measuring(const FidelityArguments& arguments, const Suite& suite)
      : arguments_(arguments),
        out_(arguments.out),
        suite_(suite),
        worlds_(WorldsOf(suite_)),
        subject_(SubjectOf(suite_)),
        model_(ReadEvacConfig(worlds_.model.evac->config)),
        chunk_(static_cast<int>(model_.chunk)),
        judge_(arguments.classifier),
        replayed_(ToTheLastAction(suite_.tasks, suite_)) {
    input_.suite_hash = suite_.hash;
    input_.model_hash = worlds_.model.evac->hash;
  }

  /// What would else be found out when reality was already asked.
  void Check() {
    if (!arguments_.reality.empty()) shared_ = SharedWith(arguments_.reality, subject_);
    judge_.RequireKnows(suite_.tasks);
    if (Asks(arguments_, "counterfactual")) Counterfactuals({}, replayed_, 1);
  }

  ExitCode Closed() {
    Store store = Store::CreateOrContinue(out_ / "closed", {.suite_text = suite_.text,
                                                            .suite_hash = suite_.hash,
                                                            .suite_path = fs::absolute(suite_.path).lexically_normal().string(),
                                                            .evac_version = EVAC_VERSION});
    RequireSameParts();
    StateSubject(out_, subject_);
    TakeOver(store);
    const ExitCode exit_code = Evaluate(suite_, store, {.part_of = "evac fidelity"});
    if (exit_code != ExitCode::kOk) return exit_code;
    OracleJudge oracle(store);  // whatever judges the suite asks for: it says what is true
    JudgeWithProgress(oracle, store, {});
    judge_.Rate(store);
    const OutcomesOf outcomes(store, judge_.name());
    for (const Episode& episode : store.Episodes()) {
      if (episode.key.world != worlds_.real.name) continue;
      const EpisodeKey again{episode.key.pair, worlds_.again.name}, model{episode.key.pair, worlds_.model.name};
      input_.rows.push_back({"closed_loop", episode.key.pair, outcomes.Truth(episode.key), outcomes.Truth(again),
                             outcomes.Said(model), outcomes.Clip(episode.key), outcomes.Clip(model)});
    }
    input_.parts.push_back(EpisodesOf("closed", store));
    input_.judge = judge_.QualityOn(store, worlds_.real.name, out_ / "masked");
    return ExitCode::kOk;
  }

  void Open() {
    const Store closed = Store::Open(out_ / "closed", Store::Mode::kReadOnly);
    const std::vector<Replay> replays = ReplaysOf(closed, worlds_.real.name, suite_);
    Store store = RunReplays(OpenRun(), replays);
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
    input_.parts.push_back(EpisodesOf("open", store, replays));
  }

  /// What policies chose in the model, done in reality: whether the model is wrong about what it is told, or policies are
  /// led astray by what it shows them.
  void Executed() {
    const Store closed = Store::Open(out_ / "closed", Store::Mode::kReadOnly);
    const std::vector<Replay> replays = ReplaysOf(closed, worlds_.model.name, suite_);
    const Store store = RunReplays(ExecutedRun(), replays);
    const OutcomesOf imagined(closed, judge_.name()), truth(store, judge_.name());
    for (const Replay& replay : replays) {
      const EpisodeKey really{replay.pair, worlds_.again.name}, model{replay.pair, worlds_.model.name};
      input_.rows.push_back({"executed", replay.pair, truth.Truth(really), std::nullopt, imagined.Said(model),
                             truth.Clip(really), imagined.Clip(model)});
    }
    input_.parts.push_back(EpisodesOf("executed", store, replays));
  }

  void Counterfactual() {
    const Store closed = Store::Open(out_ / "closed", Store::Mode::kReadOnly);
    const OutcomesOf outcomes(closed, judge_.name());
    std::vector<Replay> successes = ReplaysOf(closed, worlds_.real.name, suite_);
    std::erase_if(successes, [&](const Replay& replay) {
      return outcomes.Truth({replay.pair, worlds_.real.name}) != std::optional<bool>(true);
    });
    for (const evac::Counterfactual& kind : Counterfactuals(std::move(successes), replayed_, arguments_.counterfactual_states)) {
      Store store = RunReplays(CounterfactualRun(kind), kind.replays);
      judge_.Rate(store);
      const OutcomesOf found(store, judge_.name());
      for (const Replay& replay : kind.replays) {
        const EpisodeKey real{replay.pair, worlds_.real.name}, model{replay.pair, worlds_.model.name};
        input_.rows.push_back({"counterfactual:" + kind.name, replay.pair, found.Truth(real), std::nullopt,
                               found.Said(model), found.Clip(real), found.Clip(model)});
      }
      input_.parts.push_back(EpisodesOf("counterfactual_" + kind.name, store, kind.replays));
    }
  }

  void Horizon() {
    const Store closed = Store::Open(out_ / "closed", Store::Mode::kReadOnly);
    const ReplayRun run = HorizonRun();
    const std::vector<Replay> replays =
        LongRollouts(ReplaysOf(closed, worlds_.real.name, suite_), {arguments_.horizon_states, run.frames});
    const Store store = RunReplays(run, replays);
    const OutcomesOf found(store, judge_.name());
    DriftMeter drift(chunk_);
    for (const Replay& replay : replays)
      AddDrift(replay, found.Clip({replay.pair, worlds_.real.name}), found.Clip({replay.pair, worlds_.model.name}), drift);
    input_.horizon = drift.Chunks();
    input_.parts.push_back(EpisodesOf("horizon", store, replays));
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
  ReplayRun OpenRun() const {
    ReplayRun run = ReplaysIn("open", {worlds_.model});
    run.name = "open loop";
    run.scenes = out_ / "closed";
    return run;
  }
  ReplayRun ExecutedRun() const {
    ReplayRun run = ReplaysIn("executed", {worlds_.again});
    if (!shared_.model) run.reality.clear();  // in another model policies chose other actions
    return run;
  }
  ReplayRun CounterfactualRun(const evac::Counterfactual& kind) const {
    ReplayRun run = ReplaysIn("counterfactual_" + kind.name, {worlds_.real, worlds_.model});
    run.tasks = kind.tasks;
    return run;
  }
  ReplayRun HorizonRun() const {
    ReplayRun run = ReplaysIn("horizon", {worlds_.real, worlds_.model});
    run.frames_per_chunk = static_cast<std::size_t>(chunk_);
    run.frames = static_cast<std::size_t>(arguments_.horizon_chunks) * run.frames_per_chunk;
    run.rule = fmt::format("after {} frames", run.frames);
    for (Task& task : run.tasks) task.max_chunks = static_cast<int>(run.frames) / suite_.chunk_size + 1;
    return run;
  }
  /// A part in that folder of OUT, every replay of it to its last action.
  ReplayRun ReplaysIn(const std::string& folder, const std::vector<SuiteWorld>& worlds) const {
    ReplayRun run{.suite = suite_, .folder = out_ / folder, .name = folder, .tasks = replayed_, .worlds = worlds, .rule = kToTheLastAction};
    run.reality = Earlier(folder);
    run.model_is_the_same = shared_.model;
    return run;
  }

  /// What an earlier call left in OUT goes on as it began, or not at all: found out before hours are spent.
  void RequireSameParts() const {
    if (Asks(arguments_, "open")) RequireSameReplays(OpenRun());
    if (Asks(arguments_, "executed")) RequireSameReplays(ExecutedRun());
    if (Asks(arguments_, "horizon")) RequireSameReplays(HorizonRun());
    if (!Asks(arguments_, "counterfactual")) return;
    for (const evac::Counterfactual& kind : Counterfactuals({}, replayed_, 1)) RequireSameReplays(CounterfactualRun(kind));
  }

  /// That part's run in the folder of `--reality`; empty: none was given.
  fs::path Earlier(const std::string& part) const {
    return arguments_.reality.empty() ? fs::path() : fs::path(arguments_.reality) / part;
  }

  void TakeOver(Store& store) const {
    if (arguments_.reality.empty()) return;
    Declare(suite_, store);
    std::set<EpisodeKey> wanted;
    for (const SuiteWorld& world : {worlds_.real, worlds_.again, worlds_.model}) {
      if (world.evac && !shared_.model) continue;
      for (const SuitePolicy& policy : suite_.policies) {
        if (!shared_.Has(policy.name, policy.checkpoint)) continue;
        for (const Job& job : AllJobs(suite_, world, policy)) wanted.insert(job.key);
      }
    }
    TakeReality(Earlier("closed"), wanted, store);
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
  FidelitySubject subject_;
  SharedSubject shared_ = {};  ///< with the OUT of `--reality`
  nn::ModelConfig model_;
  int chunk_;  ///< K
  FidelityJudge judge_;
  std::vector<Task> replayed_;  ///< the suite's, in which actions are replayed
  FidelityInput input_;
};

}  // namespace

FidelityWorlds WorldsOf(const Suite& suite) {
  const auto the_one = [&](const char* wanted, const std::function<bool(const SuiteWorld&)>& is_it) {
    std::vector<SuiteWorld> found;
    std::ranges::copy_if(suite.worlds, std::back_inserter(found), is_it);
    if (found.size() == 1) return found.front();
    std::string names;
    for (const SuiteWorld& world : found) names += fmt::format("{}{}", names.empty() ? "found " : " and ", world.name);
    throw InvalidInput("{}: field worlds: {}{}wanted {}", suite.path.string(), names, names.empty() ? "" : ", ", wanted);
  };
  FidelityWorlds worlds;
  worlds.real = the_one("one with role: real", [](const SuiteWorld& world) { return world.is_real; });
  worlds.model = the_one("one of type evac", [](const SuiteWorld& world) { return world.evac.has_value(); });
  worlds.again = the_one("another of type mujoco with the real world's profile: reality once more", [&](const SuiteWorld& world) {
    return !world.is_real && world.type == "mujoco" && world.profile == worlds.real.profile;
  });
  return worlds;
}

ExitCode RunFidelity(const FidelityArguments& arguments) {
  for (const std::string& part : arguments.parts) {
    static const std::set<std::string> kParts = {"closed", "open", "executed", "counterfactual", "horizon"};
    if (!kParts.contains(part)) throw InvalidInput("--parts: found '{}', wanted some of closed, open, executed, counterfactual, horizon", part);
  }
  RefuseOptionsOfOtherParts(arguments);
  const CatchInterrupts catch_interrupts;
  const Suite suite = ReadSuite(arguments.suite, arguments.assignments);
  if (suite.recording) return RunRecordedFidelity(arguments, suite);
  Measuring measuring(arguments, suite);
  measuring.Check();
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
