#include "judges/judge_balance.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <optional>
#include <set>
#include <utility>

#include "core/error.h"
#include "core/seed.h"

namespace evac {
namespace {

constexpr double kNearest = 1e-9;  // to 0 or 1: what is closer has a logit of rounding

double Logit(double p) {
  const double inside = std::clamp(p, kNearest, 1 - kNearest);
  return std::log(inside / (1 - inside));
}

/// What a threshold between two clips gets wrong both ways, and where that is.
struct Gap {
  std::int64_t imbalance;  ///< the difference of the two shares, times both counts: whole, so that ties are ties
  double logit;            ///< the middle
};

/// Of all gaps between clips of different probability the one whose shares differ least; of two the one next to .5.
Number BalancedLogit(std::vector<const PairedClip*> clips) {
  const auto successes = std::ranges::count_if(clips, &PairedClip::succeeded);
  const auto failures = static_cast<std::int64_t>(clips.size()) - successes;
  if (failures == 0 || successes == 0) return Undefined{"all outcomes are alike"};
  std::ranges::sort(clips, {}, &PairedClip::probability);
  std::optional<Gap> best;
  std::int64_t called_good = failures, called_bad = 0;
  for (std::size_t i = 0; i + 1 < clips.size(); ++i) {
    if (clips[i]->succeeded) ++called_bad;
    else --called_good;
    const double low = clips[i]->probability, high = clips[i + 1]->probability;
    if (low == high) continue;
    const Gap gap{std::abs(called_good * successes - called_bad * failures), (Logit(low) + Logit(high)) / 2};
    const auto rank = [](const Gap& of) { return std::pair(of.imbalance, std::abs(of.logit)); };
    if (!best || rank(gap) < rank(*best)) best = gap;
  }
  if (!best) return Undefined{"all probabilities are alike"};
  return best->logit;
}

Number BalancedProbability(const std::vector<const PairedClip*>& clips) {
  const Number logit = BalancedLogit(clips);
  if (!logit) return logit;
  return 1 / (1 + std::exp(-*logit));
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
  std::vector<double> probabilities;
  std::vector<int> outcomes;
  for (const PairedClip& clip : clips) {
    probabilities.push_back(clip.probability);
    outcomes.push_back(clip.succeeded ? 1 : 0);
  }
  return ConfusionAt(probabilities, outcomes, threshold);
}

Estimate BalanceOf(const std::vector<PairedClip>& clips, const BootstrapOptions& options) {
  Estimate balance;
  balance.n = static_cast<std::int64_t>(clips.size());
  balance.confidence = options.confidence;
  balance.method = fmt::format("bootstrap over initial states, percentile, B={}, seed {}", options.replicates, options.seed);
  std::vector<const PairedClip*> all;
  for (const PairedClip& clip : clips) all.push_back(&clip);
  balance.value = BalancedProbability(all);
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
    std::vector<const PairedClip*> drawn;
    for (std::size_t i = 0; i < clusters.size(); ++i) {
      const std::vector<const PairedClip*>& cluster = *clusters[random.Below(clusters.size())];
      drawn.insert(drawn.end(), cluster.begin(), cluster.end());
    }
    if (const Number threshold = BalancedProbability(drawn)) resampled.replicates.push_back(*threshold);
  }
  balance.interval = clusters.size() < 2 ? Defined<Interval>(Undefined{"one initial state"}) : IntervalsOf(resampled, options.confidence).percentile;
  return balance;
}

}  // namespace evac
