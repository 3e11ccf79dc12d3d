#include "apps/collect.h"

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <map>
#include <mutex>
#include <nlohmann/json.hpp>
#include <thread>

#include "apps/collect_episode.h"
#include "apps/progress_display.h"
#include "core/error.h"
#include "core/file.h"
#include "judges/attempt.h"

namespace evac {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;

/// OUT/collection.json: which collection this is. @throws InvalidInput if there is another.
void Claim(const CollectArguments& arguments, const Recipe& recipe) {
  const Json page = {{"format", "evac-collection"},
                     {"version", 1},
                     {"seed", std::to_string(arguments.seed)},
                     {"recipe_sha256", recipe.hash},
                     {"recipe", recipe.text}};
  const fs::path path = arguments.out / "collection.json";
  MakeFolders(arguments.out);
  if (!fs::exists(path)) return WriteFileAtomically(path, page.dump(2) + "\n");
  const Json before = Json::parse(ReadFile(path), nullptr, /*allow_exceptions=*/false);
  for (const char* field : {"version", "seed", "recipe_sha256"}) {
    const Json found = before.is_object() && before.contains(field) ? before[field] : Json();
    if (found == page[field]) continue;
    throw InvalidInput("{}: holds another collection: {} is {}, wanted {}; choose another --out", path.string(), field,
                       found.dump(), page[field].dump());
  }
}

/// "412 of 3000 episodes, 96 a minute, 26 min 57 s left", every few seconds.
class CollectProgress {
 public:
  CollectProgress(std::int64_t total, std::int64_t before) : total_(total), before_(before), done_(before) {}

  void Count() {
    ++done_;
    const auto now = Clock::now();
    if (now - shown_ < std::chrono::seconds(5) && done_ < total_) return;
    shown_ = now;
    const double spent_s = std::chrono::duration<double>(now - started_).count();
    const double rate = static_cast<double>(done_ - before_) / std::max(1e-9, spent_s);
    std::fputs(fmt::format("{} of {} episodes, {:.0f} a minute, {} left\n", done_, total_, 60 * rate,
                           Duration(static_cast<double>(total_ - done_) / rate))
                   .c_str(),
               stderr);
  }

 private:
  using Clock = std::chrono::steady_clock;
  std::int64_t total_, before_, done_;
  Clock::time_point started_ = Clock::now(), shown_ = started_;
};

/// The jobs still to do, shared out among threads that each have a world.
class Team {
 public:
  Team(const CollectArguments& arguments, const Recipe& recipe, std::vector<std::int64_t> todo)
      : arguments_(arguments),
        recipe_(recipe),
        todo_(std::move(todo)),
        progress_(recipe.episodes, recipe.episodes - static_cast<std::int64_t>(todo_.size())) {}

  void Work(int threads) {
    std::vector<std::thread> team;
    for (int i = 0; i < threads; ++i) team.emplace_back([this] { WorkAlone(); });
    for (std::thread& one : team) one.join();
    if (error_) std::rethrow_exception(error_);
  }

 private:
  void WorkAlone() try {
    EpisodeCollector collector(recipe_, arguments_.out);
    while (const std::optional<std::int64_t> index = Next()) {
      collector.Collect(JobAt(recipe_, arguments_.seed, *index));
      const std::lock_guard lock(mutex_);
      progress_.Count();
    }
  } catch (...) {
    const std::lock_guard lock(mutex_);
    if (!error_) error_ = std::current_exception();
  }

  std::optional<std::int64_t> Next() {
    const std::lock_guard lock(mutex_);
    if (error_ || next_ == todo_.size()) return std::nullopt;
    return todo_[next_++];
  }

  const CollectArguments& arguments_;
  const Recipe& recipe_;
  std::mutex mutex_;  ///< guards all below
  std::vector<std::int64_t> todo_;
  std::size_t next_ = 0;
  CollectProgress progress_;
  std::exception_ptr error_;
};

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
    const Json action = {{"start_frame", 0}, {"end_frame", row.frames - 1}, {"action_text", task.instruction}, {"skill", row.behaviour}};
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
  Claim(arguments, recipe);
  std::vector<std::int64_t> todo;
  for (std::int64_t index = 0; index < recipe.episodes; ++index) {
    if (!fs::exists(RowPath(PlaceOf(arguments.out, JobAt(recipe, arguments.seed, index).row)))) todo.push_back(index);
  }
  const int cores = std::max(1, static_cast<int>(std::thread::hardware_concurrency()));
  const int threads = std::min(arguments.jobs > 0 ? arguments.jobs : cores, static_cast<int>(todo.size()));
  Team(arguments, recipe, std::move(todo)).Work(threads);
  const std::vector<CollectedEpisode> rows = ReadRows(arguments, recipe);
  WriteManifest(arguments, recipe, rows);
  PrintFates(recipe, rows);
}

}  // namespace evac
