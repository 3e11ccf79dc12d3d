// What the harness adds to a chunk, and what lanes bring: the numbers of docs/performance.md.
#include <benchmark/benchmark.h>
#include <sys/resource.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <fstream>
#include <opencv2/imgproc.hpp>
#include <thread>

#include "core/seed.h"
#include "core/task_page.h"
#include "harness/policy_process.h"
#include "harness/rollout.h"
#include "policies/lcm_policy.h"
#include "tests/support/command.h"
#include "tests/support/temp_folder.h"
#include "worldmodel/sim/mujoco_world.h"

namespace evac {
namespace {

using Clock = std::chrono::steady_clock;

double SecondsSince(Clock::time_point start) { return std::chrono::duration<double>(Clock::now() - start).count(); }

/// A picture with as much to encode as a camera's: edges, gradients, some noise.
cv::Mat CameraLikePicture(int width_px, int height_px, std::uint64_t seed) {
  cv::Mat image(height_px, width_px, CV_8UC3), noise(height_px, width_px, CV_8UC3);
  for (int y = 0; y < height_px; ++y) image.row(y).setTo(cv::Scalar(90 + y / 8, 100 + y / 10, 120));
  SplitMix64 random(seed);
  const auto below = [&](int limit) { return static_cast<int>(random.Next() % static_cast<std::uint64_t>(limit)); };
  for (int i = 0; i < 60; ++i) {
    const cv::Scalar colour(below(255), below(255), below(255));
    cv::circle(image, {below(width_px), below(height_px)}, 4 + below(40), colour, i % 2 == 0 ? -1 : 2, cv::LINE_AA);
  }
  cv::RNG rng(seed);
  rng.fill(noise, cv::RNG::NORMAL, 0, 2);
  return image + noise;
}

/// Answers at once, as a world model on another device would after its time: what is left is the harness.
class WaitingWorld : public World {
 public:
  WaitingWorld(const Task& task, double wait_s) : wait_s_(wait_s) {
    for (std::size_t i = 0; i < task.cameras.size(); ++i)
      step_.observation.images.push_back(CameraLikePicture(task.cameras[i].width_px, task.cameras[i].height_px, i + 1));
    step_.observation.arms = Arms(task.arms.size());
    step_.observation.arms[0].base_from_gripper.translation().x() = 0.4;
  }
  std::string Name() const override { return "waiting"; }
  WorldStep Reset(SceneId, const Task&, const InitialState&, std::uint64_t) override { return step_; }
  std::vector<Advanced> Advance(std::span<const SceneChunk> batch) override {
    const auto start = Clock::now();
    std::this_thread::sleep_for(std::chrono::duration<double>(wait_s_ * static_cast<double>(batch.size())));
    std::vector<Advanced> answers;
    for (const SceneChunk& item : batch) answers.push_back(std::vector<WorldStep>(item.chunk->targets.size(), step_));
    own_s_ += SecondsSince(start);
    return answers;
  }
  double TakeOwnSeconds() { return std::exchange(own_s_, 0.0); }

 private:
  WorldStep step_;
  double wait_s_, own_s_ = 0;
};

/// A policy of evac-policy's, running and greeted.
struct ServedPolicy {
  ServedPolicy(const TempFolder& folder, const Task& task, int chunk_size, std::vector<std::string> words)
      : address(LcmAddress::For((folder / "bench").string())),
        process({.command = WithProgram(std::move(words)),
                 .environment = {{"EVAC_LCM_URL", address.url},
                                 {"EVAC_TOKEN", address.token},
                                 {"EVAC_CHUNK_SIZE", std::to_string(chunk_size)}},
                 .working_directory = {},
                 .log = folder / "policy.log"}),
        link({.address = address}) {
    spec = link.Handshake(HarnessSpec(task, chunk_size), 30);
  }
  static std::vector<std::string> WithProgram(std::vector<std::string> words) {
    words.insert(words.begin(), Binary("evac-policy"));
    return words;
  }

