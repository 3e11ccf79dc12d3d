// What a store costs that keeps very many episodes: the numbers of docs/performance.md.
#include <benchmark/benchmark.h>
#include <fmt/format.h>

#include "core/store.h"
#include "reports/tally.h"
#include "tests/support/temp_folder.h"

namespace evac {
namespace {

constexpr int kBatch = 1000, kTasks = 4, kPolicies = 5, kStates = 1000;

Store NewStore(const TempFolder& folder) {
  Store store = Store::CreateOrContinue(
      folder / "run", {.suite_text = "suite: b", .suite_hash = "b", .suite_path = "", .evac_version = "0"});
  for (int i = 0; i < kTasks; ++i) {
    Task task;
    task.id = fmt::format("task{}", i);
    store.AddTask(task);
  }
  store.AddWorld({"real", "mujoco", true, ""});
  store.AddWorld({"sim", "mujoco", false, ""});
  for (int i = 0; i < kPolicies; ++i) store.AddPolicy({"p", fmt::format("c{}", i), "{}"});
  return store;
}

/// The keys of a long run, in its order: cell by cell, state by state, seed by seed.
EpisodeKey KeyOf(int index, int episodes) {
  const int cells = kTasks * kPolicies * 2, per_cell = std::max(1, episodes / cells);
  const int cell = std::min(index / per_cell, cells - 1), in_cell = index - cell * per_cell;
  return {{fmt::format("task{}", cell % kTasks), fmt::format("41-{:04d}", in_cell % kStates), "p",
           fmt::format("c{}", cell / kTasks % kPolicies), static_cast<std::uint64_t>(1 + in_cell / kStates)},
          cell / kTasks / kPolicies == 0 ? "real" : "sim"};
}

EpisodeRecord RecordOf(int index, int episodes, int steps) {
  EpisodeRecord record;
  record.episode.key = KeyOf(index, episodes);
  record.episode.chunks = steps / 10;
  record.episode.stop = StopReason::kStill;
  record.episode.stop_reason = "at rest: 0.8 mm, 0.4 deg and closure 0.01 over 2 chunks";
  record.episode.observations.assign(static_cast<std::size_t>(steps + 1), {{}, Arms(1), false});
  record.episode.commands.assign(static_cast<std::size_t>(steps), Arms(1));
  return record;
}

void Fill(Store& store, int episodes, int steps) {
  std::vector<EpisodeRecord> batch;
  for (int i = 0; i < episodes; ++i) {
    batch.push_back(RecordOf(i, episodes, steps));
    if (static_cast<int>(batch.size()) < kBatch && i + 1 < episodes) continue;
    store.AddAll(batch);
    batch.clear();
  }
}

void Judge(Store& store, int episodes) {
  std::vector<Verdict> verdicts;
  for (int i = 0; i < episodes; ++i) {
    Verdict& verdict = verdicts.emplace_back();
    verdict.episode_id = KeyOf(i, episodes).Id();
    verdict.judge = "oracle";
    verdict.label = i % 3 == 0 ? Label::kFailure : Label::kSuccess;
    verdict.reason = "all stages reached, held 1.0 s";
    if (static_cast<int>(verdicts.size()) < kBatch && i + 1 < episodes) continue;
    store.AddVerdicts(verdicts);
    verdicts.clear();
  }
}

/// 10^5 episodes of 50 steps, a thousand a transaction, on disk.
void InsertEpisodes(benchmark::State& state) {
  const int episodes = static_cast<int>(state.range(0));
  for (auto _ : state) {
    state.PauseTiming();
    const TempFolder folder;
    Store store = NewStore(folder);
    state.ResumeTiming();
    Fill(store, episodes, 50);
  }
  state.counters["episodes_per_s"] = benchmark::Counter(static_cast<double>(episodes), benchmark::Counter::kIsRate);
}
BENCHMARK(InsertEpisodes)->Arg(100'000)->Iterations(1)->UseRealTime()->Unit(benchmark::kSecond);

/// `evac ls RUN --rates`: every cell's rate with its interval, from the rows.
void RatesOfARun(benchmark::State& state) {
  const int episodes = static_cast<int>(state.range(0));
  const TempFolder folder;
  Store store = NewStore(folder);
  Fill(store, episodes, 1);
  Judge(store, episodes);
  for (auto _ : state) benchmark::DoNotOptimize(TallyRates(store, "oracle", .95));
}
BENCHMARK(RatesOfARun)->Arg(10'000)->Arg(100'000)->Arg(1'000'000)->Iterations(3)->UseRealTime()->Unit(benchmark::kSecond);

}  // namespace
}  // namespace evac
