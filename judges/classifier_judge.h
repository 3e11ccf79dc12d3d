#pragma once

#include <filesystem>
#include <memory>
#include <set>
#include <span>
#include <string>
#include <vector>

#include "core/judge.h"

namespace evac {

/// What a classifier's card says of its answers.
struct ClassifierCard {
  double temperature = 1;  ///< the network's logit, less the offset, is divided by it: then its probabilities can be believed
  double threshold = 0.5;  ///< success from here on
  double unsure = 0;       ///< closer than this to the threshold: cannot tell
  int longest_frames = 0;  ///< no clip that it learned from was longer; 0: unknown
  double offset = 0;       ///< of the logit: where `evac judge balance` found that imagined clips are even
};

/// Success, failure or cannot tell, by the card.
Label LabelOf(double probability, const ClassifierCard& card);

/// Judges an episode by eight pictures of its stored clip and nothing else: no physics, no arms, no commands. Its
/// weights carry a card (docs/classifier_judge.md) with the tasks and views it knows, its temperature and its
/// threshold.
///
/// Verdicts: `success`, `failure`, or `cannot_tell` near the threshold, with the probability. A clip that is missing or
/// cannot be read, one longer than any it learned from, a task or camera it does not know, a clip that it learned from,
/// and an answer that is not finite throw: JudgeEpisodes makes them `invalid`, never a failure.
class ClassifierJudge : public Judge {
 public:
  /// @param weights  of `evac train judge`
  /// @param run      the folder that episodes' videos are relative to
  /// @throws InvalidInput naming the file and what about it is wrong.
  ClassifierJudge(const std::filesystem::path& weights, std::filesystem::path run);
  ~ClassifierJudge() override;

  /// "classifier:" and the first 12 digits of the weights' SHA-256.
  std::string Name() const override;
  Verdict Rate(const Task& task, const Episode& episode) override;

  /// @throws InvalidInput if a task is none it learned, lacks the first camera it knows, or has one it does not know.
  void CheckKnows(std::span<const Task> tasks) const;

  const ClassifierCard& card() const { return card_; }

 private:
  struct Network;
  double Probability(const Task& task, const std::filesystem::path& video) const;

  std::filesystem::path run_;
  std::string name_;
  ClassifierCard card_;
  std::set<std::string> learned_from_;  ///< first digits of clips' SHA-256
  std::unique_ptr<const Network> network_;
};

}  // namespace evac
