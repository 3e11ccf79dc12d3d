#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "core/collection.h"
#include "core/policy.h"
#include "core/types.h"

namespace evac {

inline constexpr int kMostEpisodes = 10'000'000;  ///< of a collection

/// One way of acting and how often it is seen: an entry of a recipe's `mix`.
struct Behaviour {
  std::string name;
  double share = 0;    ///< of all episodes, relative to the other entries' shares
  std::string policy;  ///< visual_pick, explorer, learned
  std::string does;    ///< explorer's: push, wrong_object, roam, random
  std::filesystem::path checkpoint;  ///< learned's weights
  std::string checkpoint_sha256;     ///< of that file, when the recipe was read
  bool without_object = false;  ///< the task's object is taken away
  bool unaware = false;  ///< and the policy does what it does where it is there: its hand closes where the thing would be
  std::vector<std::pair<std::string, std::pair<double, double>>> parameters;  ///< uniform in [low, high], file's order
};

struct CollectTask {
  Task task, without;         ///< as its page says; and with the object taken away
  std::string object;         ///< the body that the task is about
  Eigen::Vector3d middle_m;   ///< of the object, in its own frame
};

/// What `evac collect` makes: one YAML page (docs/collect.md).
struct Recipe {
  std::string name;
  std::filesystem::path profile;
  std::vector<CollectTask> tasks;
  std::vector<Behaviour> mix;
  int episodes = 0;
  int episodes_per_state = 1;  ///< that begin alike and go on differently
  int chunk_size = 8;
  int max_chunks = 10;
  RecordingVideo video;
  std::string text;  ///< the effective recipe
  std::string hash;  ///< of everything that decides a byte: the recipe and every page, scene and profile it names
};

/// What is wrong is known before the first episode: the profile and the tasks' scenes are read too, each policy of the
/// mix knows every task, and takes both ends of its ranges and what is drawn between them.
/// @throws InvalidInput naming file, line, field, what was found and what was wanted.
Recipe ReadRecipe(const std::filesystem::path& path, const std::vector<std::string>& assignments);

/// The index-th episode of a collection, before it happens. The first n episodes do not depend on how many follow.
struct CollectJob {
  const CollectTask* task = nullptr;
  const Behaviour* behaviour = nullptr;
  CollectedEpisode row;  ///< all that is known beforehand
};
/// Initial states come from a stream of their own ("collected state"), never from that of a suite ("initial state").
CollectJob JobAt(const Recipe& recipe, std::uint64_t seed, std::int64_t index);

/// The policy of a job, with its parameters. @throws InvalidInput naming one that is out of its range, or a checkpoint
/// that is none of a learned policy's, or another file than when the recipe was read.
std::unique_ptr<Policy> MakePolicy(const CollectJob& job, int chunk_size);

}  // namespace evac
