#include "reports/counted_judges.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <sstream>


namespace evac {
namespace {

std::vector<std::string> Names(const std::string& text) {
  std::vector<std::string> names;
  std::istringstream parts(text + ",");
  for (std::string name; std::getline(parts, name, ',');) names.push_back(name);
  return names;
}

/// Whether a judge was asked to learn what its answers are worth: "vlm:x:flip", "vlm:x:flip:small".
bool IsProbe(const std::string& judge) {
  const std::string parts = judge + ":";
  return parts.find(":flip:") != std::string::npos || parts.find(":retest:") != std::string::npos;
}

/// Up to its first colon: "classifier" of "classifier:1a2b".
std::string KindOf(const std::string& judge) { return judge.substr(0, judge.find(':')); }

std::string FullName(const std::string& name, const std::vector<std::string>& there) {
  std::vector<std::string> meant;
  for (const std::string& judge : there) {  // in the order of names: "vlm:x" before "vlm:x:small"
    if (judge == name) return name;
    if (!judge.starts_with(name + ":") || IsProbe(judge)) continue;
    const bool is_of_one = std::ranges::any_of(meant, [&](const auto& other) { return judge.starts_with(other + ":"); });
    if (!is_of_one) meant.push_back(judge);
  }
  if (meant.size() > 1)
    throw InvalidInput("judge '{}': stands for {}, wanted the name of one", name, fmt::join(meant, " and "));
  return meant.empty() ? name : meant.front();
}

}  // namespace

std::string FullJudgeNames(const std::string& wanted, const std::vector<std::string>& there) {
  std::string full;
  for (const std::string& name : Names(wanted)) {
    if (name.empty()) throw InvalidInput("judge '{}': found an empty name, wanted judges with commas between", wanted);
    full += (full.empty() ? "" : ",") + FullName(name, there);
  }
  return full;
}

const Verdict* CountedVerdict(const std::map<std::string, Verdict>& verdicts, const std::string& counted) {
  const Verdict* first = nullptr;
  for (const std::string& name : Names(counted)) {
    const auto own = verdicts.find(name);
    if (own == verdicts.end()) continue;
    const Label label = own->second.label;
    if (label == Label::kSuccess || label == Label::kFailure) return &own->second;
    if (first == nullptr) first = &own->second;
  }
  return first;
}

bool IsCounted(const std::string& judge, const std::string& counted) {
  const std::vector<std::string> names = Names(counted);
  return std::ranges::find(names, judge) != names.end();
}

std::string LastJudge(const std::string& counted) { return Names(counted).back(); }

std::vector<std::string> JudgingCommands(const std::string& judge) {
  const std::string kind = KindOf(judge);
  if (kind == "oracle") return {"evac judge RUN --judge oracle"};
  if (kind == "classifier") return {"evac judge RUN --judge classifier --weights FILE"};
  if (kind == "vlm") return {"evac judge RUN --judge vlm --config PAGE"};
  const std::string as = judge == "human" ? "" : kind == "human" ? " --each-rater" : " --as " + judge;
  return {"evac rate new STUDY --run RUN", "evac rate serve STUDY", "evac rate resolve STUDY" + as};
}

std::string NeverJudged(const std::string& judge) {
  const std::string kind = KindOf(judge);
  const bool is_program = kind == "oracle" || kind == "classifier" || kind == "vlm";
  return is_program ? "" : "a study's examples and practice clips get no label";
}

Error NobodyJudged(const std::string& run, const std::string& wanted) {
  return InvalidInput("{}: judge {}: found no verdicts at all, wanted those that `evac judge` gives", run, wanted);
}

std::string JudgeWords(const std::string& counted) { return fmt::format("{}", fmt::join(Names(counted), ", else ")); }

}  // namespace evac
