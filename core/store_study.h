#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "core/types.h"

namespace evac {

enum class RaterRole { kRater, kAdjudicator, kLead };
/// "rater", "adjudicator", "lead".
const char* Name(RaterRole role);
/// @throws InvalidInput for a name that is none.
RaterRole RaterRoleFromName(const std::string& name);

/// Why a rater is shown a clip.
enum class Showing { kCounted, kGold, kPractice, kExample, kRepeat, kAdjudication, kImport };
/// "counted", "gold", "practice", "example", "repeat", "adjudication", "import".
const char* Name(Showing showing);
/// @throws InvalidInput for a name that is none.
Showing ShowingFromName(const std::string& name);

/// What a study was begun with; never changed.
struct StudyInfo {
  std::string name;
  std::uint64_t seed = 0;  ///< of every order
  int raters_per_clip = 3;
  int width_px = 0, height_px = 0;  ///< of every clip as it is shown
  double period_s = 0.1;            ///< of every clip as it is shown
  std::string evac_version;
};

/// What raters are told of a task. A changed rubric is another row: old verdicts stay with theirs.
struct StudyRubric {
  std::string hash;  ///< SHA-256 of `document`
  std::string task;
  std::string document;  ///< JSON: instruction, success, version, stages [{name, description}]
};

/// How a study calls a run: the same of all that names one folder. A separator at its end or a link makes no other run
/// of it.
std::filesystem::path OneFormOf(const std::filesystem::path& run);

/// One frozen clip. What a rater may not know is here; what a rater sees is the file and the rubric.
struct StudyClip {
  std::int64_t id = 0;  ///< given by the store
  int wave = 1;
  std::string run;      ///< folder of the run, OneFormOf it; earlier versions wrote it as it was given
  std::string episode;  ///< its id there
  std::string task, initial_state, policy, checkpoint, world;
  bool is_real = false;
  std::string source_sha256;        ///< of the run's own video
  Showing use = Showing::kCounted;  ///< counted, gold, practice or example
  std::optional<Label> reference;   ///< of all but counted ones: what is known of it
  std::string reference_reason;
  std::string rubric_hash;
  std::string views;  ///< JSON: [{name, x, y, width, height}], shares of the picture
  std::string file;   ///< below the study's folder
  std::string video_sha256;
  int frames = 0;
};

struct StudyRater {
  std::int64_t id = 0;
  RaterRole role = RaterRole::kRater;
  std::string name;               ///< as the rater gave it; may be empty
  std::string status = "active";  ///< active, withdrawn, excluded, erased, imported
  bool counts = true;             ///< whether the verdicts are in any rate
  std::int64_t tab_epoch = 0;     ///< of the browser's tab that may write
  std::int64_t joined_ms = 0;
};

/// One clip in one rater's order.
struct Presentation {
  std::string id;  ///< a secret: under this name the rater's browser gets the video
  std::int64_t rater = 0, clip = 0;
  int order_index = 0;
  Showing showing = Showing::kCounted;
  std::string repeat_of;                 ///< another presentation's id, of the same clip; else empty
  std::string state = "open";            ///< open, answered, unplayable
  std::optional<std::int64_t> shown_ms;  ///< when it was first given out
  std::int64_t lease_until_ms = 0;       ///< until then it is counted as a vote to come
};

/// One row of what a rater said. Rows are added and never changed; the current one has no successor.
struct HumanVerdict {
  std::int64_t id = 0;  ///< given by the store
  std::string client_uuid;
  std::string presentation;
  std::int64_t rater = 0, clip = 0;
  std::optional<std::int64_t> supersedes;
  std::string label;               ///< success, failure, cannot_tell; retracted: undone, nothing is said any more
  int stages = 0;                  ///< bit k: stage k was reached
  std::optional<double> progress;  ///< 0 … 1
  std::string flags;               ///< names, separated by spaces
  std::string cause;               ///< of a failure, one name or empty
  std::string note;
  std::optional<int> confidence;  ///< 1 … 3
  bool is_final = false;          ///< an adjudicator's word after seeing the others'
  std::int64_t created_ms = 0;    ///< the server's clock; all others below are the browser's monotonic one
  double shown_at_ms = 0, first_play_ms = 0, decided_ms = 0, rt_ms = 0, visible_ms = 0;
  std::string played = "[]";  ///< JSON: [[from_s, to_s], …]
  double coverage = 0;        ///< share of the clip that was on the screen
  double max_speed = 0, median_speed = 0;
  int seeks = 0, replays = 0, pauses = 0;
  double stalls_ms = 0;
  bool interrupted = false;  ///< the page was loaded anew before the verdict
  std::string viewport;      ///< "1280x800"
  double pixel_ratio = 0;
  std::string ua_hash;  ///< SHA-256 of the browser's name; dropped at erasure, as the note
  std::int64_t tab_epoch = 0;
  std::string app_version;
};

/// A table for export: cells are text, NULL is an empty one.
struct StudyTable {
  std::vector<std::string> columns;
  std::vector<std::vector<std::string>> rows;
};

/// One rating study: STUDY/study.sqlite and the clips beside it (docs/formats/study.md). WAL, synchronous=FULL. One
/// thread at a time; any number of processes may read. What is asked for and not as it is written (a seed, a rubric, a
/// clip's views, a clip or rater that is not there) is an InvalidInput that names the file.
class StudyStore {
 public:
  enum class Mode { kReadOnly, kReadWrite };

