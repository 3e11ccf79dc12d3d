#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "core/types.h"
#include "core/video.h"

namespace evac {

/// What a run was made from; stored once, at its start, and never changed.
struct RunInfo {
  std::string suite_text;  ///< the effective suite (after --set), YAML
  std::string suite_hash;  ///< SHA-256 of its canonical form and of every page it names
  std::string suite_path;  ///< where it was read from; for resume, no part of any result
  std::string evac_version;
};

struct WorldInfo {
  std::string name;          ///< real, sim, evac, …: as the suite calls it
  std::string type;          ///< mujoco, evac, echo
  bool is_real = false;      ///< the reference of every comparison; its first frames are the initial scenes
  /// Of what decides its behaviour beside the task: MuJoCo's profile page; evac's weights, page, statistics, sampler.
  /// Empty for echo.
  std::string profile_hash;
};

struct PolicyInfo {
  std::string name, checkpoint;
  std::string declaration;  ///< the spec it declared at the handshake, JSON
};

/// How many episodes the suite asks for of one policy on one task in one world, whatever is there of them.
struct PlannedEpisodes {
  std::string task, world, policy, checkpoint;
  std::int64_t episodes = 0;
  bool operator==(const PlannedEpisodes&) const = default;
};

/// Everything that is written when an episode ends.
struct EpisodeRecord {
  Episode episode;
  PrivilegedTrack privileged;          ///< empty or one per observation
  std::optional<FinishedVideo> video;  ///< already on disk under its final name, inside the run's folder
  std::string thumbnail_jpeg;          ///< bytes; empty when there is no frame
};

/// One trial on a real robot that evac did not run: imported, append-only.
struct RealTrial {
  std::string task, initial_state, policy, checkpoint;
  std::int64_t trial = 0;  ///< counts repeats of the same (task, initial state, policy, checkpoint)
  Label outcome = Label::kCannotTell;
  std::string video;   ///< relative to the run's folder; empty: none
  std::string source;  ///< where it came from: "/lab/monday/trials.csv:12"; of an earlier evac "trials.csv:12"
  bool operator==(const RealTrial&) const = default;
};

/// One look at a sequential comparison: what the bet was worth then. Its p-value is 1 / the largest of all looks.
struct SequentialLook {
  std::string comparison;  ///< which policies, world and judge
  std::string task;        ///< empty: all tasks together
  std::int64_t pairs = 0, only_first = 0, only_second = 0;
  double e_value = 1;
  bool operator==(const SequentialLook&) const = default;
};

/// What a gate decided of this run, never changed: the same key gets the stored decision again.
struct GateRecord {
  std::string key;       ///< what the decision follows from: rules, baseline, data
  std::string gate;      ///< the name of the rules
  std::string outcome;   ///< pass, fail, inconclusive
  std::string document;  ///< the decision, JSON (docs/formats/gate_json.md)
  bool operator==(const GateRecord&) const = default;
};

/// How one episode ended, for one judge: what rates are counted from. Its texts live as long as the call that gets it.
struct EndedEpisode {
  std::string_view task, initial_state, policy, checkpoint, world;
  bool failed = false;
  std::optional<Label> label;  ///< the judge's current one; nothing: it gave none
};

/// How often the wire misbehaved, by name ("repeats", "stale_replies", …): counts of effort, no part of a result.
using Counters = std::map<std::string, std::int64_t>;

/// The kind of every error of a run's database: whoever catches what an episode's world or policy throws lets it through.
inline constexpr const char* kStoreError = "store";

/// One run's truth: RUN/evac.sqlite and the files it names (docs/formats/run.md). Everything else is derived from it.
/// WAL, synchronous=FULL, one writer process at a time (a lock file), any number of readers. Thread-safe.
class Store {
 public:
  enum class Mode { kReadOnly, kReadWrite };

  /// Begins a run in `folder` (made if absent), or continues the one there if it has the same suite hash. One of another
  /// suite that never came to an episode makes room.
  /// @throws InvalidInput if another run is there, another process writes it, its schema is newer than this program, or
  /// `folder` is a file, lies in one or cannot be looked at; also where somebody's files would be in the way: in videos/
  /// or thumbs/ (or these are links) of a folder without a run, or a file called lock that is none.
  static Store CreateOrContinue(const std::filesystem::path& folder, const RunInfo& run);
  /// @throws InvalidInput if there is no run in `folder`, or nobody can know (StatusOf). Older schemas are migrated
  /// (kReadWrite) or read as they are.
  static Store Open(const std::filesystem::path& folder, Mode mode);
  /// For tests: nothing on disk but the videos, which go to `folder`.
  static Store InMemory(const std::filesystem::path& folder, const RunInfo& run);

  Store(Store&&) noexcept;
  Store& operator=(Store&&) noexcept;
  ~Store();

  /// "SQLite 3.40.1", for `evac doctor`.
  static std::string Engine();

