#include "harness/suite.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <set>
#include <string_view>

#include "core/config.h"
#include "core/geometry.h"
#include "core/seed.h"
#include "core/task_page.h"
#include "harness/suite_hash.h"

namespace evac {
namespace {

namespace fs = std::filesystem;

constexpr double kDay_s = 86400;

/// Names become file names and parts of messages' channels.
std::string NameField(const Config& page, const std::string& key) {
  const std::string name = page.Get<std::string>(key);
  const bool good = !name.empty() && name.size() <= 64 && name.front() != '.' &&
                    std::all_of(name.begin(), name.end(),
                                [](unsigned char c) { return std::isalnum(c) || c == '_' || c == '-' || c == '.'; });
  page.Require(good, key, "1 … 64 letters, digits, '_', '-' and '.', not beginning with '.'");
  return name;
}

/// Fields that only some types have: a page that names one of another type is wrong.
void AllowOnlyFieldsOf(const std::string& type, const Config& page) {
  if (type == "evac") {
    return page.AllowOnly({"name", "type", "role", "weights", "config", "statistics", "solver", "steps", "eta", "cfg",
                           "cfg_rescale", "period_s", "pose_map", "products", "threads_per_scene", "quirks", "cache",
                           "initial_states"});
  }
  page.AllowOnly({"name", "type", "role", "profile", "film", "initial_states"});
}

SuiteWorld ReadWorld(const Config& page) {
  AllowOnlyFieldsOf(page.Has("type") ? page.Get<std::string>("type") : "", page);
  SuiteWorld world;
  world.name = NameField(page, "name");
  world.type = page.Get<std::string>("type");
  page.Require(world.type == "mujoco" || world.type == "echo" || world.type == "evac", "type", "mujoco, echo or evac");
  const std::string role = page.Get<std::string>("role", "evaluated");
  if (page.Has("role"))
    page.Require(role == "real" || role == "evaluated", "role", "real (the reference) or evaluated");
  world.is_real = role == "real";
  page.Require(!world.is_real || world.type != "evac", "role", "evaluated: what is imagined is no reference");
  if (world.type == "mujoco") world.profile = page.Path("profile");
  world.film = page.Get<bool>("film", true);
  page.Require(world.film || (world.type == "mujoco" && !world.is_real), "film",
               "true: only a world of type mujoco beside the real one may do without clips");
  if (world.type == "echo") page.Require(!page.Has("profile"), "profile", "none: a recording has no physics");
  if (world.type == "evac") world.evac = ReadSuiteEvac(page);
  world.initial_states = page.Get<int>("initial_states", 0);
  page.Require(!page.Has("initial_states") || world.initial_states >= 1, "initial_states", "at least 1");
  return world;
}

/// A token becomes a part of channels' names, between two '_'.
bool IsToken(const std::string& token) {
  return !token.empty() && token.size() <= 32 &&
         std::all_of(token.begin(), token.end(), [](unsigned char c) { return std::isalnum(c) || c == '-'; });
}

SuitePolicy ReadPolicy(const Config& page) {
  page.AllowOnly({"name", "checkpoint", "command", "join", "files"});
  SuitePolicy policy;
  policy.name = NameField(page, "name");
  policy.checkpoint = page.Has("checkpoint") ? NameField(page, "checkpoint") : kDefaultCheckpoint;
  page.Require(page.Has("command") != page.Has("join"), "command",
               "either a command line (a list) or `join: {url, token}`");
  for (const std::string& file : page.Get<std::vector<std::string>>("files", {})) {
    policy.files.push_back((page.file().parent_path() / file).lexically_normal().string());
    std::error_code ignored;
    page.Require(!file.empty() && fs::exists(policy.files.back(), ignored), "files",
                 fmt::format("files or folders that are there, and '{}' is not", file));
  }
  if (page.Has("join")) {
    const Config join = page.Section("join");
    join.AllowOnly({"url", "token"});
    policy.join_url = join.Get<std::string>("url");
    policy.join_token = join.Get<std::string>("token");
    join.Require(IsToken(policy.join_token), "token", "1 … 32 letters, digits and '-'");
    return policy;
  }
  policy.command = page.Get<std::vector<std::string>>("command");
  page.Require(!policy.command.empty() && !policy.command.front().empty(), "command", "a program and its arguments");
  return policy;
}

std::vector<InitialState> ReadInitialStates(const Config& suite) {
  const Config page = suite.Section("initial_states");
  page.AllowOnly({"seed", "count"});
  const auto seed = page.Get<std::uint64_t>("seed");
  const int count = page.Get<int>("count");
  page.Require(count >= 1 && count <= 9999, "count", "1 … 9999 initial states per task");
  std::vector<InitialState> states;
  for (int i = 0; i < count; ++i)
    states.push_back({fmt::format("{}-{:04d}", seed, i), SeedFor(SeedFor(seed, "initial state"), i)});
  return states;
}

int ReadRecordedStates(const Config& suite) {
  if (!suite.Has("initial_states")) return 0;
  const Config page = suite.Section("initial_states");
  page.AllowOnly({"count"});
  const int count = page.Get<int>("count");
  page.Require(count >= 1, "count", "at least 1: so many of the recordings");
  return count;
}

std::vector<Task> ReadTasks(const Config& suite) {
  std::vector<Task> tasks;
  for (const Config& item : suite.List("tasks")) {
    const fs::path named = item.Value<std::string>();
    Task task = ReadTaskPage(named.is_absolute() ? named : suite.file().parent_path() / named);
    if (suite.Has("still")) task.still = ReadStillRule(suite.Section("still"), task.still);
    tasks.push_back(std::move(task));
  }
  if (!suite.Has("image")) return tasks;
  const Config image = suite.Section("image");
  image.AllowOnly({"height_px", "width_px"});
  const int height_px = image.Get<int>("height_px"), width_px = image.Get<int>("width_px");
  image.Require(height_px >= 16 && height_px <= 2160, "height_px", "16 … 2160");
  image.Require(width_px >= 16 && width_px <= 3840, "width_px", "16 … 3840");
  for (Task& task : tasks) {
    for (Camera& camera : task.cameras) camera = Resized(camera, width_px, height_px);
  }
  return tasks;
}

Transport ReadTransport(const Config& suite) {
  Transport transport;
  if (!suite.Has("transport")) return transport;
  const Config page = suite.Section("transport");
  page.AllowOnly({"deadline_s", "repeat_after_s", "start_s", "images"});
  transport.deadline_s = page.Get<double>("deadline_s", transport.deadline_s);
  transport.repeat_after_s = page.Get<double>("repeat_after_s", transport.repeat_after_s);
  transport.start_s = page.Get<double>("start_s", transport.start_s);
  transport.images = page.Get<std::string>("images", transport.images);
  const auto require_wait = [&](double wait_s, const char* field) {  // a clock counts nanoseconds, for 292 years
    page.Require(wait_s > 0 && wait_s <= kDay_s, field, "more than 0 s, at most 86400 s (a day)");
  };
  require_wait(transport.deadline_s, "deadline_s");
  require_wait(transport.repeat_after_s, "repeat_after_s");
  require_wait(transport.start_s, "start_s");
  page.Require(transport.images == "jpeg" || transport.images == "raw", "images", "jpeg or raw");
  return transport;
}

PolicyLatency ReadLatency(const Config& page) {
  const std::string text = page.Get<std::string>("latency", "off");
  if (text == "off") return {};
  if (text == "measured") return {.kind = PolicyLatency::Kind::kMeasured, .fixed_s = 0};
  char* end = nullptr;
  const double seconds = std::strtod(text.c_str(), &end);
  page.Require(*end == '\0' && seconds > 0 && seconds <= 60, "latency", "measured, off, or seconds, more than 0 … 60");
  return {.kind = PolicyLatency::Kind::kFixed, .fixed_s = seconds};
}

/// What holds for all policies of the suite.
void ReadPolicySection(const Config& suite_page, Suite& suite) {
  if (!suite_page.Has("policy")) return;
  const Config page = suite_page.Section("policy");
  page.AllowOnly({"latency", "start_probe"});
  suite.latency = ReadLatency(page);
  const std::string probe = page.Get<std::string>("start_probe", "refuse");
  page.Require(probe == "refuse" || probe == "warn" || probe == "off", "start_probe", "refuse, warn or off");
  suite.start_probe = probe == "refuse" ? StartProbe::kRefuse : probe == "warn" ? StartProbe::kWarn : StartProbe::kOff;
  page.Require(suite.latency.kind != PolicyLatency::Kind::kMeasured || suite.lanes == 1, "latency",
               "`lanes: 1` with it: else one episode's thinking is another's waiting, and is measured too");
}

VideoOptions ReadVideo(const Config& suite) {
  VideoOptions video;
  video.scale = suite.Has("recording") ? 1 : 4;  // pictures of a desk's simulation are small, those of a robot's cameras are not
  if (!suite.Has("video")) return video;
  const Config page = suite.Section("video");
  page.AllowOnly({"crf", "preset", "scale"});
  video.crf = page.Get<int>("crf", video.crf);
  video.preset = page.Get<std::string>("preset", video.preset);
  video.scale = page.Get<int>("scale", video.scale);
  page.Require(std::find(std::begin(kVideoPresets), std::end(kVideoPresets), video.preset) != std::end(kVideoPresets),
               "preset", fmt::format("one of {}", fmt::join(kVideoPresets, ", ")));
  page.Require(video.crf >= 0 && video.crf <= 51, "crf", "0 (lossless) … 51");
  page.Require(video.scale >= 1 && video.scale <= 16, "scale", "1 … 16");
  return video;
}

template <typename Item, typename NameOf>
void RequireDistinct(const std::vector<Item>& items, const Config& suite, const std::string& field,
                     const NameOf& name_of, const char* what = "names") {
  std::set<std::string> names;
  for (const Item& item : items) {
    if (!names.insert(name_of(item)).second)
      throw InvalidInput("{}: '{}' is there twice, wanted distinct {}", suite.Where(field), name_of(item), what);
  }
}

/// One process that is joined twice would be compared with itself. Who sends to an address and port is heard there,
/// whatever else the URL says.
void RequireDistinctJoins(const Suite& suite, const Config& page) {
  std::vector<SuitePolicy> joined = suite.policies;
  std::erase_if(joined, [](const SuitePolicy& policy) { return !policy.command.empty(); });
  const auto place_of = [](const SuitePolicy& policy) {
    return fmt::format("join: {{url: {}, token: {}}}", policy.join_url.substr(0, policy.join_url.find('?')),
                       policy.join_token);
  };
  RequireDistinct(joined, page, "policies", place_of, "processes: each needs a port or a token of its own");
}

/// A world may try fewer initial states than the suite has; the real one no fewer than what starts from its frames.
void CheckStates(const Suite& suite, const Config& page) {
  if (suite.recording) return;  // how many there are is not known yet
  const auto tried = [&](const SuiteWorld& world) { return std::ssize(StatesOf(suite, world)); };
  const std::vector<Config> fields = page.List("worlds");
  for (std::size_t i = 0; i < fields.size(); ++i) {
    const SuiteWorld& world = suite.worlds[i];
    const Config& field = fields[i];
    field.Require(world.initial_states <= std::ssize(suite.initial_states), "initial_states",
                  fmt::format("at most the suite's {}", suite.initial_states.size()));
    for (const SuiteWorld& real : suite.worlds) {
      if (real.is_real && world.evac)
        field.Require(tried(world) <= tried(real), "initial_states",
                      fmt::format("at most the {} of {}, from whose first frames it starts", tried(real), real.name));
    }
  }
}

/// What the world would refuse anyway, but only when the real world's episodes are there.
void CheckPeriods(const Suite& suite, const Config& page) {
  const std::vector<Config> fields = page.List("worlds");
  for (std::size_t i = 0; i < fields.size(); ++i) {
    const auto& evac = suite.worlds[i].evac;
    for (const Task& task : suite.tasks) {
      if (!evac || std::abs(task.period_s - evac->period_s) <= 1e-6) continue;
      throw InvalidInput("{}: frames are {:.4g} s apart, those of task {} {:.4g} s: wanted tasks of the world's period",
                         fields[i].Where("period_s"), evac->period_s, task.id, task.period_s);
    }
  }
}

/// The task's cameras beside each other, each pixel as large as `video.scale` makes it.
void CheckVideoSize(const Suite& suite, const Task& task) {
  int width_px = 0, height_px = 0;
  for (const Camera& camera : task.cameras) {
    width_px += camera.width_px;
    height_px = std::max(height_px, camera.height_px);
  }
  const int longest = std::max(width_px, height_px), most = kLongestVideoSide_px / std::max(1, longest);
  if (suite.video.scale <= most) return;
  throw InvalidInput("{}: field video.scale: found {}, wanted at most {}: the pictures of task {} beside each other are "
                     "{}x{}, and a video's side has at most {} pixels",
                     suite.path.string(), suite.video.scale, most, task.id, width_px, height_px, kLongestVideoSide_px);
}

void CheckWhole(const Suite& suite, const Config& page) {
  page.Require(!suite.worlds.empty(), "worlds", "at least one world");
  page.Require(!suite.policies.empty(), "policies", "at least one policy");
  page.Require(!suite.seeds.empty(), "seeds", "at least one seed");
  page.Require(suite.lanes >= 1 && suite.lanes <= 256, "lanes", "1 … 256");
  page.Require(suite.chunk_size >= 1 && suite.chunk_size <= 1000, "chunk_size", "1 … 1000 targets");
  page.Require(suite.error_budget >= 0 && suite.error_budget <= 1, "error_budget", "a share, 0 … 1");
  page.Require(suite.recording.has_value() != !suite.tasks.empty(), "tasks", "either task pages or a `recording`");
  RequireDistinct(suite.worlds, page, "worlds", [](const SuiteWorld& world) { return world.name; });
  RequireDistinct(suite.tasks, page, "tasks", [](const Task& task) { return task.id; });
  RequireDistinct(suite.policies, page, "policies",
                  [](const SuitePolicy& policy) { return policy.name + "@" + policy.checkpoint; });
  RequireDistinctJoins(suite, page);
  RequireDistinct(suite.seeds, page, "seeds", [](std::uint64_t seed) { return std::to_string(seed); }, "seeds");
  page.Require(std::ranges::all_of(suite.judges, [](const std::string& judge) { return judge == "oracle"; }), "judges",
               "[oracle] or none: others judge a run that is there, `evac judge`");
  const auto reals =
      std::count_if(suite.worlds.begin(), suite.worlds.end(), [](const SuiteWorld& world) { return world.is_real; });
  page.Require(reals <= 1, "worlds", "at most one world with role: real");
  CheckStates(suite, page);
  CheckPeriods(suite, page);
  CheckVideoSizes(suite);
  for (const SuiteWorld& world : suite.worlds) {
    if (world.type == "evac") {
      page.Require(
          suite.recording.has_value() || reals == 1, "worlds",
          "beside an evac world one with role: real, or a `recording`: imagined episodes start from its first frames");
      continue;
    }
    page.Require((world.type == "echo") == suite.recording.has_value(), "worlds",
                 "echo worlds with a `recording`, mujoco worlds with task pages");
  }
}

RecordedTask ReadRecordedTask(const Config& page) {
  RecordedTask task;
  if (page.Has("task")) task.name = NameField(page, "task");
  if (page.Has("instruction")) task.instruction = page.Get<std::string>("instruction");
  page.Require(!task.instruction || !task.instruction->empty(), "instruction", "what is to be done, in words");
  if (page.Has("rubric")) task.rubric = ReadRubricInWords(page.Section("rubric"));
  if (page.Has("workspace_m")) task.workspace_m = ReadWorkspace(page.Section("workspace_m"));
  if (page.Has("still")) task.still = ReadStillRule(page.Section("still"), StillRule{});
  task.max_chunks = page.Get<int>("max_chunks", 0);
  page.Require(!page.Has("max_chunks") || task.max_chunks >= 1, "max_chunks", "at least 1");
  return task;
}

Suite Build(const Config& page) {
  page.AllowOnly({"suite", "description", "recording", "worlds", "tasks", "policies", "seeds", "initial_states",
                  "chunk_size", "lanes", "threads", "error_budget", "image", "still", "max_chunks", "task",
                  "instruction", "rubric", "workspace_m", "judges", "video", "transport", "policy"});
  Suite suite;
  suite.name = NameField(page, "suite");
  suite.path = page.file();
  suite.text = page.Text();
  for (const Config& world : page.List("worlds")) suite.worlds.push_back(ReadWorld(world));
  for (const Config& policy : page.List("policies")) suite.policies.push_back(ReadPolicy(policy));
  if (page.Has("recording")) suite.recording = page.Path("recording");
  if (suite.recording) {
    page.Require(!page.Has("image"), "image", "none beside a `recording`: its pictures are of its videos' size");
    suite.recorded_task = ReadRecordedTask(page);
  }
  for (const char* field : {"max_chunks", "task", "instruction", "rubric", "workspace_m"})
    page.Require(suite.recording || !page.Has(field), field, "none but beside a `recording`: a task page says its own");
  suite.tasks = ReadTasks(page);
  suite.seeds = page.Get<std::vector<std::uint64_t>>("seeds", {1});
  if (suite.recording) {
    suite.recorded_states = ReadRecordedStates(page);
    suite.initial_states = {{"recording", 0}};
  } else {
    suite.initial_states = ReadInitialStates(page);
  }
  suite.chunk_size = page.Get<int>("chunk_size", suite.chunk_size);
  suite.lanes = page.Get<int>("lanes", suite.lanes);
  suite.threads = page.Get<int>("threads", suite.threads);
  page.Require(suite.threads >= 0 && suite.threads <= 256, "threads", "0 (one per core) … 256");
  suite.error_budget = page.Get<double>("error_budget", suite.error_budget);
  suite.judges = page.Get<std::vector<std::string>>("judges", {});
  suite.video = ReadVideo(page);
  suite.transport = ReadTransport(page);
  ReadPolicySection(page, suite);
  CheckWhole(suite, page);
  for (const Task& task : suite.tasks) suite.page_hashes[task.page_path] = PageHash(task.page_path);
  for (const SuiteWorld& world : suite.worlds) {
    if (!world.profile.empty()) suite.page_hashes[world.profile] = PageHash(world.profile);
  }
  suite.hashed_files = HashFiles(suite);
  suite.hash = SuiteHash(page, suite);
  suite.reality_hash = RealityHash(page, suite);
  return suite;
}

bool IsPath(const std::string& field) {
  const std::string last = field.substr(field.rfind('.') + 1);
  return last == "recording" || last == "profile" || last == "weights" || last == "config" || last == "statistics" ||
         last == "folder" || field.starts_with("tasks.") || field.find(".files.") != std::string::npos;
}

/// `field=VALUE` of a path from the working directory, quoted: in YAML " #" would begin a comment, ": " a mapping.
std::string PathFromHere(const std::string& field, const std::string& path) {
  std::string quoted = field + "=\"";
  for (const char letter : fs::absolute(path).lexically_normal().string()) {
    if (letter == '"' || letter == '\\') quoted += '\\';
    quoted += letter == '\n' ? std::string("\\n") : std::string(1, letter);
  }
  return quoted + "\"";
}

/// The paths in what was set, each as an assignment of its own.
void AddPaths(const YAML::Node& value, const std::string& field, std::vector<std::string>& assignments) {
  if (value.IsMap()) {
    for (const auto& item : value) AddPaths(item.second, field + "." + item.first.Scalar(), assignments);
  } else if (value.IsSequence()) {
    for (std::size_t i = 0; i < value.size(); ++i) AddPaths(value[i], field + "." + std::to_string(i), assignments);
  } else if (value.IsScalar() && !value.Scalar().empty() && IsPath(field)) {
    assignments.push_back(PathFromHere(field, value.Scalar()));
  }
}

/// A path given on the command line is relative to where the user stands; one in the file to the file.
void SetFromHere(const std::string& assignment, Config& page) {
  const std::size_t equals = assignment.find('=');
  const std::string field = assignment.substr(0, equals);
  const std::string value = equals == std::string::npos ? "" : assignment.substr(equals + 1);
  const bool is_yaml = YAML::IsNullString(value) || std::string_view("[{\"'").find(value.front()) != std::string::npos;
  if (IsPath(field) && !is_yaml) return page.Set(PathFromHere(field, value));
  page.Set(assignment);
  Config alone = Config::FromText("value:", "--set");
  alone.Set("value=" + value);
  std::vector<std::string> paths;
  AddPaths(alone.node()["value"], field, paths);
  for (const std::string& path : paths) page.Set(path);
}

}  // namespace

void CheckVideoSizes(const Suite& suite) {
  if (std::ranges::none_of(suite.worlds, &SuiteWorld::film)) return;
  for (const Task& task : suite.tasks) CheckVideoSize(suite, task);
}

bool HasNetwork(const Suite& suite) {
  return std::ranges::any_of(suite.worlds, [](const SuiteWorld& world) { return world.evac.has_value(); });
}

int AllowedFailures(const Suite& suite, int episodes) {
  constexpr double kRounding = 1e-9;  // .29 of 100 is 28.999999999999996
  return static_cast<int>(suite.error_budget * episodes + kRounding);
}

std::span<const InitialState> StatesOf(const Suite& suite, const SuiteWorld& world) {
  const std::span<const InitialState> all = suite.initial_states;
  return world.initial_states == 0
             ? all
             : all.first(std::min<std::size_t>(all.size(), static_cast<std::size_t>(world.initial_states)));
}

Suite ReadSuite(const fs::path& path, const std::vector<std::string>& assignments) {
  Config page = Config::FromFile(path);
  for (const std::string& assignment : assignments) SetFromHere(assignment, page);
  return Build(page);
}

Suite ParseSuite(const std::string& text, const fs::path& path) { return Build(Config::FromText(text, path)); }

}  // namespace evac
