#include "core/config.h"
#include "core/store_codec.h"
#include "core/store_rows.h"

namespace evac::rows {
namespace {

/// What a page says, whatever its comments and layout.
std::string Meaning(const std::string& page) {
  return page.empty() ? "" : Config::FromText(page, "task page").Canonical();
}

[[noreturn]] void ThrowOther(const std::string& what, const std::string& stored, const std::string& wanted) {
  throw InvalidInput("{} is in this run already, and is something else: stored {}, wanted {}", what, stored, wanted);
}

std::string Shown(const WorldInfo& world) {
  return fmt::format("(type {}, is_real {}, profile_hash '{}')", world.type, world.is_real, world.profile_hash);
}

}  // namespace

bool HasTable(sqlite::Connection& connection, const char* name) {
  return connection.Query("SELECT 1 FROM sqlite_schema WHERE type = 'table' AND name = ?", name).Step();
}

void InsertRun(sqlite::Connection& connection, const RunInfo& run) {
  connection.Run("INSERT INTO run (id, suite_text, suite_hash, suite_path, evac_version) VALUES (1, ?, ?, ?, ?)",
                 run.suite_text, run.suite_hash, run.suite_path, run.evac_version);
}

std::optional<RunInfo> SelectRun(sqlite::Connection& connection) {
  auto row = connection.Query("SELECT suite_text, suite_hash, suite_path, evac_version FROM run");
  if (!row.Step()) return std::nullopt;
  return RunInfo{row.Text(0), row.Text(1), row.Text(2), row.Text(3)};
}

bool IsWithoutResults(sqlite::Connection& connection) {
  for (const char* sql : {"SELECT 1 FROM episodes LIMIT 1", "SELECT 1 FROM real_trials LIMIT 1",
                          "SELECT 1 FROM sequential_looks LIMIT 1", "SELECT 1 FROM gate_decisions LIMIT 1"}) {
    if (connection.Query(sql).Step()) return false;
  }
  return true;
}

void DeleteBeginning(sqlite::Connection& connection) {
  for (const char* sql : {"DELETE FROM initial_scenes", "DELETE FROM counters", "DELETE FROM policies",
                          "DELETE FROM planned_episodes", "DELETE FROM page_hashes", "DELETE FROM worlds",
                          "DELETE FROM tasks", "DELETE FROM run"})
    connection.Run(sql);
}

void DeclareTask(sqlite::Connection& connection, const Task& task) {
  const std::string definition = codec::EncodeTask(task);
  auto row = connection.Query("SELECT definition, page FROM tasks WHERE id = ?", task.id);
  if (!row.Step()) {
    connection.Run("INSERT INTO tasks (id, definition, page, page_path) VALUES (?, ?, ?, ?)", task.id, definition,
                   task.page, task.page_path);
    return;
  }
  if (row.Text(0) != definition) ThrowOther("task '" + task.id + "'", row.Text(0), definition);
  if (row.Text(1) != task.page && Meaning(row.Text(1)) != Meaning(task.page)) {
    ThrowOther("the page of task '" + task.id + "'", "\n" + row.Text(1), "\n" + task.page);
  }
}

void DeclarePageHash(sqlite::Connection& connection, const std::string& task, const std::string& page_hash) {
  auto row = connection.Query("SELECT sha256 FROM page_hashes WHERE task = ?", task);
  if (!row.Step()) {
    connection.Run("INSERT INTO page_hashes (task, sha256) VALUES (?, ?)", task, page_hash);
    return;
  }
  if (row.Text(0) != page_hash)
    ThrowOther("the page of task '" + task + "', with the files that it names,", row.Text(0), page_hash);
}

void DeclareWorld(sqlite::Connection& connection, const WorldInfo& world) {
  auto row = connection.Query("SELECT name, type, is_real, profile_hash FROM worlds WHERE name = ?", world.name);
  if (!row.Step()) {
    connection.Run("INSERT INTO worlds (name, type, is_real, profile_hash) VALUES (?, ?, ?, ?)", world.name, world.type,
                   world.is_real, world.profile_hash);
    return;
  }
  const WorldInfo stored{row.Text(0), row.Text(1), row.Integer(2) != 0, row.Text(3)};
  if (Shown(stored) != Shown(world)) ThrowOther("world '" + world.name + "'", Shown(stored), Shown(world));
}

void DeclarePolicy(sqlite::Connection& connection, const PolicyInfo& policy) {
  auto row = connection.Query("SELECT declaration FROM policies WHERE name = ? AND checkpoint = ?", policy.name,
                              policy.checkpoint);
  if (!row.Step()) {
    connection.Run("INSERT INTO policies (name, checkpoint, declaration) VALUES (?, ?, ?)", policy.name,
                   policy.checkpoint, policy.declaration);
    return;
  }
  if (row.Text(0) == policy.declaration) return;
  ThrowOther("policy '" + policy.name + "@" + policy.checkpoint + "'", row.Text(0), policy.declaration);
}

void ForgetDeclarationWithoutEpisodes(sqlite::Connection& connection, const PolicyInfo& policy) {
  connection.Run(
      "DELETE FROM policies WHERE name = ?1 AND checkpoint = ?2 AND declaration <> ?3 AND NOT EXISTS "
      "(SELECT 1 FROM episodes WHERE policy = ?1 AND checkpoint = ?2)",
      policy.name, policy.checkpoint, policy.declaration);
}

std::vector<Task> SelectTasks(sqlite::Connection& connection) {
  std::vector<Task> tasks;
  for (auto row = connection.Query("SELECT definition, page, page_path FROM tasks ORDER BY id"); row.Step();) {
    Task& task = tasks.emplace_back(codec::DecodeTask(row.Text(0)));
    task.page = row.Text(1);
    task.page_path = row.Text(2);
  }
  return tasks;
}

std::map<std::string, std::string> SelectPageHashes(sqlite::Connection& connection) {
  std::map<std::string, std::string> hashes;
  if (!HasTable(connection, "page_hashes")) return hashes;
  for (auto row = connection.Query("SELECT task, sha256 FROM page_hashes"); row.Step();)
    hashes.emplace(row.Text(0), row.Text(1));
  return hashes;
}

void UpsertPlanned(sqlite::Connection& connection, const PlannedEpisodes& planned) {
  connection.Run(
      "INSERT INTO planned_episodes (task, world, policy, checkpoint, episodes) VALUES (?, ?, ?, ?, ?) "
      "ON CONFLICT (task, world, policy, checkpoint) DO UPDATE SET episodes = max(episodes, excluded.episodes)",
      planned.task, planned.world, planned.policy, planned.checkpoint, planned.episodes);
}

std::vector<PlannedEpisodes> SelectPlan(sqlite::Connection& connection) {
  constexpr std::int64_t kMost = std::int64_t{1} << 40;  // their sum is counted
  std::vector<PlannedEpisodes> plan;
  if (!HasTable(connection, "planned_episodes")) return plan;
  for (auto row = connection.Query("SELECT task, world, policy, checkpoint, episodes FROM planned_episodes "
                                   "ORDER BY task, world, policy, checkpoint");
       row.Step();) {
    plan.push_back({row.Text(0), row.Text(1), row.Text(2), row.Text(3), row.Integer(4)});
    if (plan.back().episodes < 0 || plan.back().episodes > kMost)
      throw InternalError("the store is damaged: {} is no number of episodes", plan.back().episodes);
  }
  return plan;
}

std::vector<WorldInfo> SelectWorlds(sqlite::Connection& connection) {
  std::vector<WorldInfo> worlds;
  for (auto row = connection.Query("SELECT name, type, is_real, profile_hash FROM worlds ORDER BY name"); row.Step();) {
    worlds.push_back({row.Text(0), row.Text(1), row.Integer(2) != 0, row.Text(3)});
  }
  return worlds;
}

std::vector<PolicyInfo> SelectPolicies(sqlite::Connection& connection) {
  std::vector<PolicyInfo> policies;
  for (auto row = connection.Query("SELECT name, checkpoint, declaration FROM policies ORDER BY name, checkpoint");
       row.Step();) {
    policies.push_back({row.Text(0), row.Text(1), row.Text(2)});
  }
  return policies;
}

}  // namespace evac::rows
