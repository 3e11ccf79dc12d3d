#pragma once

#include <filesystem>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "core/judge.h"
#include "core/store.h"
#include "reports/fidelity.h"

namespace evac {

/// The judge of imagined clips: the classifier, or nobody.
class FidelityJudge {
 public:
  /// @param classifier  its weights; empty: nobody
  explicit FidelityJudge(std::string classifier) : classifier_(std::move(classifier)) {}

  /// @throws InvalidInput if the weights are none, or do not know the tasks and their cameras.
  void RequireKnows(const std::vector<Task>& tasks) const;
  /// Rates what it has not rated yet.
  void Rate(Store& store);
  /// Empty before it rated anything.
  const std::string& name() const { return name_; }

  /// Against the oracle on the clips of a world; and once more with the object painted over, of which the verdicts are
  /// stored too ("NAME:masked"), so that no clip is painted twice.
  /// @param scratch  a folder for painted clips; they go again, and what else is in it stays
  JudgeQualityOnReal QualityOn(Store& store, const std::string& world, const std::filesystem::path& scratch);

 private:
  std::string classifier_, name_;
};

/// What a store says of its episodes.
class OutcomesOf {
 public:
  OutcomesOf(const Store& store, std::string judge);

  /// By the oracle. @returns nothing where the episode failed, is not there, or the oracle could not tell
  std::optional<bool> Truth(const EpisodeKey& key) const { return By("oracle", key); }
  /// By the judge of imagined clips.
  std::optional<bool> Said(const EpisodeKey& key) const { return By(judge_, key); }
  /// Relative to the folder above the store's; empty: none.
  std::string Clip(const EpisodeKey& key) const;

 private:
  std::optional<bool> By(const std::string& judge, const EpisodeKey& key) const;

  std::string judge_, folder_;
  std::map<std::string, std::string> clips_;
  std::map<std::string, std::map<std::string, Verdict>> verdicts_;
};

}  // namespace evac
