#include "apps/collect_recipe.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <set>

#include "apps/network_parts.h"
#include "core/config.h"
#include "core/file.h"
#include "core/geometry.h"
#include "core/hash.h"
#include "core/recording_writer.h"
#include "core/scene_files.h"
#include "core/seed.h"
#include "core/task_page.h"
#include "policies/explorer.h"
#include "policies/swaying_policy.h"
#include "policies/visual_pick.h"
#include "worldmodel/sim/profile.h"
#include "worldmodel/sim/scene_page.h"

namespace evac {
namespace {

namespace fs = std::filesystem;

/// Parameters of visual_pick that a recipe may draw, and where they go.
struct PickParameter {
  const char* name;
  double VisualPickOptions::*field;
};
constexpr PickParameter kPickParameters[] = {{"noise_m", &VisualPickOptions::noise_m},
                                             {"request_noise_m", &VisualPickOptions::request_noise_m},
                                             {"place_noise_m", &VisualPickOptions::place_noise_m},
                                             {"high_m", &VisualPickOptions::high_m},
                                             {"turn_deg", &VisualPickOptions::turn_deg},
                                             {"hurry", &VisualPickOptions::hurry},
                                             {"late_close_s", &VisualPickOptions::late_close_s},
                                             {"early_release_s", &VisualPickOptions::early_release_s},
                                             {"blindness", &VisualPickOptions::blindness},
                                             {"request_blindness", &VisualPickOptions::request_blindness},
                                             {"speed", &VisualPickOptions::speed}};
/// Besides: `miss_m` and `miss_deg`, the bias in polar form, and `retries`.
constexpr const char* kPickExtras[] = {"miss_m", "miss_deg", "retries"};
constexpr double kMostMiss_m = 0.5, kMostMiss_deg = 360, kMostRetries = 5;

/// Of any policy: its hand strays (policies/swaying_policy.h).
constexpr const char* kSway = "sway_m";

constexpr double kMostShare = 1e9;

bool IsKnown(const std::string& policy, const std::string& name) {
  if (name == kSway) return true;
  if (policy == "learned") return false;
  if (policy == "explorer") return name == "speed";
  const auto is_it = [&](const PickParameter& known) { return name == known.name; };
  return std::any_of(std::begin(kPickParameters), std::end(kPickParameters), is_it) ||
         std::find(std::begin(kPickExtras), std::end(kPickExtras), name) != std::end(kPickExtras);
}

std::pair<double, double> ReadRange(const Config& page, const std::string& key) {
  const auto range = page.Get<std::vector<double>>(key);
  page.Require(range.size() == 2 && range[0] <= range[1], key, "[low, high] with low <= high");
  const auto demand = [&](double least, double most) {
    page.Require(range[0] >= least && range[1] <= most, key, fmt::format("numbers from {} to {}", least, most));
  };
  // Of two that make one bias, and of a number that is rounded, the ends do not show what lies between.
  if (key == "miss_m") demand(-kMostMiss_m, kMostMiss_m);
  if (key == "miss_deg") demand(-kMostMiss_deg, kMostMiss_deg);
  if (key == "retries") demand(0, kMostRetries);
  return {range[0], range[1]};
}

Behaviour ReadBehaviour(const Config& page) {
  Behaviour behaviour;
  behaviour.name = page.Get<std::string>("name");
  behaviour.share = page.Get<double>("share");
  behaviour.policy = page.Get<std::string>("policy");
  behaviour.does = page.Get<std::string>("does", "");
  behaviour.without_object = page.Get<bool>("without_object", false);
  behaviour.unaware = page.Get<bool>("unaware", false);
  page.Require(behaviour.share > 0 && behaviour.share <= kMostShare, "share",
               fmt::format("a number above 0, at most {:.0f}", kMostShare));
  const bool explores = behaviour.policy == "explorer", learned = behaviour.policy == "learned";
  page.Require(explores || learned || behaviour.policy == "visual_pick", "policy", "visual_pick, explorer or learned");
  page.Require(explores == page.Has("does"), "does", "it with policy explorer, and only there");
  page.Require(learned == page.Has("checkpoint"), "checkpoint", "it with policy learned, and only there");
  page.Require(!behaviour.unaware || behaviour.without_object, "unaware", "it with without_object: true");
  if (learned) {
    behaviour.checkpoint = page.Path("checkpoint");
    behaviour.checkpoint_sha256 = Sha256HexOfFile(behaviour.checkpoint);
  }
  static const std::set<std::string> kOwn = {"name", "share", "policy", "does", "checkpoint", "without_object", "unaware"};
  for (const std::string& key : page.Keys()) {
    if (kOwn.contains(key)) continue;
    page.Require(IsKnown(behaviour.policy, key), key, "no such field: it is no parameter of " + behaviour.policy);
    behaviour.parameters.push_back({key, ReadRange(page, key)});
  }
  return behaviour;
}

CollectTask ReadCollectTask(const Config& page) {
  page.AllowOnly({"page", "object", "middle_m"});
  CollectTask task;
  task.task = ReadTaskPage(page.Path("page"));
  CheckReadableCameras(task.task.cameras, task.task.arms.size(), task.task.page_path);
  sim::ReadScenePage(task.task);
  task.object = page.Get<std::string>("object");
  task.without = sim::WithoutObject(task.task, task.object);
  const auto middle_m = page.Get<std::vector<double>>("middle_m");
  page.Require(middle_m.size() == 3, "middle_m", "three numbers");
  task.middle_m = {middle_m[0], middle_m[1], middle_m[2]};
  return task;
}

void OverrideStillRule(const Config& page, Recipe& recipe) {
  if (!page.Has("still")) return;
  for (CollectTask& task : recipe.tasks) {
    for (Task* one : {&task.task, &task.without}) one->still = ReadStillRule(page.Section("still"), one->still);
  }
}

void ResizeCameras(const Config& page, Recipe& recipe) {
  if (!page.Has("image")) return;
  const Config image = page.Section("image");
  image.AllowOnly({"height_px", "width_px"});
  const int height_px = image.Get<int>("height_px"), width_px = image.Get<int>("width_px");
  image.Require(height_px > 0 && height_px <= 2048, "height_px", "1 … 2048");
  image.Require(width_px > 0 && width_px <= 2048, "width_px", "1 … 2048");
  for (CollectTask& task : recipe.tasks) {
    for (Task* one : {&task.task, &task.without}) {
      for (Camera& camera : one->cameras) camera = Resized(camera, width_px, height_px);
    }
  }
}

/// How many there are decides no episode: a collection can grow. (Config::Set would refuse a number that an alias makes
/// one with another's.)
std::string CanonicalOfAny(const Config& page) {
  const std::string field = "\n.episodes=";
  std::string lines = "\n" + page.Canonical();
  const std::size_t number = lines.find(field) + field.size();
  lines.replace(number, lines.find('\n', number) - number, "0");
  return lines.substr(1);
}

std::string HashOf(const Config& page, const Recipe& recipe) {
  std::string all = CanonicalOfAny(page) + Config::FromFile(recipe.profile).ContentHash();
  for (const CollectTask& task : recipe.tasks) {
    const Config task_page = Config::FromText(task.task.page, task.task.page_path);
    all += task_page.ContentHash();
    const Config mujoco = task_page.Section("mujoco");
    all += Sha256HexOfFile(mujoco.Path("scene"));
    std::set<std::filesystem::path> included;
    for (const auto& file : mujoco.Get<std::vector<std::string>>("includes", std::vector<std::string>{})) {
      all += Sha256HexOfFile(mujoco.Path("scene").parent_path() / file);
      included.insert((mujoco.Path("scene").parent_path() / file).lexically_normal());
    }
    for (const std::filesystem::path& file : FilesOfScene(mujoco.Path("scene"))) {
      if (!included.contains(file)) all += Sha256HexOfFile(file);
    }
  }
  for (const Behaviour& behaviour : recipe.mix) {
    all += behaviour.checkpoint_sha256;
  }
  return Sha256Hex(all);
}

void ReadNumbers(const Config& page, Recipe& recipe) {
  recipe.episodes = page.Get<int>("episodes");
  recipe.episodes_per_state = page.Get<int>("episodes_per_state", 1);
  recipe.chunk_size = page.Get<int>("chunk_size", 8);
  recipe.max_chunks = page.Get<int>("max_chunks");
  page.Require(recipe.episodes > 0 && recipe.episodes <= kMostEpisodes, "episodes",
               fmt::format("1 … {}", kMostEpisodes));
  page.Require(recipe.episodes_per_state > 0, "episodes_per_state", "at least 1");
  page.Require(recipe.chunk_size > 0 && recipe.chunk_size <= 1000, "chunk_size", "1 … 1000");
  page.Require(recipe.max_chunks > 0 && recipe.max_chunks <= 1000, "max_chunks", "1 … 1000");
  if (!page.Has("video")) return;
  const Config video = page.Section("video");
  video.AllowOnly({"crf", "scale"});
  recipe.video.crf = video.Get<int>("crf", recipe.video.crf);
  recipe.video.scale = video.Get<int>("scale", recipe.video.scale);
  video.Require(recipe.video.crf >= 0 && recipe.video.crf <= 51, "crf", "0 … 51");
  video.Require(recipe.video.scale >= 1 && recipe.video.scale <= 8, "scale", "1 … 8");
}

/// Four digits: what a manifest shows is what was used.
double Rounded(double value) { return std::round(value * 1e4) / 1e4; }

const Behaviour& Choose(const std::vector<Behaviour>& mix, double uniform) {
  double total = 0;
  for (const Behaviour& behaviour : mix) total += behaviour.share;
  double left = uniform * total;
  for (const Behaviour& behaviour : mix) {
    if ((left -= behaviour.share) < 0) return behaviour;
  }
  return mix.back();
}

VisualPickOptions PickOptions(const std::map<std::string, double>& parameters, int chunk_size) {
  VisualPickOptions options;
  options.chunk_size = chunk_size;
  const auto value = [&](const char* name, double otherwise) {
    const auto found = parameters.find(name);
    return found == parameters.end() ? otherwise : found->second;
  };
  for (const PickParameter& parameter : kPickParameters)
    options.*parameter.field = value(parameter.name, options.*parameter.field);
  const double miss_rad = value("miss_deg", 0) * std::numbers::pi / 180;
  options.bias_m = value("miss_m", 0) * Eigen::Vector2d(std::cos(miss_rad), std::sin(miss_rad));
  options.retries = static_cast<int>(std::lround(value("retries", options.retries)));
  return options;
}

/// It is read anew for every episode, and the collection is called after the file as it was first: one that was written to
/// meanwhile is refused, also if that was while it was read.
std::unique_ptr<Policy> LoadCheckpoint(const Behaviour& behaviour, int chunk_size) {
  std::unique_ptr<Policy> policy = MakeLearnedPolicy(behaviour.checkpoint, chunk_size);
  const std::string found = Sha256HexOfFile(behaviour.checkpoint);
  if (found != behaviour.checkpoint_sha256)
    throw InvalidInput("{}: it is another file than when the recipe was read: found SHA-256 {}, wanted {}",
                       behaviour.checkpoint.string(), found, behaviour.checkpoint_sha256);
  return policy;
}

std::unique_ptr<Policy> MakeSteadyPolicy(const CollectJob& job, int chunk_size) {
  if (job.behaviour->policy == "visual_pick")
    return std::make_unique<VisualPick>(PickOptions(job.row.parameters, chunk_size));
  if (job.behaviour->policy == "learned") return LoadCheckpoint(*job.behaviour, chunk_size);
  const auto speed = job.row.parameters.find("speed");
  return std::make_unique<Explorer>(ExplorerOptions{ExplorationFromName(job.behaviour->does), chunk_size,
                                                    speed == job.row.parameters.end() ? 1.0 : speed->second});
}

/// Both ends of every range are values that the policy takes, and it knows every task.
/// @throws InvalidInput with the behaviour's place
void CheckBehaviour(const Config& page, const Recipe& recipe, const Behaviour& behaviour) try {
  std::unique_ptr<Policy> policy;
  for (const bool high : {false, true}) {
    CollectJob job{&recipe.tasks.front(), &behaviour, {}};
    for (const auto& [name, range] : behaviour.parameters) job.row.parameters[name] = high ? range.second : range.first;
    policy = MakePolicy(job, recipe.chunk_size);
  }
  for (const CollectTask& task : recipe.tasks) policy->Reset(0, task.task, 1);
} catch (const Error& error) {
  if (error.exit_code() != ExitCode::kInvalidInput) throw;
  throw InvalidInput("{}: {}", page.Where(), error.what());
}

}  // namespace

Recipe ReadRecipe(const fs::path& path, const std::vector<std::string>& assignments) {
  Config page = Config::FromFile(path);
  for (const std::string& assignment : assignments) page.Set(assignment);
  page.AllowOnly({"recipe", "profile", "tasks", "mix", "episodes", "episodes_per_state", "chunk_size", "max_chunks",
                  "still", "image", "video"});
  Recipe recipe;
  recipe.name = page.Get<std::string>("recipe");
  recipe.profile = page.Path("profile");
  sim::ReadProfile(recipe.profile);
  for (const Config& task : page.List("tasks")) recipe.tasks.push_back(ReadCollectTask(task));
  for (const Config& behaviour : page.List("mix")) recipe.mix.push_back(ReadBehaviour(behaviour));
  page.Require(!recipe.tasks.empty(), "tasks", "at least one task");
  page.Require(!recipe.mix.empty(), "mix", "at least one behaviour");
  ReadNumbers(page, recipe);
  OverrideStillRule(page, recipe);
  ResizeCameras(page, recipe);
  recipe.text = page.Text();
  recipe.hash = HashOf(page, recipe);
  const std::vector<Config> mix = page.List("mix");
  for (std::size_t i = 0; i < mix.size(); ++i) CheckBehaviour(mix[i], recipe, recipe.mix[i]);
  return recipe;
}

CollectJob JobAt(const Recipe& recipe, std::uint64_t seed, std::int64_t index) {
  const auto number = static_cast<std::uint64_t>(index), tasks = static_cast<std::uint64_t>(recipe.tasks.size());
  const std::uint64_t state = number / tasks / static_cast<std::uint64_t>(recipe.episodes_per_state);
  CollectJob job;
  job.task = &recipe.tasks[number % tasks];
  SplitMix64 random(SeedFor(SeedFor(seed, "collected episode"), number));
  job.behaviour = &Choose(recipe.mix, random.Uniform());
  CollectedEpisode& row = job.row;
  row.index = index;
  row.task = job.task->task.id;
  row.episode = fmt::format("{:06}", index);
  row.initial_state = fmt::format("collect-{}-{:05}", seed, state);
  row.state_seed = SeedFor(SeedFor(SeedFor(seed, "collected state"), state), row.task);
  row.world_seed = random.Next();
  row.policy_seed = random.Next();
  row.behaviour = job.behaviour->name;
  row.policy = job.behaviour->policy;
  for (const auto& [name, range] : job.behaviour->parameters)
    row.parameters[name] = Rounded(random.Uniform(range.first, range.second));
  if (job.behaviour->without_object) row.without = job.task->object;
  row.video_scale = recipe.video.scale;
  return job;
}

std::unique_ptr<Policy> MakePolicy(const CollectJob& job, int chunk_size) {
  std::unique_ptr<Policy> policy = MakeSteadyPolicy(job, chunk_size);
  const auto sway = job.row.parameters.find(kSway);
  return sway == job.row.parameters.end() ? std::move(policy) : std::make_unique<SwayingPolicy>(std::move(policy), sway->second);
}

}  // namespace evac
