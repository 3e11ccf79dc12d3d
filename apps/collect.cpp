#include "apps/collect.h"

#include <fmt/format.h>

#include <algorithm>
#include <map>
#include <memory>
#include <mutex>
#include <nlohmann/json.hpp>

#include "apps/collect_episode.h"
#include "apps/warnings.h"
#include "apps/work_share.h"
#include "core/error.h"
#include "core/file.h"
#include "core/parse_json.h"
#include "core/store_lock.h"
#include "core/version.h"
#include "judges/attempt.h"

namespace evac {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;

Json ClaimIn(const fs::path& path) try {
  return ParseJson<Json>(ReadFile(path));
} catch (const Json::parse_error&) {
  return Json();  // of another version, another seed …
} catch (const Json::exception& error) {
  throw InvalidInput("{}: holds another collection: {}; choose another --out", path.string(), error.what());
}

/// OUT/collection.json: which collection this is, and which evac began it. @throws InvalidInput if there is another.
void Claim(const CollectArguments& arguments, const Recipe& recipe) {
  const Json page = {{"format", "evac-collection"},
                     {"version", 1},
                     {"seed", std::to_string(arguments.seed)},
                     {"recipe_sha256", recipe.hash},
                     {"evac_version", EVAC_VERSION},
                     {"recipe", recipe.text}};
  const fs::path path = arguments.out / "collection.json";
  if (!fs::exists(path)) return WriteFileAtomically(path, page.dump(2) + "\n");
  const Json before = ClaimIn(path);
  for (const char* field : {"version", "seed", "recipe_sha256"}) {
    const Json found = before.is_object() && before.contains(field) ? before[field] : Json();
    if (found == page[field]) continue;
    throw InvalidInput("{}: holds another collection: {} is {}, wanted {}; choose another --out", path.string(), field,
                       found.dump(), page[field].dump());
  }
  const auto began = before.find("evac_version");
  SayIfAnotherVersionBegan(arguments.out, began != before.end() && began->is_string() ? began->get<std::string>() : "");
}

/// Collects what is still to do; each thread has a world of its own.
void CollectAll(const CollectArguments& arguments, const Recipe& recipe, const std::vector<std::int64_t>& todo) {
  const auto count = static_cast<std::int64_t>(todo.size());
  CountProgress progress("episodes", recipe.episodes, recipe.episodes - count);
  std::mutex mutex;
  std::vector<std::unique_ptr<EpisodeCollector>> idle;  // guarded by mutex
  const auto take = [&]() -> std::unique_ptr<EpisodeCollector> {
    const std::lock_guard lock(mutex);
    if (idle.empty()) return nullptr;
    auto collector = std::move(idle.back());
    idle.pop_back();
    return collector;
  };
  const auto work = [&](std::int64_t i) {
    std::unique_ptr<EpisodeCollector> collector = take();
    if (!collector) collector = std::make_unique<EpisodeCollector>(recipe, arguments.out);
    collector->Collect(JobAt(recipe, arguments.seed, todo[static_cast<std::size_t>(i)]));
    const std::lock_guard lock(mutex);
    idle.push_back(std::move(collector));
  };
  ShareOut(count, arguments.jobs, work, [&](std::int64_t) { progress.Count(); });
}

std::vector<CollectedEpisode> ReadRows(const CollectArguments& arguments, const Recipe& recipe) {
  std::vector<CollectedEpisode> rows;
  for (std::int64_t index = 0; index < recipe.episodes; ++index) {
    const fs::path path = RowPath(PlaceOf(arguments.out, JobAt(recipe, arguments.seed, index).row));
    rows.push_back(ParseCollected(ReadFile(path), path.string()));
  }
  return rows;
}

/// AgiBot World's description of a task's episodes.
std::string TaskInfo(const Task& task, const std::vector<CollectedEpisode>& rows) {
  Json list = Json::array();
  for (const CollectedEpisode& row : rows) {
    if (row.task != task.id || row.frames == 0) continue;
    const Json action = {
        {"start_frame", 0}, {"end_frame", row.frames - 1}, {"action_text", task.instruction}, {"skill", row.behaviour}};
    list.push_back({{"episode_id", row.episode},
                    {"task_id", task.id},
                    {"task_name", task.instruction},
                    {"init_scene_text", row.initial_state},
                    {"label_info", {{"action_config", Json::array({action})}}}});
  }
  return list.dump(1) + "\n";
}

void WriteManifest(const CollectArguments& arguments, const Recipe& recipe, const std::vector<CollectedEpisode>& rows) {
  std::string lines, table = CollectedCsvHeading();
  for (const CollectedEpisode& row : rows) {
    lines += CollectedJson(row) + "\n";
    table += CollectedCsvLine(row);
  }
  MakeFolders(arguments.out / "task_info");
  for (const CollectTask& task : recipe.tasks)
    WriteFileAtomically(arguments.out / "task_info" / ("task_" + task.task.id + ".json"), TaskInfo(task.task, rows));
  WriteFileAtomically(arguments.out / "manifest.jsonl", lines);
  WriteFileAtomically(arguments.out / "manifest.csv", table);
}

/// What a finished collection lists is not to be forgotten by a call that asks for less.
void RequireNoFewerThanListed(const CollectArguments& arguments, const Recipe& recipe) {
  const fs::path manifest = arguments.out / "manifest.jsonl";
  if (!fs::exists(manifest)) return;
  const std::string lines = ReadFile(manifest);
  const auto listed = std::count(lines.begin(), lines.end(), '\n');
  if (listed > recipe.episodes)
    throw InvalidInput("{} lists {} episodes, found {} asked for, wanted no fewer", manifest.string(), listed, recipe.episodes);
}

/// Shares of every fate per task, in per cent, as a table.
void PrintFates(const Recipe& recipe, const std::vector<CollectedEpisode>& rows) {
  std::map<std::pair<std::string, std::string>, int> counts;
  std::map<std::string, int> totals;
  std::int64_t frames = 0;
  for (const CollectedEpisode& row : rows) {
    ++counts[{row.task, row.fate}];
    ++totals[row.task];
    frames += row.frames;
  }
  std::string text = fmt::format("{:<16}", "% of episodes");
  for (const CollectTask& task : recipe.tasks) text += fmt::format("{:>14}", task.task.id);
  for (int fate = 0; fate <= kFates; ++fate) {
    const std::string name = fate < kFates ? Name(static_cast<Fate>(fate)) : Name(StopReason::kDiverged);
    text += fmt::format("\n{:<16}", name);
    for (const CollectTask& task : recipe.tasks) {
      const std::string& id = task.task.id;
      text += fmt::format("{:>14.1f}", 100.0 * counts[{id, name}] / std::max(1, totals[id]));
    }
  }
  fmt::print("{}\n{} episodes, {} frames\n", text, rows.size(), frames);
}

}  // namespace

void Collect(const CollectArguments& arguments) {
  Recipe recipe = ReadRecipe(arguments.recipe, arguments.assignments);
  if (arguments.episodes > 0) recipe.episodes = arguments.episodes;
  MakeFolders(arguments.out);
  const RunLock lock(arguments.out / "lock");
  Claim(arguments, recipe);
  RequireNoFewerThanListed(arguments, recipe);
  std::vector<std::int64_t> todo;
  for (std::int64_t index = 0; index < recipe.episodes; ++index) {
    if (!fs::exists(RowPath(PlaceOf(arguments.out, JobAt(recipe, arguments.seed, index).row)))) todo.push_back(index);
  }
  CollectAll(arguments, recipe, todo);
  const std::vector<CollectedEpisode> rows = ReadRows(arguments, recipe);
  WriteManifest(arguments, recipe, rows);
  PrintFates(recipe, rows);
}

}  // namespace evac
