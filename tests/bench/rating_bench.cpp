// What the lead's board of a large rating session costs: docs/performance.md.
#include <benchmark/benchmark.h>
#include <fmt/format.h>

#include "core/hash.h"
#include "core/seed.h"
#include "core/store_study.h"
#include "judges/rating_board.h"
#include "tests/support/temp_folder.h"

namespace evac {
namespace {

constexpr int kRaters = 200, kRatersPerClip = 3, kTasks = 4;
constexpr std::int64_t kNow_ms = 1'800'000'000'000;

std::vector<StudyClip> ClipsOf(std::int64_t count, const std::vector<StudyRubric>& rubrics) {
  std::vector<StudyClip> clips(static_cast<std::size_t>(count));
  for (std::size_t i = 0; i < clips.size(); ++i) {
    const StudyRubric& rubric = rubrics[i % kTasks];
    clips[i].run = "run";
    clips[i].task = rubric.task;
    clips[i].rubric_hash = rubric.hash;
    clips[i].initial_state = fmt::format("41-{:05d}", i / (2 * kTasks));
    clips[i].world = i / kTasks % 2 == 0 ? "real" : "evac";
    clips[i].is_real = clips[i].world == "real";
    clips[i].episode = fmt::format("{}/{}/pick@1/{}", rubric.task, clips[i].initial_state, clips[i].world);
    clips[i].policy = "pick";
    clips[i].checkpoint = "1";
    clips[i].file = fmt::format("clips/{}.mp4", i);
    clips[i].views = "[]";
    clips[i].frames = 80;
  }
  return clips;
}

/// Three of the raters see each clip, one vote in ten is another one than the clip's own.
void Vote(StudyStore& store, const std::vector<StudyClip>& clips) {
  SplitMix64 draws(7);
  store.Begin();
  std::vector<std::int64_t> raters;
  for (int i = 0; i < kRaters; ++i) raters.push_back(store.ImportedRater(fmt::format("rater {}", i), kNow_ms).id);
  for (const StudyClip& clip : clips) {
    for (std::uint64_t k = 0; k < kRatersPerClip; ++k) {
      const std::int64_t rater = raters[(static_cast<std::uint64_t>(clip.id) * 7 + k * 61) % kRaters];
      const std::string id = fmt::format("{:032x}", clip.id * kRatersPerClip + static_cast<std::int64_t>(k));
      Presentation presentation;
      presentation.id = id;
      presentation.rater = rater;
      presentation.clip = clip.id;
      presentation.order_index = static_cast<int>(clip.id);
      presentation.state = "answered";
      store.AddPresentations({&presentation, 1});
      HumanVerdict verdict;
      verdict.client_uuid = "uuid " + id;
      verdict.presentation = id;
      verdict.rater = rater;
      verdict.clip = clip.id;
      verdict.label = (clip.id % 3 != 0) != (draws.Below(10) == 0) ? "success" : "failure";
      verdict.created_ms = kNow_ms;
      verdict.rt_ms = 9000;
      store.AddVerdict(verdict);
    }
  }
  store.Commit();
}

/// @param seen_before  by the server that is asked: it reads what is new alone.
void Board(benchmark::State& state, bool seen_before) {
  const TempFolder folder;
  StudyInfo info;
  info.name = "large";
  info.raters_per_clip = kRatersPerClip;
  StudyStore store = StudyStore::Create(folder / "study", info);
  std::vector<StudyRubric> rubrics;
  for (int i = 0; i < kTasks; ++i) {
    const std::string document = fmt::format(R"({{"instruction": "task {}", "version": "v1"}})", i);
    rubrics.push_back({Sha256Hex(document), fmt::format("task{}", i), document});
  }
  store.AddWave(ClipsOf(state.range(0) / kRatersPerClip, rubrics), rubrics);
  Vote(store, store.Clips());
  std::size_t bytes = 0;
  RatingTally tally;
  if (seen_before) tally.Read(store);
  for (auto _ : state) bytes = RatingBoard(store, tally, kNow_ms, {.from = 0, .count = 200}).dump().size();
  state.counters["MB"] = static_cast<double>(bytes) / 1e6;
}
BENCHMARK_CAPTURE(Board, first, false)
    ->Arg(100'000)
    ->Unit(benchmark::kMillisecond)
    ->Iterations(1)
    ->Name("LeadBoard/first/votes");
BENCHMARK_CAPTURE(Board, again, true)
    ->Arg(1'000)
    ->Arg(10'000)
    ->Arg(100'000)
    ->Unit(benchmark::kMillisecond)
    ->Name("LeadBoard/again/votes");

}  // namespace
}  // namespace evac
