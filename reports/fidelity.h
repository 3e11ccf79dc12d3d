#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "core/statistics/estimate.h"
#include "core/types.h"
#include "reports/comparison.h"
#include "reports/outcome.h"

/// Is a world model true? What `evac fidelity` measured, counted (docs/fidelity.md): outcomes of the same initial states
/// in reality, in reality once more, and as imagined; and how pictures drift apart. Pure functions of what was measured;
/// `apps/fidelity_*` measures.
namespace evac {

/// One initial state under one policy, or under recorded actions. An outcome is empty where there is none: the episode
/// failed, its judge could not tell, or that world was not asked.
struct FidelityRow {
  std::string kind;  ///< closed_loop, open_loop, executed, counterfactual:NAME
  PairKey pair;
  std::optional<bool> real;   ///< what truly happened
  std::optional<bool> again;  ///< in reality once more, with other noise of the world
  std::optional<bool> model;  ///< what the judge says of the imagined clip
  std::string real_video, model_video;  ///< relative to the folder of the page; empty: none
};

/// One chunk of K frames, averaged over clips. PSNRs in dB of squared errors that were averaged first.
struct ChunkDrift {
  std::int64_t clips = 0;
  Number psnr = Undefined{"no clip is so long"};         ///< of all pixels
  Number psnr_moving = Undefined{"nothing moved"};       ///< of pixels that differ from the first frame in reality
  Number psnr_moving_copy = Undefined{"nothing moved"};  ///< of those, had the first frame stood still
  Number gripper_px = Undefined{"not found"};  ///< mean distance of the gripper, where it was found, from where it really is
  Number gripper_found = Undefined{"out of sight"};  ///< in which share of the frames whose real picture shows where it is
};

/// Of replays: what pictures say, apart from outcomes.
struct OpenLoopDrift {
  std::vector<double> object_px;  ///< per clip: of the object's middle at the end, head camera; lost: the diagonal
  std::vector<ChunkDrift> chunks;
};

/// The judge against the truth, on real clips.
struct JudgeQualityOnReal {
  std::string name;
  Number auroc = Undefined{"no clips"}, ece = Undefined{"no clips"};
  Estimate kappa;
  Number kappa_masked = Undefined{"not asked"};  ///< with the object's pixels painted over
};

/// The episodes of one part of the measurement, in all its worlds. Those that failed are in no number.
struct PartEpisodes {
  std::string part;  ///< its folder: closed, open, …
  std::int64_t episodes = 0, failed = 0;
  std::string last_failure = {};
};

struct FidelityInput {
  std::string suite_hash, model_hash;  ///< hex
  std::vector<FidelityRow> rows;
  OpenLoopDrift open_loop;
  std::vector<ChunkDrift> horizon;  ///< of long rollouts
  Number seconds_per_chunk = Undefined{"nothing was imagined"};
  JudgeQualityOnReal judge;
  std::vector<PartEpisodes> parts;  ///< that were asked
};

/// One policy on one task, closed loop; rates over the states that count in both worlds.
struct FidelityCell {
  std::string task, policy, checkpoint;
  std::int64_t n = 0;        ///< in reality and in the model
  std::int64_t n_again = 0;  ///< in reality and in reality once more: `again` is over these
  Number real = Undefined{"no pairs"}, again = Undefined{"no pairs"}, model = Undefined{"no pairs"},
         agreement = Undefined{"no pairs"};
};

/// How often two columns of outcomes agree, and how they do not. Intervals are of other initial states: what policies do
/// in one state counts by its design effect (ClusteredWilsonInterval, StatisticsByState).
struct OutcomeMatch {
  std::int64_t asked = 0;  ///< rows of that kind
  std::int64_t n = 0;      ///< of those, with an outcome in both columns: all else is over these
  Estimate agreement;
  Estimate hallucinated;  ///< success said, of those that truly failed
  Estimate missed;        ///< failure said, of those that truly succeeded
  Estimate kappa;
};
enum class FidelityColumn { kAgain, kModel };
OutcomeMatch MatchOf(const std::vector<FidelityRow>& rows, const std::string& kind, FidelityColumn column);

struct Fidelity {
  FidelityInput input;
  std::vector<FidelityCell> cells;       ///< empty where no policy acted: recordings were replayed, pictures are all there is
  WorldComparison model, again;  ///< of the closed loop, against reality
  Number mmrv = Undefined{"no task has two policies"}, mmrv_again = Undefined{"no task has two policies"};  ///< mean over tasks
  OutcomeMatch closed, closed_again, open;
  OutcomeMatch closed_again_told;  ///< reality against itself over the pairs whose imagined clip the judge could tell, too
  OutcomeMatch executed;  ///< what the model says of the actions chosen in it, against what they come to in reality
  /// Wrong outcomes of the closed loop whose actions were executed in reality: where the model goes wrong.
  struct WrongOutcomes {
    std::int64_t of_actions = 0;  ///< the actions come to something else than the model says: it is wrong about what it is told
    std::int64_t led_astray = 0;  ///< it is right about them; in reality the policy chose others, or chance decided
  } wrong;
  struct Counterfactual {
    std::string kind;
    OutcomeMatch match;
  };
  std::vector<Counterfactual> counterfactuals;
  std::optional<std::int64_t> usable_horizon_chunks;  ///< up to the first that gains less than 2 dB over a still picture
};
Fidelity FidelityOf(FidelityInput input);
/// Whether reality is held against itself over other pairs than the model is: clips that its judge could not tell, or that
/// failed, are in one and not in the other.
bool HasOtherPairs(const Fidelity& fidelity);
/// " of 40" to stand after a cell's `again` where it is over another number of pairs than the rest; else empty.
std::string OfOtherPairs(const FidelityCell& cell);
/// "38", or "38 of 40" where some of those asked have no outcome.
std::string PairsText(const OutcomeMatch& match);

/// "open: 2 of 40 episodes failed and are in no number; the last: …", for each part in which some did.
std::vector<std::string> FailedSentences(const std::vector<PartEpisodes>& parts);

/// fidelity.json (docs/fidelity.md); undefined numbers are null, their reasons stand under "undefined".
std::string FidelityJson(const Fidelity& fidelity);
/// kind,task,policy,checkpoint,initial_state,seed,real_outcome,real2_outcome,wm_verdict
std::string FidelityCsv(const std::vector<FidelityRow>& rows);
/// One page that opens from disk.
std::string FidelityPage(const Fidelity& fidelity);
/// A table for a terminal.
std::string FidelityText(const Fidelity& fidelity);

}  // namespace evac
