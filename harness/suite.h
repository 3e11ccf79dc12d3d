#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "core/store.h"
#include "core/types.h"
#include "harness/policy_latency.h"
#include "harness/suite_evac.h"

namespace evac {

struct SuiteWorld {
  std::string name;
  std::string type;      ///< mujoco, echo, evac
  bool is_real = false;  ///< `role: real`
  std::filesystem::path
      profile;  ///< mujoco: the page of its physical truth; absolute or relative to the working directory
  bool film = true;                    ///< mujoco: false: no clips, and nothing is drawn that no policy is shown
  std::optional<SuiteEvac> evac = {};  ///< evac: its network
  int initial_states = 0;              ///< only the first so many of the suite's; 0: all of them
};

struct SuitePolicy {
  std::string name, checkpoint;
  std::vector<std::string> command;  ///< empty: joins a policy that runs already
  std::string join_url, join_token;  ///< where it listens
  std::vector<std::string> files = {};  ///< and folders that decide what it does: hashed by content; absolute
};

struct Transport {
  double deadline_s = 10;       ///< a policy that has not answered by then has failed the episode
  double repeat_after_s = 1;    ///< an unanswered request is sent again after this
  double start_s = 30;          ///< how long a policy may take to declare itself, and to begin an episode
  std::string images = "jpeg";  ///< jpeg or raw
};

/// What is done about a policy whose first chunk does not look like its declared conventions (harness/start_probe.h).
enum class StartProbe { kRefuse, kWarn, kOff };

/// What a suite says of the task of its recordings; what it leaves out is made up from these.
struct RecordedTask {
  std::optional<std::string> name;                 ///< what seeds are drawn from, judges and comparisons go by
  std::optional<std::string> instruction;          ///< what policies, raters and judges are told
  std::optional<Rubric> rubric;                    ///< in words
  std::optional<Eigen::AlignedBox3d> workspace_m;  ///< base frame
  std::optional<StillRule> still;                  ///< none: only the end of the actions or the limit ends an episode
  int max_chunks = 0;                              ///< 0: as many as hold the longest recording
};

/// What a file was when it was hashed. One of the same size and time since then is not read again.
struct HashedFile {
  std::string sha256;
  std::uintmax_t bytes = 0;
  std::filesystem::file_time_type written = {};
};

/// One YAML file holds a whole evaluation (docs/suite.md). Paths in it are relative to the file.
struct Suite {
  std::string name;
  std::filesystem::path path;
  std::string text;  ///< the effective suite: after `--set`
  std::string hash;  ///< of everything that can change a result: the effective suite and every page and scene it names
  std::string reality_hash;  ///< the same without the worlds of type evac, the policies and the number of initial states
  std::map<std::filesystem::path, std::string> page_hashes = {};  ///< PageHash of task pages and profiles, when read
  /// Of the policies' `files` and of the recording, by absolute path.
  std::map<std::filesystem::path, HashedFile> hashed_files = {};
  std::vector<SuiteWorld> worlds;
  std::vector<Task> tasks;  ///< cameras resized to `image`; those of a recording are filled in by apps/recorded_suite
  std::vector<SuitePolicy> policies;
  std::vector<std::uint64_t> seeds;
  std::vector<InitialState> initial_states;  ///< per task; their seeds mix in the task's id when used; of recordings
                                             ///< filled in as `recordings` is
  int chunk_size = 8;
  int lanes = 4;
  int threads = 0;           ///< 0: one per core
  double error_budget = .1;  ///< share of episodes that may fail before the run gives up
  std::vector<std::string> judges;  ///< oracle, or nobody
  VideoOptions video;
  Transport transport;
  PolicyLatency latency;
  StartProbe start_probe = StartProbe::kRefuse;
  std::optional<std::filesystem::path> recording;  ///< one, or a folder of several: each an initial state of one task
  int recorded_states = 0;                         ///< of such a folder only the first so many; 0: all
  /// By initial state, the folder of what begins there; filled in with the task by apps/recorded_suite.
  std::map<std::string, std::filesystem::path> recordings;
  RecordedTask recorded_task;
};

/// Whether a world of the suite is imagined by a network.
bool HasNetwork(const Suite& suite);

/// How many of so many episodes may fail before a run gives up: the suite's share of them, rounded down.
int AllowedFailures(const Suite& suite, int episodes);

/// @throws InvalidInput if a task's cameras, beside each other and scaled, are larger than a video can be. Of tasks that come
/// from recordings once these are read (ReadSuite checks the others).
void CheckVideoSizes(const Suite& suite);

/// The initial states that a world tries.
std::span<const InitialState> StatesOf(const Suite& suite, const SuiteWorld& world);

/// Reads and checks a suite.
/// @param assignments  `--set` values, in order; paths in them are relative to the working directory.
/// @throws InvalidInput naming file, line, field, what was found and what was wanted.
Suite ReadSuite(const std::filesystem::path& path, const std::vector<std::string>& assignments);

/// The same from the text that a store kept.
Suite ParseSuite(const std::string& text, const std::filesystem::path& path);

}  // namespace evac
