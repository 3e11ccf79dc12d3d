#include "apps/networks/judge_run_clips.h"

#include <fmt/ranges.h>

#include <algorithm>
#include <array>
#include <cstring>
#include <limits>
#include <map>
#include <set>
#include <utility>

#include "core/hash.h"
#include "core/seed.h"
#include "core/store.h"
#include "judges/classifier_clip.h"
#include "judges/judge_card.h"

namespace evac {
namespace {

constexpr int kPictures = 24;  // of a clip: three times what the network sees, so that learning may jitter

class RunClips final : public JudgeClipSource {
 public:
  std::vector<at::Tensor> pictures;  ///< of each clip, [kPictures, V, H, W, 3] bytes
  std::vector<std::string> marks;

  at::Tensor Pictures(const PackedClip& clip, const std::vector<std::int64_t>& rows) const override {
    return pictures[clip.shard].index_select(0, at::tensor(at::ArrayRef<std::int64_t>(rows))).transpose(0, 1);
  }
  at::Tensor Objects(const PackedClip&, const std::vector<std::int64_t>& rows) const override {
    return at::full({static_cast<std::int64_t>(cameras.size()), static_cast<std::int64_t>(rows.size()), 2},
                    std::numeric_limits<float>::quiet_NaN());
  }
  bool KnowsLengths() const override { return false; }
  bool KnowsObjects() const override { return false; }
  std::string Mark(const PackedClip& clip) const override { return marks[clip.shard]; }
};

/// An episode with a label, before its video is read.
struct Labelled {
  const Task* task;
  std::filesystem::path video;
  std::string mark, episode, state;
  bool success;
};

std::vector<std::string> CameraNames(const Task& task) {
  std::vector<std::string> names;
  for (const Camera& camera : task.cameras) names.push_back(camera.name);
  return names;
}

/// Tasks by run and name: a run's clips are as large as its own cameras made them. All must be seen by cameras of the
/// same names.
class Tasks {
 public:
  explicit Tasks(const std::function<void(const std::string&)>& say) : say_(say) {}
  const Task* Add(const Task& task, const std::filesystem::path& run) {
    const std::vector<std::string> names = CameraNames(task);
    if (cameras_.empty()) cameras_ = names;
    if (names != cameras_)
      throw InvalidInput("{}: task {} is seen by {}, wanted {} as the tasks before it", run.string(), task.id,
                         fmt::join(names, ", "), fmt::join(cameras_, ", "));
    SayIfAnother(task, run);
    return &tasks_.try_emplace({run, task.id}, task).first->second;
  }
  const std::vector<std::string>& cameras() const { return cameras_; }

 private:
  /// Tasks of one name are learned as one. Two that a folder's name made one are told otherwise.
  void SayIfAnother(const Task& task, const std::filesystem::path& run) {
    const auto& [first, told] = told_.try_emplace(task.id, run, task.instruction).first->second;
    if (task.instruction == told) return;
    say_(fmt::format("warning: task {} is '{}' in {} and '{}' in {}: both are learned as one task; two tasks want two "
                     "names (`task` in a suite with a recording)",
                     task.id, told, first.string(), task.instruction, run.string()));
  }