  const std::filesystem::path& folder() const;
  RunInfo run() const;

  /// Declarations: adding the same again changes nothing; adding something else under a known name throws.
  /// @param page_hash  of its page with all files that this names, as the suite's hash has it; empty: it has none
  void AddTask(const Task& task, const std::string& page_hash = "");
  void AddWorld(const WorldInfo& world);
  void AddPolicy(const PolicyInfo& policy);
  /// The same, but one that has no episode yet may say something else than it did: it was mended since.
  void AddPolicyAsItIsNow(const PolicyInfo& policy);
  std::vector<Task> Tasks() const;
  std::vector<WorldInfo> Worlds() const;
  std::vector<PolicyInfo> Policies() const;
  /// By task; without those that have none, or that an earlier evac declared.
  std::map<std::string, std::string> PageHashes() const;

  /// Of the whole suite, also where this run is one shard of it: what there is to be in the end. Of what is known
  /// already the larger number stays (another machine could read more of the recordings). Tasks and worlds must have
  /// been added before.
  void AddPlan(const std::vector<PlannedEpisodes>& plan);
  /// By task, world, policy and checkpoint. Empty: an earlier evac began the run, and did not say.
  std::vector<PlannedEpisodes> Plan() const;

  /// One transaction: the episode's row, its steps, privileged track, video path and hash are there, or nothing is.
  /// Its task, world and policy must have been added before.
  /// @throws Error if the episode is there already, its video is not in the run's folder, or the disk is full (the
  /// store stays intact).
  void Add(const EpisodeRecord& record);
  /// The same for many at once, all of them or none: an episode alone waits for the disk, a thousand wait once.
  void AddAll(std::span<const EpisodeRecord> records);
  bool Has(const EpisodeKey& key) const;
  /// Removes a failed episode and its verdicts so that it can run again (`resume --retry-failed`).
  void RemoveFailed(const EpisodeKey& key);

  /// All episodes in pair-key order, then world: without observations and commands (see LoadSteps).
  std::vector<Episode> Episodes() const;
  /// Each episode once, in no promised order, none of them kept: a million fit into no list that anybody wants.
  void ForEachEnded(const std::string& judge, const std::function<void(const EndedEpisode&)>& see) const;
  /// Fills in observations (arms only, no images) and commands.
  void LoadSteps(Episode& episode) const;
  /// For the oracle judge alone; empty if the world had none.
  PrivilegedTrack LoadPrivileged(const std::string& episode_id) const;

  /// Kept for the lowest seed per (task, initial state), so that the order of finishing does not matter. Lossless. Once an
  /// episode of a world of type evac is there that did not fail, the scene that it began from stays: what is imagined
  /// later begins there too, though a failed real episode that ran again would give one of a lower seed.
  void AddInitialScene(const PairKey& pair, const InitialScene& scene);
  std::optional<InitialScene> LoadInitialScene(const std::string& task, const std::string& initial_state) const;

  /// Of which episodes: their pair keys.
  std::vector<PairKey> InitialScenes() const;

  void AddVerdict(const Verdict& verdict);
  /// All of them or none.
  void AddVerdicts(std::span<const Verdict> verdicts);
  /// Every verdict ever given, oldest first.
  std::vector<Verdict> Verdicts() const;
  /// The current one per (episode id, judge): the last added.
  std::map<std::string, std::map<std::string, Verdict>> CurrentVerdicts() const;
  /// Who gave verdicts, sorted; without reading these.
  std::vector<std::string> Judges() const;

  /// All of them or none. @throws InternalError if one of the same task, state, policy, checkpoint and trial is there,
  /// or its task is not.
  void AddRealTrials(const std::vector<RealTrial>& trials);
  /// In the order they were added.
  std::vector<RealTrial> RealTrials() const;

  /// All of them or none.
  void AddLooks(const std::vector<SequentialLook>& looks);
  /// Every look ever taken, oldest first.
  std::vector<SequentialLook> Looks() const;

  /// A decision and the looks it took, both or neither. @throws InternalError if there is a decision with that key.
  void AddGateRecord(const GateRecord& record, const std::vector<SequentialLook>& looks);
  /// The decision with that key stands again: it becomes the newest, as it is. Without one nothing changes.
  void RepeatGateRecord(const std::string& key);
  /// In the order they were made, or last asked for again.
  std::vector<GateRecord> GateRecords() const;

  /// Adds to the run's counters.
  void Count(const std::string& policy, const Counters& counters);
  std::map<std::string, Counters> CountersByPolicy() const;

  /// Removes videos, thumbnails and .tmp files that no row names: what a kill left behind. Call when continuing, before
  /// running.
  void RemoveOrphans();

  /// RUN/videos/<episode id>.mp4, its folder made.
  std::filesystem::path VideoPath(const EpisodeKey& key) const;

 private:
  struct Database;
  explicit Store(std::unique_ptr<Database> database);
  std::unique_ptr<Database> database_;
};

}  // namespace evac
