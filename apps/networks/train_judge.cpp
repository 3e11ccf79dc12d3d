#include "apps/networks/train_judge.h"

#include <fmt/format.h>

#include <algorithm>
#include <optional>

#include "apps/networks/judge_quality.h"
#include "apps/networks/learners.h"

namespace evac {
namespace {

constexpr double kLeastKappa = 0.6;  // as of any judge that is calibrated (docs/vlm_judge.md)

/// What is written at the end, beside the weights.
struct Judged {
  ClassifierCard card;
  MeasuredJudge whole, first_view;
  std::optional<MeasuredJudge> masked;         ///< where it is known where the objects are
  std::optional<MeasuredJudge> reconstructed;  ///< where there is a codec
};

/// Where there is a codec the clips count twice, plain and as it gives them back: what is judged is both, recorded and
/// imagined.
ClassifierCard CardOf(const ClassifierNet& net, const JudgeClipSource& learn, JudgeClips calibration, double unsure) {
  std::vector<double> logits = Logits(net, learn, calibration, {});
  if (!learn.Codec().empty()) {
    const std::vector<double> given_back = Logits(net, learn, calibration, {.reconstructed = true});
    logits.insert(logits.end(), given_back.begin(), given_back.end());
    const JudgeClips again = calibration;
    calibration.insert(calibration.end(), again.begin(), again.end());
  }
  return Calibrate(logits, calibration, unsure);
}

Judged MeasureAll(const ClassifierNet& net, const JudgeData& data, const JudgeClips& calibration, double unsure) {
  Judged judged;
  judged.card = CardOf(net, data.learn, calibration, unsure);
  const auto measure = [&](const JudgeLook& look) {
    return Measure(Logits(net, data.holdout, data.holdout.clips, look), data.holdout.clips, judged.card);
  };
  judged.whole = measure({});
  judged.first_view = measure({.first_view_only = true});
  if (data.holdout.KnowsObjects()) judged.masked = measure({.masks_object = true});
  if (!data.holdout.Codec().empty()) judged.reconstructed = measure({.reconstructed = true});
  return judged;
}

void Say(const train::JobPlace& place, const ClassifierNet& net, const JudgeData& data, const Judged& judged) {
  if (!place.say) return;
  place.say("hold-out: " + judged.whole.Line());
  place.say("  first view alone: " + judged.first_view.Line());
  if (judged.masked) place.say("  object masked: " + judged.masked->Line());
  if (judged.reconstructed) place.say("  as the codec gives the pictures back: " + judged.reconstructed->Line());
  const std::vector<double> logits = Logits(net, data.holdout, data.holdout.clips, {});
  place.say("  failures taken for successes: " + MistakesByFate(logits, data.holdout.clips, judged.card));
  if (!(judged.whole.kappa >= kLeastKappa)) {
    place.say(
        fmt::format("warning: it learned too little for its verdicts to be counted: kappa {:.2f}, wanted at least "
                    "{}. More labels of each kind per task, or more steps",
                    judged.whole.kappa, kLeastKappa));
  }
}

/// Marks of the clips that were learned from or calibrated with.
std::string MarksOf(const JudgeClipSource& learn) {
  std::vector<std::string> marks;
  for (const PackedClip& clip : learn.clips) {
    if (!learn.Mark(clip).empty()) marks.push_back(learn.Mark(clip));
  }
  std::ranges::sort(marks);
  marks.erase(std::ranges::unique(marks).begin(), marks.end());
  return Joined(marks);
}

TensorMetadata CardText(const Judged& judged, const JudgeClipSource& learn, const JudgeTrainingOptions& options,
                        std::int64_t steps) {
  const auto number = [](double value) { return fmt::format("{:.6g}", value); };
  TensorMetadata card = {{"format", "evac-classifier 1"},
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
                         {"steps", std::to_string(steps)},
                         {"holdout_clips", std::to_string(judged.whole.clips)},
                         {"auroc", number(judged.whole.auroc)},
                         {"kappa", number(judged.whole.kappa)},
                         {"ece", number(judged.whole.ece)},
                         {"kappa_first_view", number(judged.first_view.kappa)},
                         {"licence", "as the project"}};
  if (judged.masked) card["kappa_masked"] = number(judged.masked->kappa);
  if (const std::string marks = MarksOf(learn); !marks.empty()) card["learned_from"] = marks;
  if (judged.reconstructed) {
    card["codec"] = learn.Codec();
    card["kappa_reconstructed"] = number(judged.reconstructed->kappa);
  }
  return card;
}

}  // namespace

train::TrainerSummary TrainJudge(const train::JobPlace& place, const JudgeTrainingOptions& given,
                                 const JudgeData& data) {
  JudgeTrainingOptions options = given;
  const JudgeSplit split = SplitForJudge(data.learn.clips, options);
  const ClassifierShape shape{data.learn.tasks, data.learn.cameras, data.learn.height_px, data.learn.width_px};
  const Learners<ClassifierNet> learners(shape, options.job.trainer.seed, Workers(place, options.job));
  const ClassifierNet& net = learners.net();
  const JudgeTraining training(data.learn, split.fit, options);
  options.job.trainer.identity = IdentityOf(SettingsOf(options)) + data.learn.recipe + data.learn.Codec() +
                                 " workers " + std::to_string(learners.count());
  train::Trainer trainer(learners.weights().all(), options.job.trainer, place.out);
  const auto loss = [&](const ClassifierNet& of, const train::StepPlace& at) { return training.Loss(of, at); };
  learners.Replicate(trainer, loss);
  const auto holdout = [&] { return LogLoss(Logits(net, data.learn, split.calibration, {}), split.calibration); };
  const train::TrainerSummary summary = trainer.Run({.loss = [&](const train::StepPlace& at) { return loss(net, at); },
                                                     .holdout = holdout,
                                                     .interrupted = place.interrupted,
                                                     .on_progress = place.on_progress});
  if (!summary.IsDone()) return summary;
  trainer.WithBest([&] {
    const Judged judged = MeasureAll(net, data, split.calibration, options.unsure);
    Say(place, net, data, judged);
    learners.Write(place.out / "judge.safetensors", CardText(judged, data.learn, options, summary.step));
  });
  return summary;
}

}  // namespace evac
