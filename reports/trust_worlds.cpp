#include "reports/trust_worlds.h"

#include <fmt/format.h>

#include <algorithm>
#include <string_view>

#include "core/error.h"
#include "reports/wording.h"

namespace evac {
namespace {

/// Of imported trials those that have an outcome are what counts (TrustInputOf).
std::string HeldAgainst(const RunSummary& summary) {
  const std::vector<RealTrial>& trials = summary.data.real_trials;
  if (trials.empty()) return "the world " + summary.reference;
  const auto has_outcome = [](const RealTrial& trial) {
    return trial.outcome == Label::kSuccess || trial.outcome == Label::kFailure;
  };
  const std::int64_t counted = std::ranges::count_if(trials, has_outcome), others = std::ssize(trials) - counted;
  const std::string left_out = others > 0 ? fmt::format(" ({} more without an outcome)", others) : "";
  return Counted(counted, "imported real trial") + left_out;
}

/// Who shows a reason says himself that it is about trust.
std::string ReasonOf(const Error& error) {
  std::string_view reason = error.what();
  constexpr std::string_view kSubject = "trust: ";
  if (reason.starts_with(kSubject)) reason.remove_prefix(kSubject.size());
  return std::string(reason);
}

}  // namespace

WorldsTrust TrustOfWorlds(const RunSummary& summary, const std::vector<std::string>& worlds,
                          const TrustOptions& options) {
  WorldsTrust trust;
  for (const std::string& world : worlds) {
    try {
      std::vector<TaskTrust> tasks = TrustOf(TrustInputOf(summary, summary.data.real_trials, world), options);
      trust.worlds.push_back({world, HeldAgainst(summary), summary.options.judge, options, std::move(tasks)});
    } catch (const Error& error) {  // nobody judged it yet, or could
      trust.unsaid.push_back({world, ReasonOf(error)});
    }
  }
  return trust;
}

std::string WhyNothingIsSaid(const std::vector<UnsaidWorld>& unsaid) {
  if (unsaid.empty()) return "the run has no world beside the real one";
  const std::string& first = unsaid.front().reason;
  if (std::ranges::all_of(unsaid, [&](const UnsaidWorld& other) { return other.reason == first; })) return first;
  std::string text;
  for (const auto& [world, reason] : unsaid) text += fmt::format("{}{}: {}", text.empty() ? "" : "; ", world, reason);
  return text;
}

std::string TrustText(const WorldsTrust& trust) {
  std::string text;
  for (const TrustReport& report : trust.worlds) text += (text.empty() ? "" : "\n") + TrustText(report);
  for (const auto& [world, reason] : trust.unsaid)
    text += fmt::format("{}May {} be trusted? Nothing can be said: {}.\n", text.empty() ? "" : "\n", world, reason);
  return text;
}

nlohmann::ordered_json TrustJson(const WorldsTrust& trust) {
  nlohmann::ordered_json json = {{"schema", 1}, {"worlds", nlohmann::ordered_json::array()}};
  for (const TrustReport& report : trust.worlds) json["worlds"].push_back(TrustJson(report));
  json["unsaid"] = nlohmann::ordered_json::array();
  for (const auto& [world, reason] : trust.unsaid) json["unsaid"].push_back({{"world", world}, {"reason", reason}});
  return json;
}

}  // namespace evac
