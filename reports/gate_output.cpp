#include "reports/gate_output.h"

#include <fmt/format.h>

#include <algorithm>

#include "reports/counted_judges.h"
#include "reports/text_table.h"
#include "reports/wording.h"

namespace evac {
namespace {

constexpr std::size_t kMostShown = 10;

/// Names from a suite could hold line ends; a line of output is one line.
std::string OneLine(std::string text) {
  std::ranges::replace_if(
      text, [](char c) { return static_cast<unsigned char>(c) < 0x20 || c == 0x7F; }, ' ');
  return text;
}

std::string Clip(const std::string& video) { return video.empty() ? "no clip" : OneLine(video); }

std::string ExamplesText(const RuleDecision& rule) {
  const std::size_t shown = std::min(rule.counter_examples.size(), kMostShown);
  if (shown == 0) return "";
  std::vector<std::vector<std::string>> rows{{"   ", "STATE", "SEED", "CANDIDATE FAILED", "BASELINE SUCCEEDED"}};
  for (std::size_t i = 0; i < shown; ++i) {
    const CounterExample& example = rule.counter_examples[i];
    rows.push_back({"   ", OneLine(example.task + " " + example.initial_state), std::to_string(example.seed),
                    Clip(example.candidate_video), Clip(example.baseline_video)});
  }
  const std::int64_t all = std::max(rule.flips_worse, std::ssize(rule.counter_examples));  // a bet is on fewer
  const std::int64_t more = all - static_cast<std::int64_t>(shown);
  return TextTable(rows) + (more > 0 ? fmt::format("     and {} more\n", more) : "");
}

std::string Capital(const char* word) {
  std::string text = word;
  std::ranges::transform(text, text.begin(), [](unsigned char c) { return static_cast<char>(std::toupper(c)); });
  return text;
}

}  // namespace

std::string GateText(const GateDecision& decision) {
  std::string text;
  for (const std::string& size : decision.sizes) text += OneLine(size) + ".\n";
  if (!text.empty()) text += "\n";
  for (const RuleDecision& rule : decision.rules) {
    text += fmt::format("{:12}  {}: {}\n", Capital(Name(rule.outcome)), OneLine(rule.name), OneLine(rule.statement));
    if (!rule.more.empty()) text += "              " + OneLine(rule.more) + "\n";
    text += ExamplesText(rule);
  }
  return text +
         fmt::format("\nGate {}: {}.{} Data {:.12}, rules {:.12}{}.\n", OneLine(decision.name), Name(decision.outcome),
                     decision.judge.empty() ? "" : " Judge " + OneLine(JudgeWords(decision.judge)) + ".",
                     decision.data_hash, decision.rules_hash,
                     decision.baseline_hash.empty() ? "" : fmt::format(", baseline {:.12}", decision.baseline_hash));
}

}  // namespace evac
