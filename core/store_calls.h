#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

namespace evac {

/// One question to a model server and what came of it.
struct JudgeCall {
  std::string key;                                        ///< SHA-256 of all that decides the answer
  std::string judge;                                      ///< vlm:<config>
  std::string response{};                                 ///< what the model wrote; of a failed call the message
  std::string status{};                                   ///< "ok", or the kind of error
  std::int64_t prompt_tokens = 0, completion_tokens = 0;  ///< 0 where the server did not count
  std::int64_t latency_ms = 0;
  int attempts = 1;
  std::string created_at{};  ///< ISO 8601, UTC
};

/// What one judge's calls of a run came to.
struct CallTotals {
  std::string judge;
  std::map<std::string, std::int64_t> calls{};  ///< by status: how many
  std::int64_t attempts = 0;                    ///< requests sent, tries again included
  std::int64_t prompt_tokens = 0, completion_tokens = 0;
  std::int64_t latency_ms = 0;  ///< of all calls together; they may have run side by side
};
/// By judge, in alphabetical order; none if the run has no such file. @throws Error if it cannot be read,
/// InvalidInput where nobody can know whether it is there (StatusOf).
std::vector<CallTotals> TotalsOfCalls(const std::filesystem::path& run);

/// Every call to a model server, RUN/judge_calls.sqlite (docs/formats/judge_calls.md): answers are never paid for
/// twice. Calls that failed are kept as history and never found again. Thread-safe; one file may serve several runs.
class CallCache {
 public:
  static constexpr const char* kFile = "judge_calls.sqlite";  ///< in a run's folder

  /// Made if absent. @throws Error if it cannot be opened or is another program's database.
  explicit CallCache(const std::filesystem::path& file);
  ~CallCache();

  /// The newest "ok" one of that key.
  std::optional<JudgeCall> Find(const std::string& key) const;
  /// On disk when it returns.
  void Add(const JudgeCall& call);

  /// What a server said about itself when it was last asked: without a network, answers are found under that.
  std::optional<std::string> Fingerprint(const std::string& server, const std::string& model) const;
  void SetFingerprint(const std::string& server, const std::string& model, const std::string& fingerprint);

 private:
  struct Database;
  mutable std::mutex mutex_;
  std::unique_ptr<Database> database_;
};

}  // namespace evac
