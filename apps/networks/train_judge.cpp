#include "apps/networks/train_judge.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <optional>

#include "apps/networks/judge_quality.h"
#include "apps/networks/judge_tables.h"
#include "apps/networks/judge_widen.h"
#include "apps/networks/learners.h"
#include "apps/work_share.h"
#include "core/error.h"
#include "core/file.h"
#include "core/names.h"
#include "core/weight_file.h"
#include "judges/judge_card.h"

namespace evac {
namespace {

constexpr double kLeastKappa = 0.6;  // as of any judge that is calibrated (docs/vlm_judge.md)

/// What is written at the end, beside the weights.
struct Judged {
  ClassifierCard card;
  MeasuredJudge whole, first_view;
  std::optional<MeasuredJudge> masked;         ///< where it is known where the objects are
  std::optional<MeasuredJudge> reconstructed;  ///< where there is a codec
  std::optional<MeasuredJudge> longer;         ///< where it was trained for longer clips than it was shown
  std::vector<JudgedClips> clips;              ///< at their own length: of calibration and hold-out, in each way of seeing
};

/// The ways in which clips are seen by turns: plain and as the codec gives them back, where there is one; and both as
/// longer clips, where it is trained for them. What is judged is all of these, recorded and imagined.
std::vector<JudgeLook> LooksOf(const JudgeClipSource& learn, const JudgeTrainingOptions& options) {
  std::vector<JudgeLook> looks = {{}};
  if (!learn.Codec().empty()) looks.push_back({.reconstructed = true});
  if (options.longest > 1) {
    std::vector<JudgeLook> longer = looks;
    for (JudgeLook& look : longer) look.longer = MiddleLength(options);
    looks.insert(looks.end(), longer.begin(), longer.end());
  }
  return looks;
}

/// Shows clips to the network, and how far that is.
class Asking {
 public:
  Asking(const ClassifierNet& net, std::size_t clips) : net_(net), progress_("clips judged", static_cast<std::int64_t>(clips), 0) {}
  std::vector<double> operator()(const JudgeClipSource& source, const JudgeClips& clips, const JudgeLook& look) {
    return Logits(net_, source, clips, look, [this] { progress_.Count(); });
  }

