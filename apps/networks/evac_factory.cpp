#include <fmt/ranges.h>

#include <algorithm>
#include <cstdio>
#include <mutex>
#include <set>

#include "apps/factory.h"
#include "apps/network_parts.h"
#include "apps/recorded_suite.h"
#include "worldmodel/evac_config.h"
#include "worldmodel/evac_world.h"
#include "worldmodel/nn/memory.h"
#include "worldmodel/nn/weights.h"
#include "worldmodel/shard_writer.h"
#include "worldmodel/trained_for.h"

namespace evac {
namespace {

/// The page's pose maps, as the suite has them drawn.
PoseMapOptions PoseMapsOf(const SuiteEvac& evac, nn::ModelConfig config) {
  config.pose_map.scaled |= evac.pose_map_scales;
  return PoseMapOptions::Of(config);
}

ImaginerOptions OptionsOf(const SuiteEvac& evac, const nn::ModelConfig& config, int threads_per_scene) {
  const auto has = [&](const char* quirk) {
    return std::find(evac.quirks.begin(), evac.quirks.end(), quirk) != evac.quirks.end();
  };
  ImaginerOptions options;
  options.sampler.solver = evac.solver == "dpm" ? nn::Solver::kDpmSolver : nn::Solver::kDdim;
  options.sampler.steps = evac.steps;
  options.sampler.eta = evac.eta;
  options.sampler.guidance = evac.cfg;
  options.sampler.guidance_rescale = evac.cfg_rescale;
  options.sampler.memory_not_scaled = has("memory_not_scaled");
  options.sampler.residual_noise = has("residual_noise");
  const TrainedFor trained = TrainedFor::Read(evac.weights);
  options.conditioning.statistics = trained.StatisticsOr(evac.statistics);
  // Others' weights were trained with the reference's 3 whatever lay between two frames, as `evac imagine` takes it.
  if (trained.period_s) options.conditioning.stride = evac.period_s * kStatisticsFrames_hz;
  options.conditioning.pose_map = PoseMapsOf(evac, config);
  options.conditioning.pose_map.draw_behind_camera = has("draw_behind_camera");
  options.decoded_start = has("decoded_start");
  options.identity = fmt::format("{} threads {}", evac.hash, threads_per_scene);
  if (evac.cache_folder) options.cache = ChunkCacheOptions{*evac.cache_folder, evac.cache_limit_gb};
  return options;
}

/// The paper's way: each imagined episode starts from the real run's first frame of the same initial state.
InitialScene SeenInRealRun(const Store* store, const std::string& world, const Task& task,
                           const InitialState& initial) {
  std::optional<InitialScene> scene;
  if (store != nullptr) scene = store->LoadInitialScene(task.id, initial.id);
  if (scene) return *std::move(scene);
  throw InvalidInput("world {}: nobody has seen task {}, initial state {}: run the real world first, into the same run",
                     world, task.id, initial.id);
}

FirstScene FirstSceneOf(const Suite& suite, const Store* store, const std::string& world) {
  if (suite.recording) {
    return [suite](const Task&, const InitialState& initial) { return InitialSceneOf(RecordingOf(suite, initial)); };
  }
  return [store, world](const Task& task, const InitialState& initial) {
    return SeenInRealRun(store, world, task, initial);
  };
}

/// On stderr, once: parts of one command make the same world several times.
void Warn(const std::string& sentence) {
  static std::mutex mutex;
  static std::set<std::string> said;
  const std::lock_guard lock(mutex);
  if (said.insert(sentence).second) std::fprintf(stderr, "evac: warning: %s\n", sentence.c_str());
}

std::unique_ptr<const nn::EvacModel> Load(const SuiteEvac& evac, const nn::ModelConfig& config) try {
  nn::LoadReport report;
  nn::LoadOptions options;
  if (evac.bf16) options = {.dtype = at::kBFloat16, .products = at::kBFloat16};
  auto model = std::make_unique<const nn::EvacModel>(nn::LoadModel(evac.weights, config, options, &report));
  if (!report.schedule.empty()) Warn(fmt::format("{}: {}", evac.weights.string(), report.schedule));
  return model;
} catch (const TensorError& error) {
  throw InvalidInput("{}", error.what());
}

/// Weights that say what they were trained for are asked for nothing else.
void CheckTrainedFor(const SuiteEvac& evac, const nn::ModelConfig& config, const std::string& name,
                     const std::vector<Task>& tasks) {
  const TrainedFor trained = TrainedFor::Read(evac.weights);
  const std::string who = fmt::format("world {}", name);
  if (!trained.statistics && !evac.statistics)
    Warn(fmt::format("{}: neither the suite nor {} says the statistics of the arms' motion: taken are AgiBot World's",
                     who, evac.weights.string()));
  trained.StatisticsOr(evac.statistics);
  trained.CheckPeriod(evac.period_s, who + ": field period_s");
  trained.CheckPoseMap(PoseMapWords(PoseMapsOf(evac, config)), who);
  for (const Task& task : tasks) {
    const std::string of_task = fmt::format("{}: task {}", who, task.id);
    trained.CheckCameras(NamesOf(task.cameras), of_task);
    trained.CheckArms(task.arms, of_task);
    CheckViews(task, config.views, who);
  }
}

/// The sampler takes no more steps than the page's schedule has.
void CheckSteps(const SuiteEvac& evac, const nn::ModelConfig& config, const std::string& name) {
  if (evac.steps > config.schedule.steps)
    throw InvalidInput("world {}: field steps: found {}, wanted at most {}, as many as schedule.steps of {}", name, evac.steps,
                       config.schedule.steps, evac.config.string());
}

/// How a network was trained to see recordings.
struct Sight {
  double period_s;
  std::vector<std::string> cameras;

