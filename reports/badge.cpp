#include "reports/badge.h"

#include <fmt/format.h>

#include <algorithm>

#include "core/utf8.h"
#include "reports/comparison.h"
#include "reports/wording.h"
#include "reports/xml.h"

namespace evac {
namespace {

constexpr const char* kGreen = "#1a7f37";
constexpr const char* kRed = "#cf222e";
constexpr const char* kBlue = "#0969da";
constexpr const char* kGrey = "#6e7781";

struct Badge {
  std::string text;
  const char* colour = kGrey;
};

Badge OfGates(const std::vector<ShownGate>& gates) {
  const auto worst = std::ranges::max_element(gates, {}, GravityOf);
  Badge badge{Name(worst->decision.outcome), kGrey};
  const auto& rules = worst->decision.rules;
  const auto rule = std::ranges::find_if(rules, [&](const RuleDecision& one) {
    return one.outcome == worst->decision.outcome && one.metric == "success_rate" && one.value.value;
  });
  if (rule != rules.end()) badge.text = PercentWithInterval(rule->value) + " " + badge.text;
  if (!worst->is_current) {
    badge.text += ", of older data";
  } else if (worst->decision.outcome == GateOutcome::kPass) {
    badge.colour = kGreen;
  } else if (worst->decision.outcome == GateOutcome::kFail) {
    badge.colour = kRed;
  }
  return badge;
}

Badge OfRun(const RunSummary& summary) {
  const bool has_no_one_rate = summary.data.worlds.size() > 1 && summary.reference.empty();
  if (summary.policies.size() != 1 || has_no_one_rate)
    return {Counted(static_cast<std::int64_t>(summary.policies.size()), "policy", "policies") + ", " +
                Counted(static_cast<std::int64_t>(summary.episodes.size()), "episode"),
            kGrey};
  const bool one_world = summary.data.worlds.size() == 1;
  const std::string world = one_world ? summary.data.worlds.front().name : summary.reference;
  std::vector<const JudgedEpisode*> members;
  for (const JudgedEpisode& judged : summary.episodes) {
    if (judged.episode.key.world == world) members.push_back(&judged);
  }
  const Estimate rate = RateOf(members, summary.options.confidence);
  return {rate.value ? PercentWithInterval(rate) : "no verdict", rate.value ? kBlue : kGrey};
}

/// In pixels, of a sans-serif face at 11 px: wide enough for digits and capitals.
int WidthOf(const std::string& text) {
  int characters = 0;
  for (std::string_view rest = text; !rest.empty(); rest.remove_prefix(std::max<std::size_t>(1, Utf8Length(rest))))
    ++characters;
  return 7 * characters + 12;
}

}  // namespace

std::string BadgeSvg(const RunSummary& summary, const std::vector<ShownGate>& gates) {
  const Badge badge = gates.empty() ? OfRun(summary) : OfGates(gates);
  const std::string label = gates.empty() ? "evac" : "evac gate";
  const int left = WidthOf(label), right = WidthOf(badge.text);
  return fmt::format(
      "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{width}\" height=\"20\" viewBox=\"0 0 {width} 20\" "
      "role=\"img\" "
      "aria-label=\"{label}: {text}\">\n<title>{label}: {text}</title>\n"
      "<rect width=\"{left}\" height=\"20\" fill=\"#24292f\"/><rect x=\"{left}\" width=\"{right}\" height=\"20\" "
      "fill=\"{colour}\"/>\n"
      "<g fill=\"#ffffff\" font-family=\"DejaVu Sans,Verdana,sans-serif\" font-size=\"11\" text-anchor=\"middle\">"
      "<text x=\"{middle_left}\" y=\"14\">{label}</text><text x=\"{middle_right}\" "
      "y=\"14\">{text}</text></g>\n</svg>\n",
      fmt::arg("width", left + right), fmt::arg("left", left), fmt::arg("right", right), fmt::arg("label", label),
      fmt::arg("text", XmlText(badge.text)), fmt::arg("colour", badge.colour), fmt::arg("middle_left", left / 2),
      fmt::arg("middle_right", left + right / 2));
}

}  // namespace evac
