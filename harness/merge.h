#pragma once

#include <filesystem>
#include <functional>
#include <string>
#include <vector>

#include "core/store.h"

namespace evac {

struct MergeSummary {
  int episodes = 0;    ///< in the merged run
  int duplicates = 0;  ///< copies that did not fail beside the one that was taken, and the same as it
  /// A sentence each: several versions of evac, calls and logs that stay behind, episodes of the suite that no shard
  /// has.
  std::vector<std::string> notes = {};
};

/// Joins runs of one suite, such as the shards of `evac run --shard`, into a new one with what they hold:
/// episodes, videos (copied and checked against their hashes), initial scenes, verdicts, trials on a real robot,
/// counters, and what the suite asks for. Sequential looks and gates' decisions stay behind: they were looks at a part,
/// and are none at the whole. So does what model servers were asked and answered (CallCache): a judge of the merged run
/// asks again; and what policies printed (logs/), which shards have under the same names. A folder that is given twice is
/// one shard; of shards that overlap otherwise the counters are added all the same. The run's evac_version is that
/// of all shards, or each of theirs once, with commas between.
///
/// An episode that several shards hold must be the same in all, to the bytes of its video; a failed one yields to one
/// that did not fail, with what was said of it. Verdicts on every other copy are kept, those of a later shard after those
/// of an earlier, and what two say alike once. `out` is there whole or not at all; it is made in `out`.tmp, its parents
/// first where they are missing.
/// @throws InvalidInput if `out` exists or another merge makes it just now, a shard lies in `out`.tmp or that is no
/// merge's that was broken off, a shard is of another suite, or duplicates disagree (all are named).
MergeSummary MergeRuns(const std::vector<std::filesystem::path>& shards, const std::filesystem::path& out);

/// Copies from one run into another the episodes that `wanted` names, that did not fail, and that are not there yet:
/// their videos (checked against their hashes), verdicts, initial scenes. The caller knows that they would come out the
/// same, and has declared tasks, worlds and policies.
/// @returns how many. @throws InvalidInput if a video is not the one that was stored.
int TakeEpisodes(const Store& from, const std::function<bool(const EpisodeKey&)>& wanted, Store& to);

}  // namespace evac
