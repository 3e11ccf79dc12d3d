// What reports and gates cost on large runs: the numbers of docs/performance.md.
#include <benchmark/benchmark.h>
#include <fmt/format.h>
#include <sys/resource.h>

#include <cstdlib>
#include <fstream>

#include "core/statistics/paired_bootstrap.h"
#include "core/store.h"
#include "reports/gate.h"
#include "reports/report_files.h"
#include "tests/support/temp_folder.h"

namespace evac {
namespace {

constexpr int kTasks = 4, kBatch = 5000;

struct Shape {
  int episodes = 0, policies = 1, judges = 1;
};

/// Per (task, policy): states one after the other, in real and sim alike.
EpisodeKey KeyOf(int index, const Shape& shape) {
  const int world = index % 2, task = index / 2 % kTasks, policy = index / 2 / kTasks % shape.policies;
  const int state = index / 2 / kTasks / shape.policies;
  return {{fmt::format("task{}", task), fmt::format("41-{:05d}", state), "p", fmt::format("c{}", policy), 1},
          world == 0 ? "real" : "sim"};
}

void Declare(Store& store, int policies) {
  for (int i = 0; i < kTasks; ++i) {
    Task task;
    task.id = fmt::format("task{}", i);
    task.rubric.version = "v1";
    task.rubric.stages.resize(2);
    task.rubric.stages[0].name = "reach";
    task.rubric.stages[1].name = "grasp";
    store.AddTask(task);
  }
  store.AddWorld({"real", "mujoco", true, ""});
  store.AddWorld({"sim", "mujoco", false, ""});
  for (int i = 0; i < policies; ++i) store.AddPolicy({"p", fmt::format("c{}", i), "{}"});
}

Verdict VerdictOf(const EpisodeKey& key, int index, int judge) {
  Verdict verdict;
  verdict.episode_id = key.Id();
  verdict.judge = judge == 0 ? "oracle" : fmt::format("human:{}", judge);
  verdict.label = (index * 7 + judge * (index % 50 == 0)) % 3 == 0 ? Label::kFailure : Label::kSuccess;
  verdict.stages = {{"reach", true}, {"grasp", verdict.label == Label::kSuccess}};
  verdict.reason = "all stages reached, held 1.0 s";
  return verdict;
}

/// A run on disk without videos.
void Write(const std::filesystem::path& folder, const Shape& shape) {
  Store store = Store::CreateOrContinue(folder, {"suite: b", "b", "", "0"});
  Declare(store, shape.policies);
  std::vector<EpisodeRecord> records;
  std::vector<Verdict> verdicts;
  for (int i = 0; i < shape.episodes; ++i) {
    EpisodeRecord& record = records.emplace_back();
    record.episode.key = KeyOf(i, shape);
    record.episode.stop = StopReason::kStill;
    record.episode.stop_reason = "at rest: 0.8 mm, 0.4 deg and closure 0.01 over 2 chunks";
    for (int judge = 0; judge < shape.judges; ++judge) verdicts.push_back(VerdictOf(record.episode.key, i, judge));
    if (static_cast<int>(records.size()) < kBatch && i + 1 < shape.episodes) continue;
    store.AddAll(records);
    store.AddVerdicts(verdicts);
    records.clear();
    verdicts.clear();
  }
}

double PeakMebibytes() {
  rusage usage{};
  getrusage(RUSAGE_SELF, &usage);
  return static_cast<double>(usage.ru_maxrss) / 1024;
}

/// For tests/bench/report_paint.py.
void KeepPage(const std::string& html) {
  if (const char* path = std::getenv("EVAC_BENCH_PAGE")) std::ofstream(path, std::ios::binary) << html;
}

/// Everything `evac report` writes but the charts' files, from a store on disk.
void ReportOfARun(benchmark::State& state) {
  const TempFolder folder;
  Write(folder / "run", {static_cast<int>(state.range(0)), 5, 3});
  std::size_t page = 0;
  for (auto _ : state) {
    const ReportData report =
        ReportDataOf(Summarise(ReadRun(Store::Open(folder / "run", Store::Mode::kReadOnly)), {}));
    for (const ReportFile& file : ReportFiles(report, {"..", "evac bench"})) {
      if (file.name == "index.html") page = file.bytes.size(), KeepPage(file.bytes);
      benchmark::DoNotOptimize(file.bytes.data());
    }
  }
  state.counters["page_MB"] = static_cast<double>(page) / 1e6;
  state.counters["peak_MiB"] = PeakMebibytes();
}
BENCHMARK(ReportOfARun)->Arg(10'000)->Arg(100'000)->Unit(benchmark::kSecond)->Iterations(1);

/// `evac gate`: both runs read from disk, six rules.
void GateOfARun(benchmark::State& state) {
  const TempFolder folder;
  const Shape shape{static_cast<int>(state.range(0)), 1, 1};
  Write(folder / "run", shape);
  Write(folder / "baseline", shape);
  const GateRules rules = ReadGateRules(Config::FromText(
      "gates:\n"
      "  - {name: a, test: paired_mcnemar, world: sim}\n  - {name: b, test: noninferiority, world: sim}\n"
      "  - {name: c, test: savi, world: sim}\n  - {name: d, test: boschloo, world: sim, task: task0}\n"
      "  - {name: e, test: ci_lower, world: sim, at_least: 0.5}\n  - {name: f, test: error_share, world: sim, at_most: "
      "0}\n",
      "gate.yaml"));
  SummaryOptions options;
  options.bootstrap_replicates = 1;
  const auto read = [&](const char* name) {
    return Summarise(ReadRun(Store::Open(folder / name, Store::Mode::kReadOnly)), options);
  };
  for (auto _ : state) {
    const RunSummary run = read("run");
    const PinnedResult baseline = ReadPinned(PinnedJson(Pin(read("baseline"), "main")), "pinned.json");
    benchmark::DoNotOptimize(Decide(rules, {run, "run", {}}, &baseline).decision.outcome);
  }
}
BENCHMARK(GateOfARun)->Arg(1000)->Arg(10'000)->Unit(benchmark::kSecond);

/// B = 2000 over 10^4 states and 20 policies.
void BootstrapOfManyStates(benchmark::State& state) {
  TaskOutcomes task;
  for (int policy = 0; policy < 20; ++policy) {
    PointOutcomes& point = task.points.emplace_back();
    for (int i = 0; i < state.range(0); ++i) {
      point.real.push_back({(i * 31 + policy * 17) % 100 < 5 * policy, 1});
      point.sim.push_back({(i * 37 + policy * 13) % 100 < 5 * policy + 3, 1});
    }
  }
  for (auto _ : state) benchmark::DoNotOptimize(PairedStateBootstrap({task}).method.data());
}
BENCHMARK(BootstrapOfManyStates)->Arg(1000)->Arg(10'000)->Unit(benchmark::kSecond)->Iterations(1);

}  // namespace
}  // namespace evac
