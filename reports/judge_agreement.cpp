#include "reports/judge_agreement.h"

#include <algorithm>
#include <map>
#include <optional>
#include <set>
#include <utility>

#include "core/statistics/rate_difference.h"
#include "core/statistics/rater_agreement.h"
#include "reports/counted_judges.h"
#include "reports/wording.h"

namespace evac {
namespace {

bool Says(const std::vector<std::string>& judges, const std::string& name) {
  return std::ranges::find(judges, name) != judges.end();
}

/// People before the simulator's physics, that before any other.
constexpr const char* kBestFirst[] = {"human", "oracle"};

std::string TruthOf(const RunSummary& summary) {
  for (const char* name : kBestFirst) {
    if (Says(summary.judges, name)) return name;
  }
  return LastJudge(summary.options.judge);
}

bool Decides(const Verdict& verdict) { return verdict.label == Label::kSuccess || verdict.label == Label::kFailure; }

/// Of each world. People who looked at a few clips of one take nothing away from the oracle in another.
std::map<std::string, std::string> TruthByWorld(const RunSummary& summary, const std::string& of_run) {
  std::set<std::pair<std::string, std::string>> deciding;  // world, judge
  for (const Episode& episode : summary.data.episodes) {
    const auto verdicts = summary.data.verdicts.find(episode.key.Id());
    if (verdicts == summary.data.verdicts.end()) continue;
    for (const char* name : kBestFirst) {
      const auto own = verdicts->second.find(name);
      if (own != verdicts->second.end() && Decides(own->second)) deciding.emplace(episode.key.world, name);
    }
  }
  std::map<std::string, std::string> truths;
  for (const WorldInfo& world : summary.data.worlds) {
    const auto best = std::ranges::find_if(
        kBestFirst, [&](const char* name) { return deciding.contains({world.name, name}); });
    truths[world.name] = best == std::end(kBestFirst) ? of_run : *best;
  }
  return truths;
}

/// What a judge and the truth said of the episodes of one world.
struct Said {
  ConfusionByState states;
  StatedByState stated;  ///< where the judge gave a probability
  std::int64_t apart = 0;

  void Add(const PairKey& pair, const Verdict& verdict, const Verdict& truth) {
    if (!Decides(verdict) || !Decides(truth)) {
      ++apart;
      return;
    }
    const bool is = truth.label == Label::kSuccess;
    const StateKey state = {pair.task, pair.initial_state};
    states[state].Add(verdict.label == Label::kSuccess, is);
    if (verdict.probability) stated[state].push_back({*verdict.probability, is});
  }
};

/// Its interval holds over other initial states, as kappa's does.
Estimate BiasOf(const ConfusionByState& states, double confidence) {
  std::vector<PairedOutcomes> clusters;
  for (const auto& [state, c] : states) clusters.push_back({{c.only_judge_success, c.only_human_success}, c.total()});
  Estimate bias = TangoOfClusters(clusters, confidence);
  bias.method = OnPairs("Tango", PairsOfInterval(clusters, confidence));
  return bias;
}

JudgeAgreement AgreementOf(const RunSummary& summary, const std::string& judge, const std::string& truth,
                           const std::string& world) {
  JudgeAgreement agreement;
  agreement.judge = judge;
  agreement.against = truth;
  agreement.world = world;
  Said said;
  for (const Episode& episode : summary.data.episodes) {
    if (episode.key.world != world) continue;
    const auto verdicts = summary.data.verdicts.find(episode.key.Id());
    if (verdicts == summary.data.verdicts.end()) continue;
    const auto own = verdicts->second.find(judge), true_one = verdicts->second.find(truth);
    if (own == verdicts->second.end()) continue;
    ++agreement.judged;
    if (true_one != verdicts->second.end()) said.Add(episode.key.pair, own->second, true_one->second);
  }
  agreement.apart = said.apart;
  agreement.confusion = SumOf(said.states);
  agreement.statistics = StatisticsByState(said.states, summary.options.confidence);
  agreement.bias = BiasOf(said.states, summary.options.confidence);
  agreement.calibration = CalibrationByState(said.stated, summary.options.confidence);
  return agreement;
}

/// Raters by episodes; 1 success, 0 failure, nothing where a rater was not asked or could not tell.
void AddRaters(const RunSummary& summary, JudgeReport& report) {
  for (const std::string& judge : summary.judges) {
    if (judge.starts_with("human:")) report.raters.push_back(judge);
  }
  if (report.raters.size() < 2) return;
  std::vector<std::vector<std::optional<double>>> ratings(report.raters.size());
  for (const auto& [episode, verdicts] : summary.data.verdicts) {
    std::int64_t given = 0;
    for (std::size_t rater = 0; rater < report.raters.size(); ++rater) {
      const auto own = verdicts.find(report.raters[rater]);
      const bool decides = own != verdicts.end() && Decides(own->second);
      ratings[rater].push_back(decides ? std::optional(own->second.label == Label::kSuccess ? 1.0 : 0.0)
                                       : std::nullopt);
      given += decides;
    }
    report.rated_twice += given >= 2;
  }
  report.alpha = KrippendorffAlpha(ratings, RatingMetric::kNominal);
}

}  // namespace

JudgeReport JudgesOf(const RunSummary& summary) {
  JudgeReport report;
  report.truth = TruthOf(summary);
  const std::map<std::string, std::string> truths = TruthByWorld(summary, report.truth);
  for (const std::string& judge : summary.judges) {
    if (judge == report.truth) continue;
    if (report.truth == "human" && judge.starts_with("human:")) continue;  // their own votes are in it: alpha is theirs
    for (const WorldInfo& world : summary.data.worlds) {
      const std::string& best = truths.at(world.name);
      JudgeAgreement agreement = AgreementOf(summary, judge, judge == best ? report.truth : best, world.name);
      if (agreement.judged > 0) report.judges.push_back(std::move(agreement));
    }
  }
  AddRaters(summary, report);
  return report;
}

std::string HeldAgainst(const JudgeReport& report) {
  std::vector<std::pair<std::string, std::string>> worlds;  // its best
  for (const JudgeAgreement& judge : report.judges) {
    const auto world = std::ranges::find(worlds, judge.world, &std::pair<std::string, std::string>::first);
    if (world == worlds.end()) {
      worlds.emplace_back(judge.world, judge.against);
    } else if (judge.against != report.truth) {
      world->second = judge.against;
    }
  }
  const bool is_one = std::ranges::all_of(worlds, [&](const auto& world) { return world.second == worlds[0].second; });
  if (is_one) return worlds.empty() ? report.truth : worlds[0].second;
  std::string text;
  for (const auto& [world, best] : worlds) text += (text.empty() ? "" : ", ") + best + " in " + world;
  return text;
}

}  // namespace evac
