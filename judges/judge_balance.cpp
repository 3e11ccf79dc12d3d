#include "judges/judge_balance.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <map>
#include <set>

#include "core/error.h"
#include "core/seed.h"

namespace evac {
namespace {

struct ThresholdItems {
  std::vector<double> probabilities;
  std::vector<int> outcomes;
  void Add(const PairedClip& clip) {
    probabilities.push_back(clip.probability);
    outcomes.push_back(clip.succeeded ? 1 : 0);
  }
};

ThresholdItems ItemsOf(const std::vector<PairedClip>& clips) {
  ThresholdItems items;
  for (const PairedClip& clip : clips) items.Add(clip);
  return items;
}

/// An episode's verdicts, by judge.
class VerdictsOf {
 public:
  explicit VerdictsOf(const Store& store) : current_(store.CurrentVerdicts()) {}
  const Verdict* By(const std::string& judge, const EpisodeKey& key) const {
    const auto episode = current_.find(key.Id());
    if (episode == current_.end()) return nullptr;
    const auto verdict = episode->second.find(judge);
    return verdict == episode->second.end() ? nullptr : &verdict->second;
  }

 private:
  std::map<std::string, std::map<std::string, Verdict>> current_;
};

std::string RealWorldOf(const Store& store) {
  for (const WorldInfo& world : store.Worlds()) {
    if (world.is_real) return world.name;
  }
  throw InvalidInput("{}: it has no real world (role: real), so nobody knows what truly happened", store.folder().string());
}

/// The one that is asked for, or the one there is.
std::string ImaginedWorld(const Store& store, const std::string& real, const std::set<std::string>& judged, const std::string& asked) {
  std::set<std::string> others = judged;
  others.erase(real);
  if (asked == real) throw InvalidInput("--world: {} is the real world, wanted one that is held against it", asked);
  if (!asked.empty() && !others.contains(asked))
    throw InvalidInput("--world: the judge has no verdict of world '{}' in {}; it has of: {}", asked, store.folder().string(),
                       fmt::join(others, ", "));
  if (!asked.empty()) return asked;
  if (others.empty())
    throw InvalidInput("{}: the judge has rated no clip of a world that is not real: evac judge {} --judge classifier --weights FILE",
                       store.folder().string(), store.folder().string());
  if (others.size() > 1) throw InvalidInput("{}: the judge has rated clips of {}: wanted one of them as --world", store.folder().string(), fmt::join(others, ", "));
  return *others.begin();
}

}  // namespace

PairedClips PairedClipsOf(const Store& store, const std::string& judge, const std::string& truth, const std::string& world) {
  const std::string real = RealWorldOf(store);
  const VerdictsOf verdicts(store);
  std::map<std::string, Episode> ended;
  std::set<std::string> judged;
  for (Episode& episode : store.Episodes()) {
    if (IsFailure(episode.stop)) continue;
    if (verdicts.By(judge, episode.key)) judged.insert(episode.key.world);
    ended.emplace(episode.key.Id(), std::move(episode));
  }
  PairedClips paired{ImaginedWorld(store, real, judged, world), {}};
  for (const auto& [id, episode] : ended) {
    const Verdict* verdict = episode.key.world == paired.world ? verdicts.By(judge, episode.key) : nullptr;
    if (!verdict) continue;
    EpisodeKey pair = episode.key;
    pair.world = real;
    const Verdict* truly = ended.contains(pair.Id()) ? verdicts.By(truth, pair) : nullptr;
    const bool is_known = truly && (truly->label == Label::kSuccess || truly->label == Label::kFailure);
    if (!verdict->probability || !is_known) {
      ++paired.left_out;
      continue;
    }
    paired.clips.push_back({episode.key.pair.task + "/" + episode.key.pair.initial_state, *verdict->probability,
                            truly->label == Label::kSuccess, episode.video_sha256});
  }
  return paired;
}

Confusion ConfusionAt(const std::vector<PairedClip>& clips, double threshold) {
  const ThresholdItems items = ItemsOf(clips);
  return ConfusionAt(items.probabilities, items.outcomes, threshold);
}

Estimate BalanceOf(const std::vector<PairedClip>& clips, const BootstrapOptions& options) {
  Estimate balance;
  balance.n = static_cast<std::int64_t>(clips.size());
  balance.confidence = options.confidence;
  balance.method = fmt::format("bootstrap over initial states, percentile, B={}, seed {}", options.replicates, options.seed);
  const ThresholdItems items = ItemsOf(clips);
  balance.value = BalancedThreshold(items.probabilities, items.outcomes);
  if (!balance.value) {
    balance.interval = Undefined{balance.value.reason()};
    return balance;
  }
  std::map<std::string, std::vector<const PairedClip*>> states;
  for (const PairedClip& clip : clips) states[clip.state].push_back(&clip);
  std::vector<const std::vector<const PairedClip*>*> clusters;
  for (const auto& [state, of_state] : states) clusters.push_back(&of_state);
  Resampled resampled{*balance.value, {}, {}};
  SplitMix64 random(options.seed);
  for (int replicate = 0; replicate < options.replicates; ++replicate) {
    ThresholdItems drawn;
    for (std::size_t i = 0; i < clusters.size(); ++i) {
      for (const PairedClip* clip : *clusters[random.Below(clusters.size())]) drawn.Add(*clip);
    }
    if (const Number threshold = BalancedThreshold(drawn.probabilities, drawn.outcomes)) resampled.replicates.push_back(*threshold);
  }
  balance.interval = clusters.size() < 2 ? Defined<Interval>(Undefined{"one initial state"}) : IntervalsOf(resampled, options.confidence).percentile;
  return balance;
}

}  // namespace evac