  /// Whether a study was begun in `folder`: what a process left that was killed before its first commit is none.
  static bool IsIn(const std::filesystem::path& folder);
  /// @throws InvalidInput if there is a study in `folder` already.
  static StudyStore Create(const std::filesystem::path& folder, const StudyInfo& info);
  /// @throws InvalidInput if there is none, or a newer program's.
  static StudyStore Open(const std::filesystem::path& folder, Mode mode);
  StudyStore(StudyStore&&) noexcept;
  StudyStore& operator=(StudyStore&&) noexcept;
  ~StudyStore();

  const std::filesystem::path& folder() const;
  StudyInfo info() const;
  /// Every row is there that another one names. Reads the whole study once.
  /// @throws InvalidInput naming the file, the first row whose own is missing, and what it names.
  void RequireWhole() const;
  /// 12 hex digits that no other study has, the same for as long as it lives: what browsers tell studies apart by.
  std::string Id() const;

  /// Many changes with one wait for the disk: nothing is kept before Commit.
  void Begin();
  void Commit();
  void Rollback();
  /// Within Begin … Commit: what is done between Mark and Undo is as if it had not been.
  void Mark();
  void Release();
  void Undo();

  // ---- what is rated
  /// All of them or none. @returns the wave's list hash: SHA-256 over its clips in their order.
  /// @param codec_sha256  of the codec that clips of worlds not imagined were put through; empty: through none
  std::string AddWave(std::span<const StudyClip> clips, std::span<const StudyRubric> rubrics,
                      const std::string& codec_sha256 = "");
  /// Of the first wave.
  std::string Codec() const;
  int Waves() const;
  std::vector<StudyClip> Clips() const;
  StudyClip Clip(std::int64_t id) const;
  std::vector<StudyRubric> Rubrics() const;
  /// How many votes each clip has that count, by clip; those without are left out.
  std::map<std::int64_t, std::int64_t> Votes() const;

  // ---- people
  /// @param secret  of the link; its hash alone is kept.
  void AddInvite(const std::string& secret, RaterRole role, std::int64_t now_ms);
  struct Invite {
    RaterRole role = RaterRole::kRater;
    std::optional<std::int64_t> used_by;
    std::string used_uuid;
  };
  std::optional<Invite> FindInvite(const std::string& secret) const;
  /// Makes the rater and marks the link as used by it.
  StudyRater Join(const std::string& secret, const std::string& uuid, const std::string& name, std::int64_t now_ms);
  /// One who came with an imported table. Found again by name.
  StudyRater ImportedRater(const std::string& name, std::int64_t now_ms);
  void AddSession(std::int64_t rater, const std::string& secret, std::int64_t now_ms);
  std::optional<StudyRater> RaterOfSession(const std::string& secret) const;
  StudyRater Rater(std::int64_t id) const;
  std::vector<StudyRater> Raters() const;
  std::int64_t NextTab(std::int64_t rater);
  /// Ends the sessions. @param erase  drops name, notes and browser hashes as well.
  void Withdraw(std::int64_t rater, bool keep, bool erase, std::int64_t now_ms);

