#include "apps/factory.h"

#include <unistd.h>

#include <algorithm>
#include <cstdlib>
#include <random>
#include <sstream>

#include "apps/network_parts.h"
#include "apps/recorded_suite.h"
#include "core/config.h"
#include "core/file.h"
#include "harness/suite_hash.h"
#include "judges/oracle_judge.h"
#include "worldmodel/echo_world.h"
#include "worldmodel/sim/mujoco_world.h"

namespace evac {
namespace {

namespace fs = std::filesystem;

/// Beside this program first, so that `evac` finds its own `evac-policy` wherever it was built or installed.
std::string FindProgram(const std::string& program, const Suite& suite) {
  if (program.find('/') != std::string::npos) {
    const fs::path path = fs::path(program).is_absolute() ? fs::path(program) : fs::absolute(suite.path).parent_path() / program;
    if (::access(path.c_str(), X_OK) == 0) return path.lexically_normal().string();
    throw InvalidInput("{}: a policy's command names {}: found no program at {} (a relative one is looked for in the suite's "
                       "folder, also with --set)",
                       suite.path.string(), program, path.lexically_normal().string());
  }
  const fs::path beside = fs::read_symlink("/proc/self/exe").parent_path() / program;
  if (::access(beside.c_str(), X_OK) == 0) return beside.string();
  const char* path = std::getenv("PATH");
  std::istringstream folders(path ? path : "");
  for (std::string folder; std::getline(folders, folder, ':');) {
    if (!folder.empty() && ::access((fs::path(folder) / program).c_str(), X_OK) == 0) return (fs::path(folder) / program).string();
  }
  throw InvalidInput("{}: a policy's command names '{}', which is neither beside evac nor in PATH", suite.path.string(), program);
}

std::string Filled(std::string word, const Suite& suite) {
  const std::string variable = "${recording}";
  const std::size_t at = word.find(variable);
  if (at == std::string::npos) return word;
  if (!suite.recording) throw InvalidInput("{}: a policy's command names ${{recording}}, but the suite has no field recording", suite.path.string());
  if (suite.recordings.size() > 1)
    throw InvalidInput("{}: a policy's command names ${{recording}}, but {} holds {}: name one as `recording`, or replay all with "
                       "`evac fidelity`", suite.path.string(), suite.recording->string(), suite.recordings.size());
  const fs::path one = suite.recordings.empty() ? *suite.recording : suite.recordings.begin()->second;
  return word.replace(at, variable.size(), fs::absolute(one).lexically_normal().string());
}

/// EVAC_PERIOD_S is said where there is one task, a recording's: whoever replays it takes the same steps of it as the
/// worlds do.
PolicyProcessOptions ProcessOptions(const SuitePolicy& policy, const Suite& suite, const fs::path& run_folder, const LcmAddress& address) {
  const fs::path log = run_folder / "logs" / (policy.name + "@" + policy.checkpoint + ".log");
  MakeFolders(log.parent_path());
  PolicyProcessOptions options{
      .command = CommandLine(policy, suite),
      .environment = {{"EVAC_LCM_URL", address.url}, {"EVAC_TOKEN", address.token}, {"EVAC_CHUNK_SIZE", std::to_string(suite.chunk_size)}},
      .working_directory = fs::absolute(suite.path).parent_path(),
      .log = log};
  if (suite.recording) options.environment["EVAC_PERIOD_S"] = fmt::format("{}", suite.tasks.front().period_s);
  return options;
}

/// What an episode begins from, and goes on as; one alone is read once.
RecordedStart RecordingsOf(const Suite& suite) {
  if (suite.initial_states.size() > 1)
    return [suite](const Task&, const InitialState& initial) { return RecordingOf(suite, initial); };
  return [only = RecordingOf(suite, suite.initial_states.front())](const Task&, const InitialState&) { return only; };
}

/// One that nobody has ever used, so that no policy left over from yesterday listens there: in a container even process
/// numbers come again.
LcmAddress NewAddress(const std::string& name) {
  std::random_device random;
  return LcmAddress::For(fmt::format("{} {} {:08x}{:08x}", name, ::getpid(), random(), random()));
}

/// Every task of the suite must fit, not only the one that was greeted with.
/// @param who  "policy good@v1", as the suite calls it
void CheckAllTasks(const Suite& suite, const std::string& who, const PolicySpec& declared) {
  for (const Task& task : suite.tasks) {
    const PolicySpec wanted = HarnessSpec(task, suite.chunk_size);
    if (!Compare(wanted, declared).empty()) {
      throw InvalidInput("{} does not fit task {}:\n{}", WhoDeclares(who, declared), task.id,
                         SideBySide(wanted, declared));
    }
  }
}

/// Of a task page everybody is told what it says; what is made up for a recording (FillInRecordedTask) is for people.
void CheckInstruction(const Suite& suite, const std::string& who, const PolicySpec& declared) {
  if (!suite.recording || suite.recorded_task.instruction || !declared.needs.contains("instruction")) return;
  throw InvalidInput("{}: field instruction: found none, wanted what is to be done, in words: {} needs an "
                     "instruction, and recordings say none",
                     suite.path.string(), WhoDeclares(who, declared));
}

/// What a page puts into each other does not come to rest: nothing of the machine's that a second try would mend.
WorldStep Begun(World& world, const Task& task, const InitialState& initial) try {
  return world.Reset(0, task, initial, 0);
} catch (const Error& error) {
  if (std::string_view(error.kind()) != Name(StopReason::kDiverged)) throw;
  throw InvalidInput("{}: what initial state {} begins with does not come to rest: {}", task.page_path, initial.id,
                     error.what());
}

}  // namespace

void CheckRubrics(const Suite& suite) {
  if (suite.recording) return;  // its task's stages are words, which people and models judge by: there is no physics
  for (const Task& task : suite.tasks) {
    if (const auto wrong = WhatIsWrong(task.rubric)) throw InvalidInput("{}: field rubric: {}", task.page_path, *wrong);
  }
}

void CheckStart(World& world, const Task& task, const InitialState& initial) {
  const PrivilegedFrame frame = Begun(world, task, initial).privileged;
  if (frame.bodies.empty()) return;
  if (const auto wrong = WhatIsWrong(task.rubric, frame)) throw InvalidInput("{}: field rubric: {}", task.page_path, *wrong);
}

void Declare(const Suite& suite, Store& store) {
  CheckRubrics(suite);
  for (const Task& task : suite.tasks) {
    const auto page = suite.page_hashes.find(task.page_path);  // a recording's task has none
    store.AddTask(task, page == suite.page_hashes.end() ? std::string() : page->second);
  }
  for (const SuiteWorld& world : suite.worlds) {
    std::string profile_hash = world.profile.empty() ? "" : Config::FromFile(world.profile).ContentHash();
    if (world.evac) {
      CheckNetwork(world, suite.tasks);
      profile_hash = world.evac->hash;
      // Of one number of threads are its frames, which is in no hash of the suite's: a run goes on with that alone.
      if (world.evac->all_threads_per_scene) profile_hash += fmt::format(" threads {}", Threads(suite));
    }
    store.AddWorld({.name = world.name, .type = world.type, .is_real = world.is_real, .profile_hash = profile_hash});
  }
}

int Threads(const Suite& suite, unsigned cores) {
  return suite.threads > 0 ? suite.threads : static_cast<int>(std::clamp(cores, 1u, 256u));
}

void NeedNetworksFor(const Suite& suite) {
  if (HasNetwork(suite)) NeedNetworks();
}

std::unique_ptr<World> MakeWorld(const SuiteWorld& world, const Suite& suite, const Store* store) {
  if (world.type == "evac") return MakeEvacWorld(world, suite, store);
  if (world.type == "echo") return std::make_unique<EchoWorld>(RecordingsOf(suite), world.name);
  auto made = std::make_unique<sim::MujocoWorld>(
      sim::MujocoWorldOptions{.name = world.name, .profile = world.profile, .threads = Threads(suite), .film = world.film});
  for (const Task& task : suite.tasks) made->Read(task);
  DemandUnchanged(suite, world);  // what is stored bears the suite's hash
  return made;
}

std::vector<std::string> CommandLine(const SuitePolicy& policy, const Suite& suite) {
  std::vector<std::string> words = {FindProgram(policy.command.front(), suite)};
  for (std::size_t i = 1; i < policy.command.size(); ++i) words.push_back(Filled(policy.command[i], suite));
  return words;
}

std::string DeclaredOtherwise(const SuitePolicy& policy, const PolicySpec& declared) {
  const auto differs = [](const std::string& ours, const std::string& theirs) {
    return !ours.empty() && !theirs.empty() && ours != theirs;
  };
  const auto said = [](const std::string& checkpoint) {  // nobody says the default one
    return checkpoint == kDefaultCheckpoint ? std::string() : checkpoint;
  };
  const bool is_other = differs(policy.name, declared.name) ||
                        differs(said(policy.checkpoint), said(declared.checkpoint));
  if (!policy.command.empty() || !is_other) return "";
  return fmt::format("policy {}@{} declares itself as {}@{}; its episodes are called as the suite says", policy.name,
                     policy.checkpoint, declared.name, declared.checkpoint);
}

RunningPolicy::RunningPolicy(const SuitePolicy& policy, const Suite& suite, const fs::path& run_folder, std::function<bool()> interrupted)
    : entry_(policy), suite_(suite) {
  LcmPolicyOptions options;
  options.interrupted = std::move(interrupted);
  options.deadline_s = suite.transport.deadline_s;
  options.repeat_after_s = suite.transport.repeat_after_s;
  options.start_s = suite.transport.start_s;
  options.keep_longer_chunks = suite.latency.kind != PolicyLatency::Kind::kOff;
  options.raw_images = suite.transport.images == "raw";
  const std::string who = fmt::format("policy {}@{}", policy.name, policy.checkpoint);
  options.who = who;
  if (policy.command.empty()) {
    options.address = {policy.join_url, policy.join_token};
  } else {
    options.address = NewAddress(fmt::format("{} {}@{}", fs::absolute(run_folder).string(), policy.name, policy.checkpoint));
    const PolicyProcessOptions started = ProcessOptions(policy, suite, run_folder, options.address);
    options.if_silent = fmt::format("its output: {}; `transport.start_s` gives it longer", started.log.string());
    process_.emplace(started);
    options.why_gone = [this] { return process_->WhyGone(); };
    options.restart = [this](auto asked) { process_->Restart(asked); };
  }
  link_.emplace(std::move(options));
  spec_ = link_->Handshake(HarnessSpec(suite.tasks.front(), suite.chunk_size), suite.transport.start_s);
  CheckAllTasks(suite, who, spec_);
  CheckInstruction(suite, who, spec_);
  CheckFiles();
}

void RunningPolicy::CheckFiles() {
  if (checked_ == link_->declared()) return;
  checked_ = link_->declared();
  DemandUnchanged(suite_, entry_);  // what is stored bears the suite's hash
}

Counters RunningPolicy::counters() const {
  Counters counters = link_->counters();
  if (process_) counters["restarts"] = process_->restarts();
  return counters;
}

}  // namespace evac
