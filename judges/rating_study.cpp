#include "judges/rating_study.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <nlohmann/json.hpp>
#include <optional>
#include <set>
#include <tuple>

#include "core/error.h"
#include "core/file.h"
#include "core/hash.h"
#include "core/secret.h"
#include "core/seed.h"
#include "core/store.h"
#include "core/store_lock.h"
#include "core/video.h"
#include "judges/rating_clip.h"
#include "judges/rating_words.h"

namespace evac {
namespace {

namespace fs = std::filesystem;

/// A clip that will be in the study, and what it is made from.
struct Candidate {
  StudyClip clip;
  fs::path video;
  Task task;
  bool is_imagined = false;
  ClipLayout layout{};
};

constexpr int kLowest_px = 64;  // of a first view in which something can be seen
constexpr const char* kSecret = "secret";  // in clips/ until its wave is in the study

void Check(const StudyOptions& options) {
  if (options.runs.empty()) throw InvalidInput("--run: wanted the folder of a run");
  if (options.raters_per_clip < 1 || options.raters_per_clip > 50)
    throw InvalidInput("--raters: found {}, wanted 1 … 50", options.raters_per_clip);
  if (options.height_px && (*options.height_px < kLowest_px || *options.height_px > 1080))
    throw InvalidInput("--height: found {}, wanted {} … 1080", *options.height_px, kLowest_px);
  if (options.states < 0) throw InvalidInput("--states: found {}, wanted 0 (all) or more", options.states);
}

StudyClip ClipOf(const Episode& episode, const fs::path& run, bool is_real, const std::string& rubric_hash) {
  const PairKey& pair = episode.key.pair;
  StudyClip clip;
  clip.run = run.string();
  clip.episode = episode.key.Id();
  clip.task = pair.task;
  clip.initial_state = pair.initial_state;
  clip.policy = pair.policy;
  clip.checkpoint = pair.checkpoint;
  clip.world = episode.key.world;
  clip.is_real = is_real;
  clip.source_sha256 = episode.video_sha256;
  clip.rubric_hash = rubric_hash;
  return clip;
}

/// Each once, in their order.
std::vector<fs::path> RunsOf(const StudyOptions& options) {
  std::vector<fs::path> runs;
  for (const fs::path& run : options.runs) {
    fs::path form = OneFormOf(run);
    if (std::ranges::find(runs, form) == runs.end()) runs.push_back(std::move(form));
  }
  return runs;
}

/// Without one every rater would decide by an idea of success of their own.
void DemandRubrics(const std::vector<Candidate>& candidates) {
  for (const Candidate& candidate : candidates) {
    if (candidate.task.rubric.version != kNoRubric) continue;
    throw InvalidInput("{}: task {} has no rubric: raters would not be told what success is; wanted a run of a suite "
                       "with `rubric: {{success: …}}` beside its `recording` (docs/suite.md)",
                       candidate.clip.run, candidate.clip.task);
  }
}

/// A verdict that marks a later one could not be stored.
void DemandFewStages(const std::vector<Candidate>& candidates) {
  for (const Candidate& candidate : candidates) {
    const std::size_t stages = candidate.task.rubric.stages.size();
    if (stages > kMostStages)
      throw InvalidInput("{}: the rubric of task {} has {} stages, wanted at most {}", candidate.clip.run,
                         candidate.clip.task, stages, kMostStages);
  }
}

using StatesOfTasks = std::map<std::string, std::set<std::string>>;  // by task

StatesOfTasks StatesIn(const std::optional<StudyStore>& store) {
  StatesOfTasks states;
  if (!store) return states;
  for (const StudyClip& clip : store->Clips()) states[clip.task].insert(clip.initial_state);
  return states;
}

/// The states of each task that are drawn: those that the study has, then the others by a number of each of them alone,
/// so that states that came since change nothing about who was drawn before.
StatesOfTasks DrawnStates(const std::vector<Candidate>& candidates, const StatesOfTasks& there,
                          const StudyOptions& options) {
  StatesOfTasks drawn;
  for (const Candidate& candidate : candidates) drawn[candidate.clip.task].insert(candidate.clip.initial_state);
  for (auto& [task, states] : drawn) {
    const std::uint64_t seed = SeedFor(SeedFor(options.seed, "states"), task);
    const auto known = there.find(task);
    std::vector<std::tuple<bool, std::uint64_t, std::string>> ranked;  // whether it is new, its number, its name
    for (const std::string& state : states)
      ranked.emplace_back(known == there.end() || !known->second.contains(state), SeedFor(seed, state), state);
    std::ranges::sort(ranked);
    ranked.resize(std::min(ranked.size(), static_cast<std::size_t>(options.states)));
    states.clear();
    for (const auto& [is_new, number, state] : ranked) states.insert(state);
  }
  return drawn;
}

/// Once for all runs: drawn for each, pairs that lie in two of them would break.
void LeaveOutWhatIsNotDrawn(std::vector<Candidate>& candidates, const StatesOfTasks& there,
                            const StudyOptions& options) {
  if (options.states == 0) return;
  const auto drawn = DrawnStates(candidates, there, options);
  std::erase_if(candidates, [&](const Candidate& c) { return !drawn.at(c.clip.task).contains(c.clip.initial_state); });
}

/// Reads the runs: what can be rated, and what is known of it.
class Collector {
 public:
  explicit Collector(const StudyOptions& options) : options_(options) {}

