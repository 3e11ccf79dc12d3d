#include "harness/rollout.h"

#include "harness/lanes.h"

namespace evac {
namespace {

void Keep(const EpisodeRecord& record, Store& store, Summary& summary) {
  store.Add(record);
  ++summary.done;
  if (!IsFailure(record.episode.stop)) return;
  ++summary.failed;
  summary.last_failure = record.episode.key.Id() + ": " + record.episode.failure;
}

bool MustEnd(const RolloutOptions& options, Summary& summary) {
  summary.budget_spent = summary.failed > options.failures_left;
  summary.interrupted = options.interrupted && options.interrupted();
  return summary.budget_spent || summary.interrupted;
}

}  // namespace

Summary RunEpisodes(Policy& policy, World& world, JobQueue& jobs, Store& store, const RolloutOptions& options) {
  Summary summary;
  Lanes lanes(store, options);
  while (!MustEnd(options, summary) && lanes.Refill(jobs, policy, world) > 0) {  // new episodes take the free lanes: Reset on both sides
    lanes.Command(policy);  // one chunk of actions per live lane, or why not; the stop rule reads it
    if (MustEnd(options, summary)) break;  // whoever waited was sent away: no failure of the policy's
    if (options.check_policy) options.check_policy();  // whoever answered may be another than was greeted
    lanes.Observe(world);  // one call answers all lanes that have not come to rest
    if (MustEnd(options, summary)) break;  // Ctrl-C reaches a world's helpers too: no failure of the world's
    for (const EpisodeRecord& record : lanes.TakeFinished()) Keep(record, store, summary);
    if (options.on_progress) options.on_progress({summary.done, summary.failed, lanes.State()});
  }
  return summary;
}

}  // namespace evac
