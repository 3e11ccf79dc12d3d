#pragma once

#include <Eigen/Geometry>
#include <cstdint>
#include <map>
#include <opencv2/core.hpp>
#include <optional>
#include <string>
#include <vector>

/// The nouns of the project. Structs carry, they guard nothing; `core/check.h` says what is valid.
/// Frames: `base` is the robot's base (x forward, y left, z up, metres); a camera's axes are OpenCV's (x right, y down,
/// z forward); `a_from_b` maps coordinates in b to coordinates in a. Images are RGB, 8 bit, everywhere.
namespace evac {

/// One arm's end effector.
struct ArmState {
  Eigen::Isometry3d base_from_gripper = Eigen::Isometry3d::Identity();  ///< metres; see docs/add_a_task.md for axes
  double closure = 0;  ///< 0 open … 1 closed; vendor units are converted once, where data enters
};

/// One or two arms, in the order of `Task::arms`: {right}, or {left, right}.
using Arms = std::vector<ArmState>;

/// What a policy answers: absolute targets, one per `Task::period_s`, never empty.
struct ActionChunk {
  std::vector<Arms> targets;   ///< targets[k] is due (k + 1) periods after the observation it answers
  bool ends_recording = false; ///< a replayed recording has nothing after these: the episode ends with them
  double thinking_s = 0;       ///< how long the answer took, by the wall clock; 0 where nobody measured it
};

enum class Mount { kBase, kLeftGripper, kRightGripper };

/// A pinhole camera without distortion.
struct Camera {
  std::string name;  ///< AgiBot's names: head, hand_left, hand_right
  int width_px = 0;
  int height_px = 0;
  double fx_px = 0, fy_px = 0, cx_px = 0, cy_px = 0;  ///< pixel centres at integer + 0.5
  Mount mount = Mount::kBase;
  Eigen::Isometry3d mount_from_camera = Eigen::Isometry3d::Identity();
};

/// What a policy may see: nothing else of the world reaches it.
struct Observation {
  std::vector<cv::Mat> images;      ///< CV_8UC3 RGB, in the order of Task::cameras; empty once written to the video
  Arms arms;                        ///< in the order of Task::arms
  bool arms_are_commanded = false;  ///< true: nobody measured the arms, these are the last targets
};

/// The first frame of one (task, initial state) in the real world: where every imagined episode starts.
struct InitialScene {
  std::vector<cv::Mat> images;  ///< lossless, in the order of `cameras`
  Arms arms;
  std::vector<Camera> cameras;
};

/// The pose of one body and the contacts of one frame of a physics world. Only the oracle judge reads it.
struct PrivilegedFrame {
  struct Body {
    std::string name;
    Eigen::Isometry3d base_from_body = Eigen::Isometry3d::Identity();
  };
  struct Contact {
    std::string a, b;      ///< body names, a < b
    double force_n = 0;    ///< sum of normal forces between the two bodies
  };
  std::vector<Body> bodies;
  std::vector<Contact> contacts;
};
using PrivilegedTrack = std::vector<PrivilegedFrame>;

/// One way in which a task can begin. `seed` decides pose, colour, light and clutter.
struct InitialState {
  /// "<suite seed>-<index, 4 digits>", e.g. "41-0007". Of recordings: "recording" of one alone, else the recording's
  /// name or, in a collection, its row's initial state.
  std::string id;
  std::uint64_t seed = 0;
};

/// The paper's stop rule: an episode has come to rest when, for `dwell_chunks` chunks in a row and not before
/// `min_chunks`, both the commanded chunk and the observed gripper move by less than each of these: never, with a 0.
struct StillRule {
  bool enabled = true;  ///< false while a recording is replayed
  double translation_m = 0.005;
  double rotation_rad = 0.05;
  double closure = 0.05;  ///< in [0, 1]
  int dwell_chunks = 2;
  int min_chunks = 3;
};

/// One condition on a privileged frame, as data. `a` and `b` name bodies of the scene.
struct Condition {
  std::string kind;  ///< see judges/oracle_judge.h for the kinds
  std::string a, b;
  std::optional<double> above, below;  ///< in the unit of the kind
};

/// One step towards success. Stages are reached in order; each is judged after the one before it was reached.
struct Stage {
  std::string name;        ///< reach, grasp, lift, place, release
  std::string description; ///< for human raters
  std::vector<Condition> all_of;
  double hold_s = 0;       ///< how long all conditions must hold without a break
  bool at_end = false;     ///< must (also) hold at the last frame
};

/// The version of a rubric that nobody wrote: what success is was not said.
inline constexpr const char* kNoRubric = "none";

struct Rubric {
  std::string version;
  std::string success;  ///< one sentence: what a human calls success
  std::vector<Stage> stages;
};

/// What is to be done, immutable once stored.
struct Task {
  std::string id;           ///< take_bottle
  std::string instruction;  ///< what a language-conditioned policy is told
  std::vector<std::string> arms = {"right"};  ///< {"right"} or {"left", "right"}
  std::vector<Camera> cameras;  ///< as calibrated: what a policy is told, not what is true
  double period_s = 0.1;
  int max_chunks = 0;
  StillRule still;
  Eigen::AlignedBox3d workspace_m{Eigen::Vector3d(-2, -2, -2), Eigen::Vector3d(2, 2, 2)};  ///< base frame
  Rubric rubric;
  std::string page;       ///< the YAML text it was read from, with the sections only some worlds read; may be empty
  std::string page_path;  ///< absolute; files named in the page are relative to its folder
};

enum class StopReason { kStill, kMaxChunks, kRecordingEnd, kPolicyError, kPolicyTimeout, kWorldError, kDiverged };

/// "still", "max_chunks", …: the names that are stored and printed.
const char* Name(StopReason reason);
/// @throws InvalidInput for a name that is none.
StopReason StopReasonFromName(const std::string& name);
/// Whether an episode that stopped so is a failed one: a row with a reason that no success rate counts.
bool IsFailure(StopReason reason);

/// Why an episode could not go on; never a verdict about the policy's skill.
struct Failure {
  StopReason stop = StopReason::kWorldError;
  std::string message;
};

/// The checkpoint of a policy that names none.
inline constexpr const char* kDefaultCheckpoint = "default";

/// The pair key: what must agree for two episodes in two worlds to be compared.
struct PairKey {
  std::string task, initial_state, policy, checkpoint;
  std::uint64_t seed = 0;
  auto operator<=>(const PairKey&) const = default;
};

/// The pair key and the world: one episode of a run, and the name of its files.
struct EpisodeKey {
  PairKey pair;
  std::string world;
  auto operator<=>(const EpisodeKey&) const = default;
  /// "real/take_bottle/visual_pick@good/41-0007-s1": unique in a run, safe as a path.
  std::string Id() const;
};

/// One attempt. Unless it failed, observations = commands + 1 (the first is Reset's).
struct Episode {
  EpisodeKey key;
  std::vector<Observation> observations;  ///< images only in the newest while it runs, in none once stored
  std::vector<Arms> commands;             ///< executed targets, one per period
  int chunks = 0;
  StopReason stop = StopReason::kWorldError;
  std::string stop_reason;  ///< the sentence with the numbers
  std::string failure;      ///< the message of a failed episode, else empty
  std::string video;        ///< relative to the run's folder; empty before it is stored or when there is none
  std::string video_sha256; ///< lower-case hex
  std::string thumbnail;    ///< relative to the run's folder, JPEG
};

enum class Label { kSuccess, kFailure, kCannotTell, kInvalid };
/// "success", "failure", "cannot_tell", "invalid".
const char* Name(Label label);
Label LabelFromName(const std::string& name);

/// What one judge says of one episode. Append-only.
struct Verdict {
  std::string episode_id;
  std::string judge;  ///< oracle, human:<rater>, human, vlm:<config>, classifier:<weights hash>
  Label label = Label::kCannotTell;
  std::optional<double> probability;        ///< of success, where the judge has one
  std::map<std::string, bool> stages;       ///< stage name → reached
  std::string reason;
  std::string rubric_version;
};

}  // namespace evac
