#include "judges/vlm_client.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <utility>

#include "core/error.h"
#include "core/seed.h"
#include "judges/json_text.h"

namespace evac {
namespace {

using nlohmann::json;

constexpr int kTries = 6, kTriesOfTimeout = 2, kTroublesBeforePause = 10;
constexpr double kLongestRetryAfter_s = 120, kLongestWait_s = 30, kPause_s = 60;

bool IsRejection(int status) { return status == 400 || status == 413 || status == 415 || status == 422; }
/// Nothing more is answered: a wrong key or address, or the credit is used up.
bool IsFinal(int status) { return status == 401 || status == 402 || status == 403 || status == 404; }
bool MayPass(int status) { return status == 429 || status >= 500; }

/// What a server says of an error: its message if it is in the usual place, else the body's beginning.
std::string WhatItSaid(const std::string& body) {
  const std::optional<json> reply = ParseJson(body);
  if (reply && reply->is_object() && reply->contains("error")) {
    const json& error = (*reply)["error"];
    if (error.is_object() && error.contains("message") && error["message"].is_string())
      return Excerpt(error["message"].get<std::string>());
    return Excerpt(error.dump());
  }
  return Excerpt(body);
}

VlmSaid Trouble(VlmOutcome outcome, const std::string& message) {
  VlmSaid said;
  said.trouble = outcome;
  said.message = message;
  return said;
}

/// One answer by itself, whatever came before it.
VlmSaid Read(const HttpReply& reply) {
  if (reply.trouble == HttpReply::Trouble::kTimeout) return Trouble(VlmOutcome::kTimeout, reply.message);
  if (reply.trouble != HttpReply::Trouble::kNone) return Trouble(VlmOutcome::kHttpError, reply.message);
  if (reply.status != 200) {
    VlmSaid said = Trouble(reply.status == 415 ? VlmOutcome::kUnsupportedMedia : VlmOutcome::kHttpError,
                           fmt::format("status {}: {}", reply.status, WhatItSaid(reply.body)));
    said.was_rejected = IsRejection(reply.status);
    return said;
  }
  VlmSaid said;
  said.completion = ParseCompletion(reply.body);
  said.trouble = said.completion.trouble;
  said.message = said.completion.message;
  return said;
}

/// Whether the same question may be answered the next time.
bool IsPassing(const HttpReply& reply, const VlmSaid& said) {
  if (reply.trouble == HttpReply::Trouble::kTooLarge) return false;
  if (reply.trouble != HttpReply::Trouble::kNone) return true;
  return reply.status == 200 ? said.trouble == VlmOutcome::kHttpError : MayPass(reply.status);
}

/// A status that speaks neither of the request nor of an answer: who goes on would store one error after another.
bool IsUnforeseen(const HttpReply& reply) {
  return reply.trouble == HttpReply::Trouble::kNone && reply.status != 200 && !IsRejection(reply.status) &&
         !IsFinal(reply.status);
}

}  // namespace

double VlmSpent::Usd(const VlmBudget& budget) const {
  return 1e-6 * (static_cast<double>(prompt_tokens) * budget.usd_per_million_prompt_tokens +
                 static_cast<double>(completion_tokens) * budget.usd_per_million_completion_tokens);
}

VlmClient::VlmClient(VlmClientOptions options) : options_(std::move(options)) {
  while (options_.base_url.ends_with('/')) options_.base_url.pop_back();
  const std::string& url = options_.base_url;
  if (!url.starts_with("http://") && !url.starts_with("https://"))
    throw InvalidInput("base_url is '{}', wanted one such as http://localhost:8000/v1", url);
}

HttpReply VlmClient::Send(const std::string& path, const std::string& body) {
  return Exchange({options_.base_url + path, body, options_.bearer_key}, options_.limits);
}

std::string VlmClient::Fingerprint(const std::string& model) {
  const HttpReply reply = Send("/models", "");
  if (reply.trouble != HttpReply::Trouble::kNone)
    throw InvalidInput("{}: no model server answers: {}", options_.base_url, reply.message);
  if (reply.status == 404 || reply.status == 405) return "";
  if (reply.status != 200)
    throw InvalidInput("{}/models: status {}: {}", options_.base_url, reply.status, WhatItSaid(reply.body));
  const std::optional<json> list = ParseJson(reply.body);
  if (!list || !list->is_object() || !list->contains("data") || !(*list)["data"].is_array()) return "";
  std::string known;
  for (const json& entry : (*list)["data"]) {
    const bool is_named = entry.is_object() && entry.contains("id") && entry["id"].is_string();
    const std::string id = is_named ? entry["id"].get<std::string>() : "";
    if (id != model) {
      known += (known.empty() ? "" : ", ") + id;
      continue;
    }
    json same_at_every_start = entry;  // vLLM writes when it was started, and a permission with a number of its own
    for (const char* key : {"created", "permission"}) same_at_every_start.erase(key);
    return same_at_every_start.dump();
  }
  throw InvalidInput("{}: has no model '{}', but: {}", options_.base_url, model, known);
}

VlmSaid VlmClient::Ask(const json& request) {
  const std::string body = request.dump();
  VlmSaid said = Trouble(VlmOutcome::kHttpError, "nothing was sent");
  for (int attempt = 1; attempt <= kTries; ++attempt) {
    const std::optional<long> pauses_before = MaySend();
    if (!pauses_before) break;
    const HttpReply reply = Send("/chat/completions", body);
    const VlmSaid before = std::exchange(said, Read(reply));
    said.attempts = attempt;
    said.prompt_tokens = before.prompt_tokens + said.completion.prompt_tokens.value_or(0);
    said.completion_tokens = before.completion_tokens + said.completion.completion_tokens.value_or(0);
    const bool is_passing = IsPassing(reply, said);
    Count(said, is_passing || IsUnforeseen(reply), *pauses_before);
    if (IsFinal(reply.status)) End(fmt::format("{}: {}", options_.base_url, said.message));
    if (!is_passing || attempt == kTries) break;
    if (said.trouble == VlmOutcome::kTimeout && attempt == kTriesOfTimeout) break;
    Wait(reply.retry_after_s, attempt);
  }
  return said;
}

/// Waits while somebody waits for the server. @returns how many pauses are over, if one more request may be sent.
std::optional<long> VlmClient::MaySend() {
  const std::lock_guard wait_with_the_others(pause_mutex_);
  const std::lock_guard lock(mutex_);
  const VlmBudget& budget = options_.budget;
  const VlmSpent all{spent_.requests + earlier_.requests, spent_.prompt_tokens + earlier_.prompt_tokens,
                     spent_.completion_tokens + earlier_.completion_tokens};
  const long tokens = all.prompt_tokens + all.completion_tokens;
  std::string why;
  if (budget.max_requests > 0 && all.requests >= budget.max_requests)
    why = fmt::format("{} requests were sent, as many as may be", all.requests);
  if (budget.max_tokens > 0 && tokens >= budget.max_tokens)
    why = fmt::format("{} tokens are spent of {}", tokens, budget.max_tokens);
  if (budget.max_usd > 0 && all.Usd(budget) >= budget.max_usd)
    why = fmt::format("{:.2f} USD are spent of {:.2f}", all.Usd(budget), budget.max_usd);
  if (!why.empty() && earlier_.requests > 0)
    why += fmt::format(" (with {} requests of earlier calls)", earlier_.requests);
  if (!why.empty() && !why_over_) why_over_ = fmt::format("{}: {}", kBudgetIsSpent, why);
  if (!why_over_ && options_.interrupted()) why_over_ = "interrupted";
  if (why_over_) return std::nullopt;
  ++spent_.requests;
  return pauses_;
}

/// @param pauses_before  how many were over when it was sent: what was under way before a pause says nothing of how the
/// server is after it.
void VlmClient::Count(const VlmSaid& said, bool is_trouble, long pauses_before) {
  {
    const std::lock_guard lock(mutex_);
    spent_.prompt_tokens += said.completion.prompt_tokens.value_or(0);
    spent_.completion_tokens += said.completion.completion_tokens.value_or(0);
    troubles_in_a_row_ = is_trouble ? troubles_in_a_row_ + 1 : 0;
    if (!is_trouble) tried_with_.reset();
    if (troubles_in_a_row_ < kTroublesBeforePause || is_pausing_) return;
    if (tried_with_) {
      if (pauses_before >= *tried_with_ && !why_over_)
        why_over_ = fmt::format("{} requests in a row failed, also after a pause; the last: {}", troubles_in_a_row_,
                                said.message);
      return;
    }
    is_pausing_ = true;
  }
  Pause();
}

void VlmClient::Pause() {
  const std::lock_guard others_wait_too(pause_mutex_);
  options_.sleep_s(kPause_s);
  const std::lock_guard lock(mutex_);
  is_pausing_ = false;
  ++pauses_;
  if (troubles_in_a_row_ >= kTroublesBeforePause) tried_with_ = pauses_;  // else a good answer came meanwhile
}

void VlmClient::Wait(std::optional<double> retry_after_s, int attempt) {
  double wait_s = 0;
  {
    const std::lock_guard lock(mutex_);
    if (why_over_) return;
    const std::uint64_t draw = SeedFor(options_.seed, static_cast<std::uint64_t>(spent_.requests));
    wait_s = SplitMix64(draw).Uniform(0, std::min(kLongestWait_s, std::exp2(attempt - 1)));
  }
  const std::lock_guard others_wait_too(pause_mutex_);
  if (retry_after_s) wait_s = std::clamp(*retry_after_s, 0.0, kLongestRetryAfter_s);
  options_.sleep_s(wait_s);
}

void VlmClient::CountEarlier(const VlmSpent& earlier) {
  const std::lock_guard lock(mutex_);
  earlier_ = earlier;
}

void VlmClient::End(const std::string& why) {
  const std::lock_guard lock(mutex_);
  if (!why_over_) why_over_ = why;
}

std::optional<std::string> VlmClient::WhyOver() const {
  const std::lock_guard lock(mutex_);
  return why_over_;
}

VlmSpent VlmClient::spent() const {
  const std::lock_guard lock(mutex_);
  return spent_;
}

}  // namespace evac