  // ---- who sees what
  void AddPresentations(std::span<const Presentation> presentations);
  std::optional<Presentation> FindPresentation(const std::string& id) const;
  std::vector<Presentation> PresentationsOf(std::int64_t rater) const;
  /// Of what a rater is asked: gold and repeats too, examples and practice not, nor what could not be played.
  struct Progress {
    std::int64_t done = 0;   ///< answered
    std::int64_t total = 0;  ///< and still to be asked, as things are now: less when others rate a clip first
    std::int64_t practice_left = 0;
  };
  Progress ProgressOf(std::int64_t rater, std::int64_t now_ms) const;
  /// The first open one of the rater's order whose clip still wants votes: those that count and those to come under a
  /// lease of others are fewer than raters_per_clip (gold and practice always are wanted, a repeat once its first is
  /// answered).
  /// @param held  ids that the browser has already.
  std::optional<Presentation> NextOpen(std::int64_t rater, std::span<const std::string> held,
                                       std::int64_t now_ms) const;
  void Lease(const std::string& presentation, std::int64_t until_ms, std::int64_t now_ms);
  void SetState(const std::string& presentation, const std::string& state);
  void AddEvent(std::int64_t rater, const std::string& what, const std::string& detail, std::int64_t now_ms);

  // ---- what was said
  /// @returns with its id. @throws InternalError if its uuid is there, or what it supersedes has a successor.
  HumanVerdict AddVerdict(HumanVerdict verdict);
  std::optional<HumanVerdict> VerdictByUuid(const std::string& uuid) const;
  std::optional<HumanVerdict> VerdictById(std::int64_t id) const;
  /// The last row of a presentation, "retracted" or not.
  std::optional<HumanVerdict> LastVerdict(const std::string& presentation) const;
  /// The current one of a presentation, "retracted" ones not.
  std::optional<HumanVerdict> CurrentVerdict(const std::string& presentation) const;
  /// Every current verdict (not retracted), oldest first, each with its presentation.
  struct Said {
    HumanVerdict verdict;
    Showing showing = Showing::kCounted;
    std::string repeat_of;
    bool counts = true;  ///< its rater does
    RaterRole role = RaterRole::kRater;
  };
  std::vector<Said> Current() const;
  std::vector<Said> CurrentOf(std::int64_t clip) const;
  std::vector<Said> CurrentBy(std::int64_t rater) const;

  /// A verdict as it is counted, without what only an export wants.
  struct Ballot {
    std::int64_t id = 0, supersedes = 0;  ///< of verdicts; 0: it replaces none
    std::int64_t rater = 0, clip = 0;
    std::string label;
    Showing showing = Showing::kCounted;
    RaterRole role = RaterRole::kRater;
    bool is_final = false;
    int stages = 0;
    bool has_flags = false;
    double rt_ms = 0, max_speed = 0;
    std::int64_t since_ms = 0;  ///< when it was said, by the server's clock
  };
  /// Every row after that verdict, oldest first: replaced ones, "retracted" ones and those that do not count too.
  std::vector<Ballot> BallotsAfter(std::int64_t verdict) const;
  /// Clips with all their votes that somebody must decide: split, nobody could tell, against the reference, or flagged
  /// by two. Not those that an adjudicator decided; one who left and counts no more has decided none.
  std::vector<std::int64_t> Disputes() const;
  /// Clips that a browser could not play, with the reason, newest first.
  struct Unplayable {
    std::int64_t rater = 0, clip = 0;
    std::string reason;
  };
  std::vector<Unplayable> UnplayableClips() const;
  /// Who holds a clip now.
  std::vector<Presentation> Leases(std::int64_t now_ms) const;

  /// "Generated or recorded?" @param guess  real, generated or unsure.
  void AddGuess(std::int64_t rater, std::int64_t clip, const std::string& guess, std::int64_t now_ms);
  struct Guess {
    std::int64_t rater = 0, clip = 0;
    std::string guess;
  };
  std::vector<Guess> Guesses() const;

  /// Every verdict ever given with every stored field, its clip's and its rater's.
  /// @throws InvalidInput as RequireWhole: one whose clip or rater is missing would be left out.
  StudyTable VerdictTable() const;
  /// The same of one rater, without what a rater may not know.
  StudyTable VerdictTableOf(std::int64_t rater) const;

 private:
  struct Database;
  explicit StudyStore(std::unique_ptr<Database> database);
  std::unique_ptr<Database> database_;
};

}  // namespace evac
