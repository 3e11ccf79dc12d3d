#pragma once

#include <string>
#include <vector>

#include "core/store.h"
#include "reports/summary.h"
#include "tests/support/temp_folder.h"

namespace evac {

/// What became of one episode of a sample run, in one letter: s success, f failure, ? cannot tell, i invalid, e error,
/// u never judged, - no such episode.
using Outcomes = std::string;

/// One (task, policy): its outcomes in the initial states 0, 1, …, in both worlds.
struct SampleCell {
  std::string task, policy, checkpoint;
  Outcomes real, sim;
};

/// A store as `evac run` and `evac judge` leave it: two worlds, real and sim, videos and thumbnails on disk.
class SampleRun {
 public:
  explicit SampleRun(const std::vector<SampleCell>& cells);

  const std::filesystem::path& folder() const { return folder_.path(); }
  Store& store() { return store_; }
  const Store& store() const { return store_; }
  RunSummary Summary(const SummaryOptions& options = {}) const { return Summarise(ReadRun(store_), options); }

 private:
  void Declare(const std::vector<SampleCell>& cells);
  void AddEpisode(const EpisodeKey& key, char outcome);

  TempFolder folder_;
  Store store_;
};

/// Four policies, two tasks, ten states; the sim world agrees but for a few flips.
std::vector<SampleCell> FourPoliciesTwoTasks();
/// That run, made once for the tests that only read it.
const SampleRun& LargeRun();

}  // namespace evac