  std::string Words() const {
    return fmt::format("frames {:.4g} s apart of {}", period_s, fmt::join(cameras, ", "));
  }
};

Sight SightOf(const SuiteWorld& world, const std::filesystem::path& folder) try {
  const TrainedFor trained = TrainedFor::Read(world.evac->weights);
  trained.CheckPeriod(world.evac->period_s, fmt::format("world {}: field period_s", world.name));
  if (!trained.cameras.empty()) return {world.evac->period_s, trained.cameras};
  std::vector<std::string> cameras = CamerasIn(folder);
  const auto views = static_cast<std::size_t>(ReadEvacConfig(world.evac->config).views);
  if (cameras.size() > views) cameras.resize(views);  // fewer are refused where an episode begins
  return {world.evac->period_s, std::move(cameras)};
} catch (const TensorError& error) {
  throw InvalidInput("{}", error.what());
}

/// The one sight of all the suite's networks.
Sight SightOf(const Suite& suite, const std::filesystem::path& folder) try {
  const SuiteWorld* first = nullptr;
  Sight wanted{};
  for (const SuiteWorld& world : suite.worlds) {
    if (!world.evac) continue;
    const Sight own = SightOf(world, folder);
    if (first == nullptr) {
      first = &world;
      wanted = own;
    }
    if (own.Words() == wanted.Words()) continue;
    throw InvalidInput("{}: field recording: world {} is to see {}, world {} {}: wanted a suite for each",
                       suite.path.string(), first->name, wanted.Words(), world.name, own.Words());
  }
  return wanted;
} catch (const Error& error) {
  throw error.Called(kSuiteError);
}

}  // namespace

Recording ReadAsTrained(const Suite& suite, const std::filesystem::path& folder) {
  const Sight wanted = SightOf(suite, folder);
  return BegunFrom(ReadRecording(folder, {.cameras = wanted.cameras}), wanted.period_s);
}

void CheckNetwork(const SuiteWorld& world, const std::vector<Task>& tasks) try {
  const nn::ModelConfig config = ReadEvacConfig(world.evac->config);
  CheckSteps(*world.evac, config, world.name);
  nn::FileWeights(world.evac->weights, config);
  CheckTrainedFor(*world.evac, config, world.name, tasks);
} catch (const TensorError& error) {
  throw InvalidInput("{}", error.what());
}

std::unique_ptr<World> MakeEvacWorld(const SuiteWorld& world, const Suite& suite, const Store* store) {
  const SuiteEvac& evac = *world.evac;
  const nn::ModelConfig config = ReadEvacConfig(evac.config);
  const int threads = Threads(suite);
  const ImaginerOptions options =
      OptionsOf(evac, config, evac.all_threads_per_scene ? threads : 1);
  nn::KeepFreedMemory();
  auto model = Load(evac, config);
  DemandUnchanged(evac);  // what is stored and cached bears the suite's hash
  return std::make_unique<EvacWorld>(Imaginer(std::move(model), options), FirstSceneOf(suite, store, world.name),
                                     EvacWorldOptions{.name = world.name,
                                                      .period_s = evac.period_s,
                                                      .threads = threads,
                                                      .all_threads_per_scene = evac.all_threads_per_scene});
}

}  // namespace evac