  LcmAddress address;
  PolicyProcess process;
  LcmPolicy link;
  PolicySpec spec;
};

std::vector<Job> Jobs(const Task& task, const std::string& world, int count) {
  std::vector<Job> jobs;
  for (int i = 0; i < count; ++i) {
    const InitialState initial{"7-" + std::to_string(i), static_cast<std::uint64_t>(1000 + i)};
    jobs.push_back({&task, initial, {{task.id, initial.id, "p", "c", 1}, world}});
  }
  return jobs;
}

Store NewStore(const TempFolder& folder, const Task& task, const std::string& world) {
  Store store = Store::CreateOrContinue(
      folder / "run", {.suite_text = "suite: b", .suite_hash = "b", .suite_path = "", .evac_version = "0"});
  store.AddTask(task);
  store.AddWorld({world, "mujoco", true, ""});
  store.AddPolicy({"p", "c", "{}"});
  return store;
}

double Quantile(std::vector<double> values, double q) {
  std::sort(values.begin(), values.end());
  return values.empty() ? 0 : values[static_cast<std::size_t>(q * static_cast<double>(values.size() - 1))];
}

Task ThreeHundredTwentyByFiveTwelve(int views) {
  Task task;
  task.id = "bench";
  task.instruction = "stay";
  task.max_chunks = 12;
  task.still.enabled = false;
  for (int i = 0; i < views; ++i) {
    Camera camera;
    camera.name = "view" + std::to_string(i);
    camera.width_px = 512;
    camera.height_px = 320;
    camera.fx_px = camera.fy_px = 400;
    camera.cx_px = 256;
    camera.cy_px = 160;
    task.cameras.push_back(camera);
  }
  return task;
}

/// Everything but Act's thinking and Advance itself, per chunk of 16 steps: pictures to the policy and its answer back
/// over LCM, checks, stop rule, video. The world takes .3 s per chunk, as a good GPU does.
void OverheadPerChunk(benchmark::State& state) {
  const int lanes = static_cast<int>(state.range(0)), views = static_cast<int>(state.range(1)), steps = 16;
  const TempFolder folder;
  const Task task = ThreeHundredTwentyByFiveTwelve(views);
  Store store = NewStore(folder, task, "waiting");
  ServedPolicy policy(folder, task, steps, {"hold"});
  WaitingWorld world(task, 0.3);
  std::vector<double> overheads_ms;
  auto last = Clock::now();
  RolloutOptions options;
  options.lanes = lanes;
  options.lane = {.chunk_size = steps, .policy_chunk_size = policy.spec.chunk_size, .latency = {}, .video = {}};
  options.on_progress = [&](const Progress& progress) {
    const double round_s = SecondsSince(last) - world.TakeOwnSeconds();
    if (progress.done == 0 && progress.lanes[0].chunks > 1)  // neither the first pictures nor the rows at the end
      overheads_ms.push_back(1000 * round_s / lanes);
    last = Clock::now();
  };
  for (auto _ : state) {
    JobQueue jobs(Jobs(task, "waiting", lanes));
    RunEpisodes(policy.link, world, jobs, store, options);
  }
  state.counters["median_ms_per_chunk"] = Quantile(overheads_ms, 0.5);
  state.counters["p95_ms_per_chunk"] = Quantile(overheads_ms, 0.95);
}
BENCHMARK(OverheadPerChunk)
    ->ArgNames({"lanes", "views"})
    ->ArgsProduct({{1, 2, 4, 8}, {1, 2, 3}})
    ->Iterations(1)
    ->Unit(benchmark::kSecond);

/// Processor time of this process and of those it waited for.
double ProcessorSeconds() {
  double seconds = 0;
  for (const int whose : {RUSAGE_SELF, RUSAGE_CHILDREN}) {
    rusage usage{};
    ::getrusage(whose, &usage);
    for (const timeval& time : {usage.ru_utime, usage.ru_stime})
      seconds += static_cast<double>(time.tv_sec) + 1e-6 * static_cast<double>(time.tv_usec);
  }
  return seconds;
}

struct LanesRun {
  std::int64_t chunks = 0;
  double wall_s = 0;
};

/// Eight episodes of the demo, drawing and the policy's process included, which have ended when it returns.
LanesRun RunLanes(int lanes, benchmark::State& state) {
  const int episodes = 8;
  const std::filesystem::path sim = std::filesystem::path(EVAC_SOURCE_DIR) / "worldmodel/sim";
  const TempFolder folder;
  const Task task = ReadTaskPage(sim / "scenes/take_bottle.yaml");
  Store store = NewStore(folder, task, "real");
  ServedPolicy policy(folder, task, 8, {"visual_pick"});
  sim::MujocoWorld world({"real", sim / "profiles/real.yaml", static_cast<int>(std::thread::hardware_concurrency())});
  world.Reset(0, task, {"warm", 1}, 1);
  RolloutOptions options;
  options.lanes = lanes;
  options.lane = {.chunk_size = 8, .policy_chunk_size = policy.spec.chunk_size, .latency = {}, .video = {.scale = 4}};
  LanesRun run;
  for (auto _ : state) {
    const auto start = Clock::now();
    JobQueue jobs(Jobs(task, "real", episodes));
    RunEpisodes(policy.link, world, jobs, store, options);
    run.wall_s += SecondsSince(start);
  }
  for (const Episode& episode : store.Episodes()) run.chunks += episode.chunks;
  return run;
}

/// What more lanes bring: never more than the processors that one lane leaves idle.
void MujocoLanes(benchmark::State& state) {
  const double before_s = ProcessorSeconds();
  const LanesRun run = RunLanes(static_cast<int>(state.range(0)), state);
  state.counters["chunks_per_s"] = static_cast<double>(run.chunks) / run.wall_s;
  state.counters["processors_busy"] = (ProcessorSeconds() - before_s) / run.wall_s;
}
BENCHMARK(MujocoLanes)
    ->ArgName("lanes")
    ->Arg(1)
    ->Arg(2)
    ->Arg(4)
    ->Arg(8)
    ->Iterations(1)
    ->UseRealTime()
    ->Unit(benchmark::kSecond);

/// This process's memory that is its own, MiB.
double ResidentMib() {
  std::ifstream statm("/proc/self/statm");
  double pages = 0, resident = 0, shared = 0;
  statm >> pages >> resident >> shared;
  return (resident - shared) * static_cast<double>(::sysconf(_SC_PAGESIZE)) / (1 << 20);
}

/// Answers every observation with the arms where they are.
class StandingPolicy : public Policy {
 public:
  std::string Name() const override { return "stands"; }
  void Reset(SceneId, const Task&, std::uint64_t) override {}
  std::vector<Acted> Act(std::span<const SceneObservation> batch) override {
    std::vector<Acted> answers;
    for (const SceneObservation& asked : batch)
      answers.push_back(ActionChunk{std::vector<Arms>(16, asked.observation->arms), false, 0});
    return answers;
  }
};

/// What the loop keeps of episodes that are done: memory after some hundreds, and after all.
void MemoryOfFinishedEpisodes(benchmark::State& state) {
  const int episodes = static_cast<int>(state.range(0));
  const TempFolder folder;
  Task task = ThreeHundredTwentyByFiveTwelve(1);
  task.cameras[0].width_px = task.cameras[0].height_px = 64;
  task.max_chunks = 2;
  Store store = NewStore(folder, task, "waiting");
  WaitingWorld world(task, 0);
  StandingPolicy policy;
  double early_mib = 0;
  RolloutOptions options;
  options.lanes = 4;
  options.lane = {.chunk_size = 16, .policy_chunk_size = 16, .latency = {}, .video = {}};
  options.on_progress = [&](const Progress& progress) {
    if (early_mib == 0 && progress.done >= episodes / 4) early_mib = ResidentMib();
  };
  for (auto _ : state) {
    JobQueue jobs(Jobs(task, "waiting", episodes));
    RunEpisodes(policy, world, jobs, store, options);
  }
  state.counters["mib_after_a_quarter"] = early_mib;
  state.counters["mib_after_all"] = ResidentMib();
}
BENCHMARK(MemoryOfFinishedEpisodes)->Arg(2000)->Iterations(1)->Unit(benchmark::kSecond);

/// One frame of 320x512.
void EncodeOneFrame(benchmark::State& state) {
  const TempFolder folder;
  VideoWriter writer(folder / "video.mp4", {});
  std::vector<cv::Mat> pictures;
  for (std::uint64_t i = 0; i < 8; ++i) pictures.push_back(CameraLikePicture(512, 320, 5));
  std::size_t frame = 0;
  for (auto _ : state) {
    cv::Mat& picture = pictures[frame++ % pictures.size()];
    cv::circle(picture, {static_cast<int>(frame * 3 % 512), 160}, 25, cv::Scalar(40, 160, 60), -1);
    writer.Append(picture);
  }
  writer.Finish();
}
BENCHMARK(EncodeOneFrame)->Iterations(600)->UseRealTime()->Unit(benchmark::kMillisecond);

/// A desk's clip: pictures of 64x192 with a sensor's noise, each pixel 4x4 in the video. Processor time of all threads.
void EncodeADeskClip(benchmark::State& state) {
  const TempFolder folder;
  const std::string preset = kVideoPresets[state.range(0)];
  std::vector<cv::Mat> pictures;
  for (std::uint64_t i = 0; i < 100; ++i) {
    cv::Mat picture = CameraLikePicture(192, 64, 5), noise(picture.size(), CV_16SC3);
    cv::circle(picture, {static_cast<int>(i), 32}, 8, cv::Scalar(40, 160, 60), -1);
    cv::RNG(i).fill(noise, cv::RNG::NORMAL, 0, 2.5);
    cv::add(picture, noise, picture, cv::noArray(), CV_8U);
    pictures.push_back(picture);
  }
  for (auto _ : state) {
    VideoWriter writer(folder / "video.mp4", {.preset = preset, .scale = 4});
    for (const cv::Mat& picture : pictures) writer.Append(picture);
    writer.Finish();
  }
  double squared = 0;
  const std::vector<cv::Mat> decoded = ReadAllFrames(folder / "video.mp4");
  for (std::size_t i = 0; i < pictures.size(); ++i) {
    cv::Mat small;
    cv::resize(decoded[i], small, pictures[i].size(), 0, 0, cv::INTER_AREA);
    squared += cv::norm(small, pictures[i], cv::NORM_L2SQR) / static_cast<double>(small.total() * 3 * pictures.size());
  }
  state.SetLabel(preset);
  state.counters["kB"] = static_cast<double>(std::filesystem::file_size(folder / "video.mp4")) / 1000;
  state.counters["dB"] = 10 * std::log10(255 * 255 / squared);
}
BENCHMARK(EncodeADeskClip)->DenseRange(0, 2)->Iterations(5)->MeasureProcessCPUTime()->Unit(benchmark::kMillisecond);

}  // namespace
}  // namespace evac