  void Read(const fs::path& run) {
    const Store store = Store::Open(run, Store::Mode::kReadOnly);
    tasks_.clear(), worlds_.clear();
    for (const Task& task : store.Tasks()) tasks_[task.id] = task;
    for (const WorldInfo& world : store.Worlds()) worlds_[world.name] = world;
    const auto verdicts = store.CurrentVerdicts();
    int without_video = 0, failed = 0;
    for (const Episode& episode : store.Episodes()) {
      if (IsFailure(episode.stop))
        ++failed;
      else if (episode.video.empty())
        ++without_video;
      else
        Add(episode, run, verdicts);
    }
    if (failed > 0)
      left_out.push_back(fmt::format("{}: {} failed episodes: there is nothing to rate", run.string(), failed));
    if (without_video > 0)
      left_out.push_back(fmt::format("{}: {} episodes without a video", run.string(), without_video));
  }

  std::vector<Candidate> candidates;
  std::vector<std::string> left_out;

 private:
  /// @throws InvalidInput if the run says nothing of the episode's task or world
  template <typename Info>
  static const Info& Known(const std::map<std::string, Info>& by_name, const std::string& name, const char* what,
                           const fs::path& run, const Episode& episode) {
    const auto found = by_name.find(name);
    if (found != by_name.end()) return found->second;
    throw InvalidInput("{}: the run is damaged: episode {} names {} '{}', of which its database has no row; wanted the "
                       "run as it was",
                       run.string(), episode.key.Id(), what, name);
  }

  void Add(const Episode& episode, const fs::path& run,
           const std::map<std::string, std::map<std::string, Verdict>>& verdicts) {
    const Task& task = Known(tasks_, episode.key.pair.task, "task", run, episode);
    const WorldInfo& world = Known(worlds_, episode.key.world, "world", run, episode);
    Candidate candidate{ClipOf(episode, run, world.is_real, RubricOf(task).hash), run / episode.video, task,
                        world.type == "evac"};
    const auto of_episode = verdicts.find(episode.key.Id());
    if (!options_.gold_from.empty() && of_episode != verdicts.end()) {
      const auto known = of_episode->second.find(options_.gold_from);
      if (known != of_episode->second.end() &&
          (known->second.label == Label::kSuccess || known->second.label == Label::kFailure)) {
        candidate.clip.reference = known->second.label;
        candidate.clip.reference_reason = known->second.reason;
      }
    }
    candidates.push_back(std::move(candidate));
  }

