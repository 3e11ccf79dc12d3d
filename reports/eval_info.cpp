#include "reports/eval_info.h"

#include <algorithm>
#include <map>
#include <nlohmann/json.hpp>
#include <tuple>

#include "reports/comparison.h"

namespace evac {
namespace {

using Json = nlohmann::ordered_json;
using Members = std::vector<const JudgedEpisode*>;

/// The episodes of one policy in one world: all, and by the place of their task.
struct Group {
  Members all;
  std::map<std::size_t, Members> tasks;
};

std::map<std::string, Group> GroupsOf(const RunSummary& summary) {
  std::map<std::string, std::size_t> places;
  for (const Task& task : summary.data.tasks) places.emplace(task.id, places.size());
  std::map<std::string, Group> groups;
  for (const JudgedEpisode& judged : summary.episodes) {
    const auto& [pair, world] = judged.episode.key;
    Group& group = groups[world + "/" + PolicyLabel(pair.policy, pair.checkpoint)];
    group.all.push_back(&judged);
    group.tasks[places.at(pair.task)].push_back(&judged);
  }
  return groups;
}

Members CountedOnes(const Members& members) {
  Members counted;
  std::ranges::copy_if(members, std::back_inserter(counted), &JudgedEpisode::Counts);
  return counted;
}

Json VideosOf(const Members& members) {
  Json videos = Json::array();
  for (const JudgedEpisode* judged : members) {
    if (!judged->episode.video.empty()) videos.push_back(judged->episode.video);
  }
  return videos;
}

Json MetricsOf(const Members& members) {
  Json rewards = Json::array(), successes = Json::array();
  const Members counted = CountedOnes(members);
  for (const JudgedEpisode* judged : counted) {
    rewards.push_back(judged->outcome == Outcome::kSuccess ? 1.0 : 0.0);
    successes.push_back(judged->outcome == Outcome::kSuccess);
  }
  return {
      {"sum_rewards", rewards}, {"max_rewards", rewards}, {"successes", successes}, {"video_paths", VideosOf(counted)}};
}

Json AggregateOf(const Members& members, double confidence) {
  const Members counted = CountedOnes(members);
  const Estimate rate = RateOf(counted, confidence);
  const Json mean = rate.value ? Json(*rate.value) : Json(nullptr);
  Json json = {{"avg_sum_reward", mean},
               {"avg_max_reward", mean},
               {"pc_success", rate.value ? Json(100 * *rate.value) : Json(nullptr)}};
  json["pc_success_ci95"] = rate.interval && confidence == 0.95
                                ? Json::array({100 * rate.interval->low, 100 * rate.interval->high})
                                : Json(nullptr);
  json["n_episodes"] = counted.size();
  json["n_apart"] = members.size() - counted.size();
  return json;
}

}  // namespace

std::string EvalInfoJson(const RunSummary& summary) {
  Json json = {{"per_task", Json::array()}, {"per_group", Json::object()}};
  const double confidence = summary.options.confidence;
  for (const auto& [name, group] : GroupsOf(summary)) {
    for (const auto& [place, members] : group.tasks) {
      json["per_task"].push_back({{"task_group", name},
                                  {"task_id", place},
                                  {"task", summary.data.tasks[place].id},
                                  {"metrics", MetricsOf(members)}});
    }
    Json& aggregate = json["per_group"][name] = AggregateOf(group.all, confidence);
    aggregate["video_paths"] = VideosOf(CountedOnes(group.all));
  }
  Members everything;
  for (const JudgedEpisode& judged : summary.episodes) everything.push_back(&judged);
  Json& overall = json["overall"] = AggregateOf(everything, confidence);
  overall["eval_s"] = overall["eval_ep_s"] = nullptr;
  overall["video_paths"] = VideosOf(CountedOnes(everything));
  return json.dump(1, ' ', false, Json::error_handler_t::replace) + "\n";
}

}  // namespace evac
