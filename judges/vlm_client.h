#pragma once

#include <functional>
#include <mutex>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>

#include "core/http_exchange.h"
#include "judges/vlm_reply.h"

namespace evac {

/// What a judge may cost, over all calls of VlmClient::CountEarlier too; 0: no limit.
struct VlmBudget {
  long max_requests = 0;
  long max_tokens = 0;  ///< prompt and completion together, as the server counts them
  double max_usd = 0;
  double usd_per_million_prompt_tokens = 0, usd_per_million_completion_tokens = 0;
};

/// What VlmClient::WhyOver begins with then.
inline constexpr const char* kBudgetIsSpent = "the budget is spent";

struct VlmSpent {
  long requests = 0, prompt_tokens = 0, completion_tokens = 0;
  double Usd(const VlmBudget& budget) const;
};

struct VlmClientOptions {
  std::string base_url;      ///< "http://localhost:8000/v1"
  std::string bearer_key{};  ///< empty: none is sent
  HttpLimits limits{};
  VlmBudget budget{};
  std::uint64_t seed = 7;                 ///< of the jitter between tries
  std::function<void(double)> sleep_s{};  ///< waits that long; must be given
  std::function<bool()> interrupted = [] { return false; };  ///< asked before each request, by any thread
};

/// What one question came to, after all its tries.
struct VlmSaid {
  std::optional<VlmOutcome> trouble;  ///< nothing: `completion.text` is what the model wrote
  std::string message;                ///< of the trouble
  bool was_rejected = false;  ///< 400, 413, 415 or 422: the request itself; `message` holds what the server said of it
  VlmCompletion completion;
  int attempts = 0;
  long prompt_tokens = 0, completion_tokens = 0;  ///< of all tries, as far as the server counted them
};

/// Asks an OpenAI-compatible server (docs/vlm_judge.md):
///   429, 503               again after Retry-After (0 … 120 s), else after a random wait up to 1, 2, 4 … 30 s; six
///                          tries. Whoever else asks waits as well.
///   5xx, a broken answer   the same without Retry-After. After ten in a row: one pause of 60 s; over if one
///                          that was sent after it fails again.
///   timeouts               tried twice
///   400, 413, 415, 422     not again: was_rejected
///   401, 402, 403, 404     over
///   any other status       not again; counts as one of the ten in a row
///   interrupted            over; what was sent is waited for
/// Over means: nothing more is sent, everything stored stays, WhyOver says why. Thread-safe.
class VlmClient {
 public:
  /// @throws InvalidInput if the URL is none.
  explicit VlmClient(VlmClientOptions options);

  /// GET /models. @returns what the server says of the model: part of every cache key. Servers that have no such list
  /// give "". @throws InvalidInput if the server is not there, wants another key, or has no such model (naming those it
  /// has).
  std::string Fingerprint(const std::string& model);

  VlmSaid Ask(const nlohmann::json& request);

  /// From now on the budget has these spent as well.
  void CountEarlier(const VlmSpent& earlier);

  std::optional<std::string> WhyOver() const;
  /// By this client alone.
  VlmSpent spent() const;

 private:
  HttpReply Send(const std::string& path, const std::string& body);
  std::optional<long> MaySend();
  void Count(const VlmSaid& said, bool is_trouble, long pauses_before);
  void Pause();
  void Wait(std::optional<double> retry_after_s, int attempt);
  void End(const std::string& why);

  VlmClientOptions options_;
  std::mutex pause_mutex_;    ///< held while somebody waits for the server; taken before the other
  mutable std::mutex mutex_;  ///< guards all below
  VlmSpent spent_, earlier_;
  std::optional<std::string> why_over_;
  int troubles_in_a_row_ = 0;
  bool is_pausing_ = false;         ///< or about to
  long pauses_ = 0;                 ///< that are over
  std::optional<long> tried_with_;  ///< so many were over after the pause of this row of troubles; nothing: it had none
};

}  // namespace evac