 private:
  const ClassifierNet& net_;
  CountProgress progress_;
};

const char* SeenAs(const JudgeLook& look) { return look.reconstructed ? "given back" : "recorded"; }

Judged MeasureAll(const ClassifierNet& net, const JudgeData& data, const JudgeClips& calibration,
                  const JudgeTrainingOptions& options) {
  const JudgeClips& holdout = data.holdout.clips;
  const std::vector<JudgeLook> looks = LooksOf(data.learn, options);
  const bool masks = data.holdout.KnowsObjects(), has_codec = !data.holdout.Codec().empty(), longer = options.longest > 1;
  const std::size_t of_holdout = 2 + std::size_t{masks} + std::size_t{has_codec} + std::size_t{longer};
  Asking ask(net, calibration.size() * looks.size() + holdout.size() * of_holdout);
  Judged judged;
  std::vector<double> logits;
  JudgeClips clips;
  for (const JudgeLook& look : looks) {
    const std::vector<double> some = ask(data.learn, calibration, look);
    logits.insert(logits.end(), some.begin(), some.end());
    clips.insert(clips.end(), calibration.begin(), calibration.end());
    if (look.longer == 1) judged.clips.push_back({"calibration", SeenAs(look), &calibration, some});
  }
  judged.card = Calibrate(logits, clips, options.unsure);
  const auto measure = [&](const JudgeLook& look, bool is_shown) {
    const std::vector<double> some = ask(data.holdout, holdout, look);
    if (is_shown) judged.clips.push_back({"hold-out", SeenAs(look), &holdout, some});
    return Measure(some, holdout, judged.card);
  };
  judged.whole = measure({}, true);
  judged.first_view = measure({.first_view_only = true}, false);
  if (masks) judged.masked = measure({.masks_object = true}, false);
  if (has_codec) judged.reconstructed = measure({.reconstructed = true}, true);
  if (longer) judged.longer = measure({.longer = MiddleLength(options)}, false);
  return judged;
}

void Say(const train::JobPlace& place, const Judged& judged) {
  if (!place.say) return;
  place.say("hold-out: " + judged.whole.Line());
  place.say("  first view alone: " + judged.first_view.Line());
  if (judged.masked) place.say("  object masked: " + judged.masked->Line());
  if (judged.reconstructed) place.say("  as the codec gives the pictures back: " + judged.reconstructed->Line());
  if (judged.longer) place.say("  as longer clips: " + judged.longer->Line());
  for (const JudgedClips& some : judged.clips) {
    if (some.part != "hold-out") continue;
    place.say(fmt::format("  failures taken for successes, {}: {}", some.seen, MistakesByFate(some.logits, *some.clips, judged.card)));
  }
  if (!(judged.whole.kappa >= kLeastKappa)) {
    place.say(
        fmt::format("warning: it learned too little for its verdicts to be counted: kappa {:.2f}, wanted at least "
                    "{}. More labels of each kind per task, or more steps",
                    judged.whole.kappa, kLeastKappa));
  }
}

ClassifierShape ShapeOf(const JudgeClipSource& clips, const JudgeTrainingOptions& options) {
  return {clips.tasks, clips.cameras, clips.height_px, clips.width_px, options.looks};
}

/// What a judge to go on from must be, or it would be asked about other tasks than it knows.
void CheckInit(const JudgeData& data, const JudgeTrainingOptions& options) {
  if (data.init.empty()) return;
  const WeightFile file(data.init, kClassifierFormat);
  const auto check = [&](const char* key, const std::string& wanted) {
    if (file.Text(key) != wanted)
      throw InvalidInput("{}: {} is '{}', wanted '{}' as the clips have it", data.init.string(), key, file.Text(key), wanted);
  };
  check("tasks", Joined(data.learn.tasks));
  check("cameras", Joined(data.learn.cameras));
  check("height_px", std::to_string(data.learn.height_px));
  check("width_px", std::to_string(data.learn.width_px));
  if (LooksOnCard(file) > options.looks)
    throw InvalidInput("{}: it looks at {} places, wanted at most {} as the training page's judge.looks", data.init.string(), LooksOnCard(file), options.looks);
}

/// The judge to go on from, with as many looks as are wanted: itself, or one beside the weights that will be written.
std::filesystem::path BeginningOf(const train::JobPlace& place, const ClassifierShape& shape, const JudgeTrainingOptions& options,
                                  const std::filesystem::path& init) {
  if (init.empty() || LooksOnCard(WeightFile(init, kClassifierFormat)) == shape.looks) return init;
  MakeFolders(place.out);
  std::filesystem::path widened = place.out / "begin.safetensors";
  WidenJudge(init, shape, options.job.trainer.seed, widened);
  return widened;
}

/// Marks of the clips that were learned from or calibrated with, those of the judge it went on from among them.
std::string MarksOf(const JudgeClipSource& learn, const std::filesystem::path& init) {
  std::vector<std::string> marks;
  if (!init.empty()) {
    const TensorFile file = TensorFile::OpenCheckpoint(init);
    const auto before = file.metadata().find("learned_from");
    if (before != file.metadata().end()) marks = NamesIn(before->second);
  }
  for (const PackedClip& clip : learn.clips) {
    if (!learn.Mark(clip).empty()) marks.push_back(learn.Mark(clip));
  }
  std::ranges::sort(marks);
  marks.erase(std::ranges::unique(marks).begin(), marks.end());
  return Joined(marks);
}

/// What a judge's card says of how long clips may be; nothing: it says nothing.
std::optional<std::int64_t> LongestOn(const std::filesystem::path& judge) {
  const WeightFile file(judge, kClassifierFormat);
  if (!file.card().contains("longest_frames")) return std::nullopt;
  return file.Whole("longest_frames", 1, 1000000);
}

/// @param steps  TrainerSummary::CardOfSteps
TensorMetadata CardText(const Judged& judged, const JudgeData& data, const JudgeTrainingOptions& options,
                        const TensorMetadata& steps) {
  const JudgeClipSource& learn = data.learn;
  const auto number = [](double value) { return fmt::format("{:.6g}", value); };
  TensorMetadata card = {{"format", kClassifierFormat},
                         {"tasks", Joined(learn.tasks)},
                         {"cameras", Joined(learn.cameras)},
                         {"frames", std::to_string(kClassifierFrames)},
                         {"height_px", std::to_string(learn.height_px)},
                         {"width_px", std::to_string(learn.width_px)},
                         {"temperature", number(judged.card.temperature)},
                         {"threshold", number(judged.card.threshold)},
                         {"unsure", number(judged.card.unsure)},
                         {"recipe", learn.recipe},
                         {"seed", std::to_string(options.job.trainer.seed)},
                         {"holdout_clips", std::to_string(judged.whole.clips)},
                         {"auroc", number(judged.whole.auroc)},
                         {"kappa", number(judged.whole.kappa)},
                         {"ece", number(judged.whole.ece)},
                         {"kappa_first_view", number(judged.first_view.kappa)},
                         {"licence", "as the project"}};
  card.insert(steps.begin(), steps.end());
  if (options.looks > 1) card["looks"] = std::to_string(options.looks);
  if (judged.masked) card["kappa_masked"] = number(judged.masked->kappa);
  if (const std::string marks = MarksOf(learn, data.init); !marks.empty()) card["learned_from"] = marks;
  if (learn.KnowsLengths()) {
    std::int64_t most = 0;
    for (const PackedClip& clip : learn.clips) most = std::max(most, clip.frames);
    std::int64_t longest = std::llround(options.longest * static_cast<double>(most));
    if (!data.init.empty()) longest = std::max(longest, LongestOn(data.init).value_or(0));
    card["longest_frames"] = std::to_string(longest);
  }
  if (judged.longer) {
    card["longer"] = number(MiddleLength(options));
    card["kappa_longer"] = number(judged.longer->kappa);
  }
  if (judged.reconstructed) {
    card["codec"] = learn.Codec();
    card["kappa_reconstructed"] = number(judged.reconstructed->kappa);
  }
  return card;
}

/// Weights and card, and the tables of what they say.
void Write(const train::JobPlace& place, const Learners<ClassifierNet>& learners, const Judged& judged,
           const JudgeData& data, const TensorMetadata& card) {
  MakeFolders(place.out);
  WriteFileAtomically(place.out / "judged.csv", JudgedCsv(judged.clips, judged.card, data.learn.tasks));
  WriteFileAtomically(place.out / "thresholds.csv", ThresholdsCsv(judged.clips, judged.card));
  learners.Write(place.out / "judge.safetensors", card);
}

}  // namespace

void CalibrateJudge(const train::JobPlace& place, const JudgeTrainingOptions& given, const JudgeData& data) {
  CheckJudgeOptions(given);
  CheckSides(data.learn.height_px, data.learn.width_px);
  JudgeTrainingOptions options = given;
  options.looks = LooksOnCard(WeightFile(data.init, kClassifierFormat));  // the weights stay as they are
  CheckInit(data, options);
  RequireBothOutcomes(data.learn.clips, "calibrate with");
  const ClassifierShape shape = ShapeOf(data.learn, options);
  const Learners<ClassifierNet> learners(shape, options.job.trainer.seed, 1, BeginningOf(place, shape, options, data.init));
  JudgeClips once = data.learn.clips;
  std::erase_if(once, [](const PackedClip& clip) { return clip.is_again; });
  const Judged judged = MeasureAll(learners.net(), data, once, options);
  Say(place, judged);
  TensorMetadata card = CardText(judged, data, options, {{"steps", "0"}});
  card.erase("longest_frames");  // these clips taught the weights nothing
  if (const auto longest = LongestOn(data.init)) card["longest_frames"] = std::to_string(*longest);
  Write(place, learners, judged, data, card);
}

train::TrainerSummary TrainJudge(const train::JobPlace& place, const JudgeTrainingOptions& given,
                                 const JudgeData& data) {
  CheckJudgeOptions(given);
  train::CheckOptions(given.job.trainer);
  JudgeTrainingOptions options = given;
  CheckSides(data.learn.height_px, data.learn.width_px);
  CheckInit(data, options);
  const JudgeSplit split = SplitForJudge(data.learn.clips, options);
  const ClassifierShape shape = ShapeOf(data.learn, options);
  const Learners<ClassifierNet> learners(shape, options.job.trainer.seed, Workers(place, options.job),
                                          BeginningOf(place, shape, options, data.init));
  const ClassifierNet& net = learners.net();
  const JudgeTraining training(data.learn, split.fit, options);
  options.job.trainer.identity = IdentityOf(SettingsOf(options)) + data.learn.recipe + data.learn.LatentsIdentity() +
                                 " workers " + std::to_string(learners.count()) + place.begun_with;
  train::Trainer trainer(learners.weights().all(), options.job.trainer, place.out);
  const auto loss = [&](const ClassifierNet& of, const train::StepPlace& at) { return training.Loss(of, at); };
  learners.Replicate(trainer, loss);
  const std::vector<JudgeLook> looks = LooksOf(data.learn, options);
  const auto holdout = [&] {
    double sum = 0;
    for (const JudgeLook& look : looks)
      sum += LogLoss(Logits(net, data.learn, split.calibration, look), split.calibration);
    return sum / static_cast<double>(looks.size());
  };
  const train::TrainerSummary summary = trainer.Run({.loss = [&](const train::StepPlace& at) { return loss(net, at); },
                                                     .holdout = holdout,
                                                     .interrupted = place.interrupted,
                                                     .on_progress = place.on_progress});
  if (!summary.IsDone()) return summary;
  trainer.WithBest([&] {
    const Judged judged = MeasureAll(net, data, split.calibration, options);
    Say(place, judged);
    Write(place, learners, judged, data, CardText(judged, data, options, summary.CardOfSteps()));
  });
  return summary;
}

}  // namespace evac