  const StudyOptions& options_;
  std::map<std::string, Task> tasks_;        // of the run that is read
  std::map<std::string, WorldInfo> worlds_;  // likewise
};

/// So many clips of which it is known how they end.
struct Known {
  int successes = 0, failures = 0;
  int All() const { return successes + failures; }
};

/// `count` of them in their proportion, as well as whole numbers allow; of two or more both kinds, if both exist.
Known ShareOf(const Known& all, int count) {
  count = std::min(count, all.All());
  if (count <= 0) return {};
  int successes = static_cast<int>(std::lround(static_cast<double>(count) * all.successes / all.All()));
  if (count > 1 && all.successes > 0 && all.failures > 0) successes = std::clamp(successes, 1, count - 1);
  return {successes, count - successes};
}

Known KnownIn(const std::vector<Candidate>& candidates) {
  Known known;
  for (const Candidate& candidate : candidates) {
    known.successes += candidate.clip.reference == Label::kSuccess;
    known.failures += candidate.clip.reference == Label::kFailure;
  }
  return known;
}

/// Takes clips whose label is known for examples, practice and gold, never more than a quarter of all for one use.
/// Examples and practice are in no rate: they are taken in the proportion of what is known, or the rate of what is left
/// would be another. Gold is in it: by turns a success and a failure.
void ChooseKnown(std::vector<Candidate>& candidates, const StudyOptions& options) {
  std::vector<std::size_t> order(candidates.size());
  for (std::size_t i = 0; i < order.size(); ++i) order[i] = i;
  SplitMix64 draws(SeedFor(options.seed, "gold"));
  for (std::size_t i = order.size(); i > 1; --i) std::swap(order[i - 1], order[draws.Below(i)]);
  const auto take = [&](Label wanted, Showing use) {
    const auto next = std::ranges::find_if(order, [&](std::size_t i) {
      return candidates[i].clip.use == Showing::kCounted && candidates[i].clip.reference == wanted;
    });
    if (next == order.end()) return false;
    candidates[*next].clip.use = use;
    return true;
  };
  const auto take_all = [&](const Known& quota, Showing use) {
    for (int k = 0; k < quota.successes; ++k) take(Label::kSuccess, use);
    for (int k = 0; k < quota.failures; ++k) take(Label::kFailure, use);
  };
  const int quarter = static_cast<int>(candidates.size()) / 4;
  const int examples = std::min(options.examples, quarter), practice = std::min(options.practice, quarter);
  const Known uncounted = ShareOf(KnownIn(candidates), examples + practice);
  const Known shown = ShareOf(uncounted, examples);
  take_all(shown, Showing::kExample);
  take_all({uncounted.successes - shown.successes, uncounted.failures - shown.failures}, Showing::kPractice);
  const int gold = static_cast<int>(std::lround(options.gold_share * static_cast<double>(candidates.size())));
  for (int k = 0; k < std::min(std::max(options.min_gold, gold), quarter); ++k) {
    const Label wanted = k % 2 == 0 ? Label::kSuccess : Label::kFailure;
    const Label other = k % 2 == 0 ? Label::kFailure : Label::kSuccess;
    if (!take(wanted, Showing::kGold)) take(other, Showing::kGold);
  }
  for (Candidate& candidate : candidates) {
    if (candidate.clip.use != Showing::kCounted) continue;
    candidate.clip.reference = std::nullopt;
    candidate.clip.reference_reason.clear();
  }
}

struct Encoded {
  std::vector<StudyClip> clips;
  std::uintmax_t longest = 0;
};

/// As high as the study's picture, or lower where the views would be wider than it: of study and task alone, so that no
/// wave's clips of a task can be told from another's.
void LayOut(std::vector<Candidate>& candidates, const StudyInfo& info, const fs::path& folder) {
  for (Candidate& candidate : candidates) {
    const std::vector<Camera>& cameras = candidate.task.cameras;
    int height_px = info.height_px;
    candidate.layout = LayoutOf(cameras, height_px);
    while (candidate.layout.width_px > info.width_px && height_px > kLowest_px)
      candidate.layout = LayoutOf(cameras, height_px -= 2);
    if (candidate.layout.width_px > info.width_px)
      throw InvalidInput("{}: task {}: its views are {} px wide if they are {} px high, wanted at most {}, as wide as "
                         "the study's clips are",
                         folder.string(), candidate.task.id, candidate.layout.width_px, height_px, info.width_px);
  }
}

/// From which the names of a wave's clips follow: a call that was broken off goes on, and nobody guesses a name.
std::string SecretIn(const fs::path& clips) {
  std::string secret = fs::exists(clips / kSecret) ? ReadFile(clips / kSecret) : "";
  if (IsSecret(secret)) return secret;
  secret = NewSecret();
  WriteFileAtomically(clips / kSecret, secret);
  return secret;
}

/// Of whose clip it is and of all that decides how it is encoded.
std::string NameOf(const Candidate& candidate, const StudyInfo& info, const ClipRoundTrip& round_trip,
                   const std::string& evac_version, const std::string& secret) {
  const StudyClip& clip = candidate.clip;
  std::string text = fmt::format("{}\n{}\n{}\n{}\n{}\n{}\n{}x{} {:a} {:a}\n", secret, clip.run, clip.episode,
                                 clip.source_sha256, round_trip.codec_sha256, evac_version, info.width_px,
                                 info.height_px, info.period_s, candidate.task.period_s);
  text += ViewsJson(candidate.layout, info.width_px, info.height_px);
  for (const Camera& camera : candidate.task.cameras) text += fmt::format("\n{}x{}", camera.width_px, camera.height_px);
  return Sha256Hex(text).substr(0, secret.size());
}

/// A clip before it is padded: there if it was encoded, until its wave is in the study.
fs::path BareOf(const fs::path& clip) { return fs::path(clip).replace_extension(".bare.mp4"); }

/// @returns the number of frames
int EncodeOnce(const Candidate& candidate, const ClipFormat& format, const ClipRoundTrip& round_trip,
               const fs::path& bare) {
  const int there = fs::exists(bare) ? VideoReader(bare).frames() : 0;
  return there > 0 ? there : EncodeClip(candidate.video, candidate.task, candidate.layout, format, round_trip, bare);
}

Encoded EncodeAll(std::vector<Candidate>& candidates, const StudyInfo& info, const StudyOptions& options,
                  const fs::path& folder, const std::function<void(std::size_t, std::size_t)>& progress) {
  MakeFolders(folder / "clips");
  const std::string secret = SecretIn(folder / "clips");
  Encoded encoded;
  const ClipFormat format{info.width_px, info.height_px, info.period_s};
  for (Candidate& candidate : candidates) {
    const ClipRoundTrip round_trip = candidate.is_imagined ? ClipRoundTrip{} : options.round_trip;
    StudyClip clip = candidate.clip;
    clip.file = "clips/" + NameOf(candidate, info, round_trip, options.evac_version, secret) + ".mp4";
    clip.views = ViewsJson(candidate.layout, info.width_px, info.height_px);
    const fs::path bare = BareOf(folder / clip.file);
    clip.frames = EncodeOnce(candidate, format, round_trip, bare);
    encoded.longest = std::max(encoded.longest, fs::file_size(bare));
    encoded.clips.push_back(std::move(clip));
    progress(encoded.clips.size(), candidates.size());
  }
  return encoded;
}

/// Of "out/robots/" too.
std::string LastNameIn(const fs::path& folder) {
  const fs::path whole = fs::absolute(folder).lexically_normal();
  return (whole.has_filename() ? whole : whole.parent_path()).filename().string();
}

StudyInfo InfoFor(const std::vector<Candidate>& candidates, const StudyOptions& options, const fs::path& folder) {
  StudyInfo info;
  info.name = options.name.empty() ? LastNameIn(folder) : options.name;
  if (info.name.empty()) info.name = "study";
  info.seed = options.seed;
  info.raters_per_clip = options.raters_per_clip;
  info.evac_version = options.evac_version;
  info.period_s = 1;
  for (const Candidate& candidate : candidates) {
    const ClipLayout layout = LayoutOf(candidate.task.cameras, options.height_px.value_or(kStudyHeight_px));
    info.width_px = std::max(info.width_px, layout.width_px);
    info.height_px = std::max(info.height_px, layout.height_px);
    info.period_s = std::min(info.period_s, candidate.task.period_s);
  }
  return info;
}

/// A smaller clip would be known for one that came later. Sides are even: 65 px are shown as 66.
void CheckSameHeight(const StudyInfo& began, const StudyOptions& options, const fs::path& folder) {
  if (!options.height_px || *options.height_px + *options.height_px % 2 == began.height_px) return;
  throw InvalidInput("--height: found {}, but {} was begun with {}, and a wave cannot change that", *options.height_px,
                     folder.string(), began.height_px);
}

/// A study without a wave, of a call that was killed after it began the file, has clips of no codec yet.
void CheckSameRoundTrip(const StudyStore& store, const ClipRoundTrip& round_trip, const fs::path& folder) {
  const auto named = [](const std::string& codec) {
    return codec.empty() ? std::string("through none") : fmt::format("through the codec {:.12}…", codec);
  };
  if (store.Waves() == 0 || store.Codec() == round_trip.codec_sha256) return;
  throw InvalidInput("{}: its clips went {}, those of a new wave must go the same way; found {} (--vae-roundtrip)",
                     folder.string(), named(store.Codec()), named(round_trip.codec_sha256));
}

/// @throws InvalidInput for an episode that is another by now: votes on the clip would be taken for votes on it
void LeaveOutWhatIsThere(std::vector<Candidate>& candidates, const StudyStore& store) {
  std::map<std::string, std::string> there, forms;  // of runs as earlier versions wrote them
  for (const StudyClip& clip : store.Clips()) {
    const auto [form, is_new] = forms.try_emplace(clip.run);
    if (is_new) form->second = OneFormOf(clip.run).string();
    there[form->second + "\n" + clip.episode] = clip.source_sha256;
  }
  std::erase_if(candidates, [&](const Candidate& c) {
    const auto known = there.find(c.clip.run + "\n" + c.clip.episode);
    if (known == there.end() || known->second == c.clip.source_sha256) return known != there.end();
    throw InvalidInput("{}: the video of episode {} is another than the study {} has its clip of: SHA-256 {}, there "
                       "{}; wanted the run as it was, or another study",
                       c.clip.run, c.clip.episode, store.folder().string(), c.clip.source_sha256, known->second);
  });
}

/// Clips that no row names, of calls that were broken off or not yet padded, and what their names followed from.
void RemoveWhatNoRowNames(const StudyStore& store) {
  std::set<std::string> named;
  for (const StudyClip& clip : store.Clips()) named.insert(fs::path(clip.file).filename().string());
  const fs::path clips = store.folder() / "clips";
  std::vector<fs::path> left;
  if (!fs::is_directory(clips)) return;
  for (const fs::directory_entry& entry : fs::directory_iterator(clips)) {
    const std::string name = entry.path().filename().string();
    const bool is_clip = IsSecret(name.substr(0, name.find('.'))) && name.find(".mp4") != std::string::npos;
    if (name == kSecret || (is_clip && !named.contains(name))) left.push_back(entry.path());
  }
  std::error_code next_time;
  for (const fs::path& file : left) fs::remove(file, next_time);
}

/// Bytes of the longest clip that is there.
std::uintmax_t LongestIn(const StudyStore& store) {
  std::uintmax_t longest = 0;
  for (const StudyClip& clip : store.Clips()) {
    std::error_code gone;  // it is said where somebody should see it
    const std::uintmax_t bytes = fs::file_size(store.folder() / clip.file, gone);
    if (!gone) longest = std::max(longest, bytes);
  }
  return longest;
}

/// How long all clips of a wave are made: browsers are told, so as long as those that are there if they can be.
/// @param there  bytes of these, 0 of a new study
std::uintmax_t LengthOf(const Encoded& encoded, std::uintmax_t there, StudyMade& made) {
  constexpr std::uintmax_t kRound = 1 << 16;  // room for a later wave
  const std::uintmax_t needed = (encoded.longest + 8 + kRound - 1) / kRound * kRound;
  if (there > 0 && needed > there)
    made.warnings.push_back(fmt::format("the clips of this wave are {} bytes long, those before {}: who looks at what "
                                        "the browser is sent can tell them apart",
                                        needed, there));
  return std::max(needed, there);
}

std::vector<StudyRubric> RubricsOf(const std::vector<Candidate>& candidates) {
  std::map<std::string, StudyRubric> by_hash;
  for (const Candidate& candidate : candidates) by_hash[candidate.clip.rubric_hash] = RubricOf(candidate.task);
  std::vector<StudyRubric> rubrics;
  for (const auto& [hash, rubric] : by_hash) rubrics.push_back(rubric);
  return rubrics;
}

}  // namespace

StudyRubric RubricOf(const Task& task) {
  nlohmann::ordered_json stages = nlohmann::ordered_json::array();
  for (const Stage& stage : task.rubric.stages)
    stages.push_back({{"name", stage.name}, {"description", stage.description}});
  const nlohmann::ordered_json document = {{"instruction", task.instruction},
                                           {"success", task.rubric.success},
                                           {"version", task.rubric.version},
                                           {"stages", stages}};
  const std::string text = document.dump();
  return {Sha256Hex(task.id + "\n" + text), task.id, text};
}

StudyMade MakeStudy(const fs::path& folder, const StudyOptions& options,
                    const std::function<void(std::size_t, std::size_t)>& progress) {
  Check(options);
  Collector collector(options);
  for (const fs::path& run : RunsOf(options)) collector.Read(run);
  std::vector<Candidate>& candidates = collector.candidates;
  if (candidates.empty()) throw InvalidInput("{}: no episode with a video to rate", options.runs.front().string());
  DemandRubrics(candidates);
  DemandFewStages(candidates);

  MakeFolders(folder);
  const RunLock lock(folder / "new.lock");  // the server's is another: waves may come while people rate
  const bool is_new = !StudyStore::IsIn(folder);
  std::optional<StudyStore> store;
  if (!is_new) store = StudyStore::Open(folder, StudyStore::Mode::kReadWrite);
  LeaveOutWhatIsNotDrawn(candidates, StatesIn(store), options);
  if (!options.gold_from.empty()) ChooseKnown(candidates, options);
  if (!is_new) {
    CheckSameHeight(store->info(), options, folder);
    LeaveOutWhatIsThere(candidates, *store);
    if (candidates.empty()) {
      RemoveWhatNoRowNames(*store);
      throw InvalidInput("{}: every clip of these runs is in it already", folder.string());
    }
    CheckSameRoundTrip(*store, options.round_trip, folder);
  }
  const StudyInfo info = is_new ? InfoFor(candidates, options, folder) : store->info();
  LayOut(candidates, info, folder);
  Encoded encoded = EncodeAll(candidates, info, options, folder, progress);
  StudyMade made;
  const std::uintmax_t bytes = LengthOf(encoded, is_new ? 0 : LongestIn(*store), made);
  for (StudyClip& clip : encoded.clips) {
    PadClip(BareOf(folder / clip.file), bytes, folder / clip.file);
    clip.video_sha256 = Sha256HexOfFile(folder / clip.file);
    ++(clip.use == Showing::kGold       ? made.gold
       : clip.use == Showing::kPractice ? made.practice
       : clip.use == Showing::kExample  ? made.examples
                                        : made.clips);
  }
  if (is_new) store = StudyStore::Create(folder, info);
  made.list_hash = store->AddWave(encoded.clips, RubricsOf(candidates), options.round_trip.codec_sha256);
  RemoveWhatNoRowNames(*store);
  made.left_out = collector.left_out;
  return made;
}

}  // namespace evac