  const std::function<void(const std::string&)>& say_;
  std::map<std::string, std::pair<std::filesystem::path, std::string>> told_;  ///< by task: the first run, and what there
  std::map<std::pair<std::filesystem::path, std::string>, Task> tasks_;
  std::vector<std::string> cameras_;
};

void AddRun(const std::filesystem::path& run, const LabelledRuns& options, Tasks& tasks,
            std::vector<Labelled>& labelled, std::set<std::string>& worlds) {
  const Store store = Store::Open(run, Store::Mode::kReadOnly);
  for (const WorldInfo& world : store.Worlds()) worlds.insert(world.name);
  std::map<std::string, const Task*> known;
  for (const Task& task : store.Tasks()) known[task.id] = tasks.Add(task, run);
  const auto verdicts = store.CurrentVerdicts();
  for (const Episode& episode : store.Episodes()) {
    const EpisodeKey& key = episode.key;
    const bool wanted = options.worlds.empty() || std::ranges::count(options.worlds, key.world) > 0;
    if (!wanted || IsFailure(episode.stop) || episode.video.empty()) continue;
    const auto all = verdicts.find(key.Id());
    if (all == verdicts.end()) continue;
    const auto own = all->second.find(options.truth);
    if (own == all->second.end()) continue;
    const Label label = own->second.label;
    if (label != Label::kSuccess && label != Label::kFailure) continue;
    labelled.push_back({known.at(key.pair.task), store.folder() / episode.video,
                        ClipMark(episode.video_sha256), (run / key.Id()).string(),
                        key.pair.task + "/" + key.pair.initial_state, label == Label::kSuccess});
  }
}

/// [kPictures, V, H, W, 3]
at::Tensor ReadPictures(const Labelled& one, const LabelledRuns& options) {
  const auto seen = ReadClip(one.video, {one.task->cameras, kPictures, {options.width_px, options.height_px}});
  at::Tensor bytes = at::empty({kPictures, static_cast<std::int64_t>(seen.size()), options.height_px, options.width_px, 3},
                               at::kByte);
  const auto size = static_cast<std::size_t>(options.height_px * options.width_px * 3);
  auto* to = bytes.data_ptr<std::uint8_t>();
  for (std::size_t t = 0; t < kPictures; ++t) {
    for (const auto& view : seen) {
      std::memcpy(to, view[t].data, size);
      to += size;
    }
  }
  return bytes;
}

void Add(const Labelled& one, at::Tensor pictures, RunClips& clips) {
  const auto task = std::ranges::find(clips.tasks, one.task->id);
  PackedClip clip;
  clip.shard = clips.pictures.size();
  clip.frames = kPictures;
  clip.task = static_cast<std::int32_t>(task - clips.tasks.begin());
  clip.outcome = one.success ? 1 : 0;
  clip.episode = one.episode;
  clip.state = one.state;
  clips.clips.push_back(std::move(clip));
  clips.pictures.push_back(std::move(pictures));
  clips.marks.push_back(one.mark);
}

void CheckEnough(const RunClips& learn, const LabelledRuns& options) {
  for (std::size_t task = 0; task < learn.tasks.size(); ++task) {
    std::array<std::int64_t, 2> counts{};
    for (const PackedClip& clip : learn.clips) {
      if (clip.task == static_cast<std::int32_t>(task)) ++counts[static_cast<std::size_t>(clip.outcome)];
    }
    if (std::ranges::min(counts) < options.least)
      throw InvalidInput(
          "task {}: {} successes and {} failures by {} to learn from (a share of {} of the initial states is kept to "
          "measure with), wanted at least {} of each: more labels, or fewer wanted (--least)",
          learn.tasks[task], counts[1], counts[0], options.truth, options.holdout, options.least);
  }
}

/// Of one kind alone nothing can be measured: no AUROC, no kappa.
void CheckHoldout(const RunClips& holdout, const std::vector<Labelled>& labelled, const LabelledRuns& options) {
  const auto successes = std::ranges::count_if(holdout.clips, [](const PackedClip& clip) { return clip.outcome == 1; });
  const auto failures = std::ssize(holdout.clips) - successes;
  if (successes > 0 && failures > 0) return;
  std::set<std::string> states, kept;
  for (const Labelled& one : labelled) states.insert(one.state);
  for (const PackedClip& clip : holdout.clips) kept.insert(clip.state);
  throw InvalidInput("{} successes and {} failures in {} of {} initial states with a label are kept to measure with, "
                     "wanted some of both: more labelled states, a larger share of them (--holdout, found {}), or "
                     "another seed",
                     successes, failures, kept.size(), states.size(), options.holdout);
}

void CheckWorlds(const std::vector<std::string>& wanted, const std::set<std::string>& there) {
  for (const std::string& world : wanted) {
    if (there.contains(world)) continue;
    throw InvalidInput("--worlds: no clip is of world '{}', wanted some of: {}", world, fmt::join(there, ", "));
  }
}

}  // namespace

LabelledClips ReadLabelledClips(const LabelledRuns& options, const std::function<void(const std::string&)>& say) {
  Tasks tasks(say);
  std::vector<Labelled> labelled;
  std::set<std::string> worlds;
  for (const std::filesystem::path& run : options.runs) AddRun(run, options, tasks, labelled, worlds);
  CheckWorlds(options.worlds, worlds);
  if (labelled.empty())
    throw InvalidInput("no clip has a success or failure by '{}': wanted one who has judged these runs", options.truth);
  auto learn = std::make_unique<RunClips>(), holdout = std::make_unique<RunClips>();
  std::string marks;
  for (RunClips* part : {learn.get(), holdout.get()}) {
    part->cameras = tasks.cameras();
    part->height_px = options.height_px;
    part->width_px = options.width_px;
    for (const Labelled& one : labelled) {
      if (std::ranges::count(part->tasks, one.task->id) == 0) part->tasks.push_back(one.task->id);
    }
    std::ranges::sort(part->tasks);
  }
  const std::uint64_t seed = SeedFor(options.seed, "judge hold-out");
  for (const Labelled& one : labelled) try {
      const bool is_kept = SplitMix64(SeedFor(seed, one.state)).Uniform() < options.holdout;
      Add(one, ReadPictures(one, options), is_kept ? *holdout : *learn);
      marks += one.mark + (one.success ? "+" : "-");
    } catch (const Error& error) {
      say(fmt::format("left out: {}", error.what()));
    }
  CheckEnough(*learn, options);
  CheckHoldout(*holdout, labelled, options);
  learn->recipe = holdout->recipe =
      Sha256Hex(fmt::format("{} {} {}x{} {}", marks, options.truth, options.width_px, options.height_px, options.holdout));
  return {std::move(learn), std::move(holdout)};
}

}  // namespace evac
