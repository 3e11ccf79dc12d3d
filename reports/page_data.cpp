#include <algorithm>

#include "core/base64.h"
#include "reports/counted_judges.h"
#include "reports/html.h"
#include "reports/page_columns.h"
#include "reports/page_parts.h"

namespace evac {
namespace {

using Json = nlohmann::ordered_json;

/// Of all sentences of a page together: what a page of 5 MB has room for beside the rest.
constexpr std::size_t kMostTextBytes = 2'400'000;

/// Stands for a file that lies where nearly all do: videos/ID.mp4, thumbs/ID.jpg. No path of a run is this.
constexpr const char* kWhereItsIdSays = "=";

/// "11100": which stages were reached, in the rubric's order; "" where the verdict does not tell.
std::string StagesOf(const JudgedEpisode& judged, const Task* task) {
  std::string reached;
  if (task == nullptr || !judged.verdict) return reached;
  for (const Stage& stage : task->rubric.stages) {
    const auto found = judged.verdict->stages.find(stage.name);
    if (found == judged.verdict->stages.end()) return "";
    reached += found->second ? '1' : '0';
  }
  return reached;
}

/// All that the script knows of an episode.
class EpisodeColumns {
 public:
  EpisodeColumns(const RunSummary& summary, const PageOptions& options) : summary_(summary), options_(options) {
    for (const Task& task : summary.data.tasks) tasks_by_id_[task.id] = &task;
    for (const std::string& judge : summary.judges) {
      if (!IsCounted(judge, summary.options.judge)) others_.push_back({judge, {}, {}});
    }
    for (std::size_t i = 0; i < summary.episodes.size(); ++i) Add(summary.episodes[i], i);
  }

  Json ToJson() const {
    Json json = {{"task", task_.Json()},     {"state", state_.Json()},     {"policy", policy_.Json()},
                 {"seed", seed_.Json()},     {"world", world_.Json()},     {"file", file_.Json()},
                 {"stages", stages_.Json()}, {"outcome", outcome_.Json()}, {"stop", stop_.Json()}};
    const std::size_t share = kMostTextBytes / (2 + others_.size());
    json["reason"] = reason_.Json(share);
    json["end"] = end_.Json(share);
    json["video"] = video_.Json();
    json["thumbnail"] = thumbnail_.Json();
    json["embedded"] = {{"at", embedded_at_}, {"jpeg", embedded_}};
    json["judges"] = Json::array();
    for (const Other& other : others_)
      json["judges"].push_back(
          {{"name", other.judge}, {"label", other.label.Json()}, {"reason", other.reason.Json(share)}});
    return json;
  }

 private:
  struct Other {
    std::string judge;
    Column label;
    TextColumn reason;
  };

  void Add(const JudgedEpisode& judged, std::size_t index) {
    const Episode& episode = judged.episode;
    const auto& [pair, world] = episode.key;
    const auto task = tasks_by_id_.find(pair.task);
    task_.Add(pair.task);
    state_.Add(pair.initial_state);
    policy_.Add(PolicyLabel(pair.policy, pair.checkpoint));
    file_.Add(pair.policy + "@" + pair.checkpoint);
    seed_.Add(std::to_string(pair.seed));
    world_.Add(world);
    outcome_.Add(Name(judged.outcome));
    stop_.Add(Name(episode.stop));
    stages_.Add(StagesOf(judged, task == tasks_by_id_.end() ? nullptr : task->second));
    reason_.Add(!episode.failure.empty() ? episode.failure : judged.verdict ? judged.verdict->reason : "");
    end_.Add(episode.stop_reason);
    AddFiles(episode, index);
    AddOthers(episode);
  }

  void AddFiles(const Episode& episode, std::size_t index) {
    const std::string id = episode.key.Id();
    video_.Add(episode.video == "videos/" + id + ".mp4" ? kWhereItsIdSays : episode.video);
    thumbnail_.Add(episode.thumbnail == "thumbs/" + id + ".jpg" ? kWhereItsIdSays : episode.thumbnail);
    if (!options_.embedded || episode.thumbnail.empty()) return;
    const std::string bytes = options_.embedded(episode.thumbnail);
    if (bytes.empty()) return;
    embedded_at_.push_back(index);
    embedded_.push_back(Base64(bytes));
  }

  void AddOthers(const Episode& episode) {
    if (others_.empty()) return;
    const auto verdicts = summary_.data.verdicts.find(episode.key.Id());
    for (Other& other : others_) {
      const Verdict* verdict = nullptr;
      if (verdicts != summary_.data.verdicts.end()) {
        const auto own = verdicts->second.find(other.judge);
        if (own != verdicts->second.end()) verdict = &own->second;
      }
      other.label.Add(verdict == nullptr ? "" : Name(verdict->label));
      other.reason.Add(verdict == nullptr ? "" : verdict->reason);
    }
  }

  const RunSummary& summary_;
  const PageOptions& options_;
  std::map<std::string, const Task*> tasks_by_id_;
  Column task_, state_, policy_, file_, seed_, world_, outcome_, stop_, stages_, video_, thumbnail_;
  TextColumn reason_, end_;
  std::vector<Other> others_;
  std::vector<std::size_t> embedded_at_;  ///< the numbers of the episodes whose pictures are in `embedded_`
  std::vector<std::string> embedded_;     ///< base64 of JPEGs
};

Json TasksJson(const RunSummary& summary) {
  Json tasks = Json::object();
  for (const Task& task : summary.data.tasks) {
    Json stages = Json::array();
    for (const Stage& stage : task.rubric.stages) stages.push_back(stage.name);
    tasks[task.id] = {{"ratio", AspectRatio(summary, task.id)}, {"period_s", task.period_s}, {"stages", stages}};
  }
  return tasks;
}

}  // namespace

std::string DataPart(const RunSummary& summary, const PageOptions& options) {
  const bool beside = options.run_folder.empty() || options.run_folder == ".";
  Json json = {{"run", beside ? "" : Link(options.run_folder + "/")},
               {"real", summary.reference},
               {"judge", summary.options.judge},
               {"n", summary.episodes.size()}};
  json["tasks"] = TasksJson(summary);
  json["episodes"] = EpisodeColumns(summary, options).ToJson();
  return "<script type=\"application/json\" id=\"run-data\">" + ForScript(json) + "</script>";
}

}  // namespace evac
