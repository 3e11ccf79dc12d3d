#include "reports/policy_comparison_output.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>

#include "reports/estimate_json.h"
#include "reports/text_table.h"
#include "reports/wording.h"

namespace evac {
namespace {

using Json = nlohmann::ordered_json;

/// "+30 points [10, 48]".
std::string Points(const Estimate& difference) {
  if (!difference.value) return "undefined: " + difference.value.reason();
  if (!difference.interval)
    return SignedPoints(*difference.value) + " points (no interval: " + difference.interval.reason() + ")";
  return fmt::format("{} points [{}, {}]", SignedPoints(*difference.value), SignedPoints(difference.interval->low),
                     SignedPoints(difference.interval->high));
}

/// "0.12", "< 0.001".
std::string Shown(const Number& p) {
  if (!p) return "-";
  const std::string text = PValue(*p);
  return text.substr(text.starts_with("p = ") ? 4 : 2);
}

std::string More(const ComparisonRow& row) {
  if (!row.more) return "not decided (" + row.more.reason() + ")";
  return "not decided: about " + (row.is_paired ? Counted(*row.more, "more pair")
                                                : Counted(*row.more, "more episode each", "more episodes each"));
}

std::string Decision(const ComparisonRow& row, const PolicyComparison& comparison) {
  if (row.winner == Winner::kNotDecided) return More(row);
  return (row.winner == Winner::kFirst ? comparison.first : comparison.second) + " is better";
}

std::vector<std::string> Cells(const ComparisonRow& row, const PolicyComparison& comparison) {
  const std::string size = row.is_paired ? fmt::format("{} pairs", row.shared)
                                         : fmt::format("{} / {}", row.first_episodes, row.second_episodes);
  const std::string flips =
      row.is_paired ? fmt::format("{} / {}", row.flips.only_first, row.flips.only_second) : "unpaired";
  return {row.task.empty() ? "all tasks" : row.task,
          size,
          PercentWithInterval(row.first),
          PercentWithInterval(row.second),
          Points(row.difference),
          flips,
          row.test,
          Shown(row.p),
          Shown(row.p_holm),
          Decision(row, comparison)};
}

std::string Apart(const PolicyComparison& comparison) {
  const ComparisonRow& all = comparison.all;
  if (all.first_apart + all.second_apart == 0) return "";
  return fmt::format("In no rate (errors, cannot tell, invalid, not judged): {} of {}, {} of {}.\n", all.first_apart,
                     comparison.first, all.second_apart, comparison.second);
}

std::string LeftOut(const PolicyComparison& comparison) {
  if (comparison.left_out.empty()) return "";
  return fmt::format("Not in all tasks, for want of episodes of both that count: {}.\n",
                     fmt::join(comparison.left_out, ", "));
}

std::string AskAnother(const ComparedWorld& compared) {
  if (compared.other_judges.empty()) return "";
  return fmt::format("Judge {} told no outcome in {}; --judge {} did.\n", compared.judge, compared.world,
                     fmt::join(compared.other_judges, " or "));
}

/// "classifier:abc", "classifier:abc of a@1 and classifier:def of b@1".
std::string Judges(const ComparedWorld& compared) {
  if (compared.second_judge.empty()) return compared.judge;
  return fmt::format("{} of {} and {} of {}", compared.judge, compared.comparison.first, compared.second_judge,
                     compared.comparison.second);
}

const char* Name(Winner winner) {
  switch (winner) {
    case Winner::kFirst:
      return "first";
    case Winner::kSecond:
      return "second";
    case Winner::kNotDecided:
      return "not_decided";
  }
  return "not_decided";
}

std::string BetsText(const ComparedWorld& compared) {
  if (compared.bets.empty()) return "";
  const double alpha = compared.comparison.options.alpha;
  std::vector<std::vector<std::string>> rows{{"SEQUENTIAL", "PAIRS", "FLIPS", "E-VALUE", "LARGEST", "P", "LOOKS", ""}};
  for (const BetState& bet : compared.bets) {
    const bool is_decided = bet.largest >= 1 / alpha;
    rows.push_back({bet.task.empty() ? "all tasks" : bet.task, std::to_string(bet.pairs),
                    fmt::format("{} / {}", bet.flips.only_first, bet.flips.only_second),
                    fmt::format("{:.3g}", bet.e_value), fmt::format("{:.3g}", bet.largest),
                    Shown(Number(1 / bet.largest)), std::to_string(bet.looks),
                    is_decided ? "different" : fmt::format("not decided: decides at {:.3g}", 1 / alpha)});
  }
  return "\n" + TextTable(rows) + "Valid however often one looks; every look is kept in the run.\n";
}

}  // namespace

std::string DecisionOf(const PolicyComparison& comparison) {
  const ComparisonRow& all = comparison.all;
  if (all.first_episodes + all.second_episodes == 0)
    return fmt::format("Nothing to compare {} and {} by: no task has episodes of both that count.", comparison.first,
                       comparison.second);
  const auto rate = [](const Estimate& estimate) {
    return estimate.value ? Percent(*estimate.value) : "undefined: " + estimate.value.reason();
  };
  const std::string how = fmt::format("{} against {}, {}{}, p {} ({}, {})", rate(all.first), rate(all.second),
                                      Points(all.difference), all.stratified_se ? " task by task" : "",
                                      all.p ? PValue(*all.p).substr(2) : "undefined", all.test,
                                      all.is_paired ? Counted(all.shared, "pair")
                                                    : fmt::format("{} and {} episodes, not on the same initial states",
                                                                  all.first_episodes, all.second_episodes));
  switch (all.winner) {
    case Winner::kFirst:
      return fmt::format("{} is better than {}: {}.", comparison.first, comparison.second, how);
    case Winner::kSecond:
      return fmt::format("{} is worse than {}: {}.", comparison.first, comparison.second, how);
    case Winner::kNotDecided:
      return fmt::format(
          "Not decided between {} and {}: {}.{}", comparison.first, comparison.second, how,
          all.more
              ? fmt::format(" If the rates are those seen, about {} would decide with {} power.",
                            all.is_paired ? Counted(*all.more, "more pair")
                                          : Counted(*all.more, "more episode of each", "more episodes of each"),
                            Percent(comparison.options.power))
              : fmt::format(" No number of further episodes can be named: {}.", all.more.reason()));
  }
  return "";
}

std::string ComparisonText(const ComparedWorld& compared) {
  const PolicyComparison& comparison = compared.comparison;
  std::vector<std::vector<std::string>> rows{
      {"TASK", "N", comparison.first, comparison.second, "DIFFERENCE", "FLIPS", "TEST", "P", "HOLM", ""}};
  for (const ComparisonRow& row : comparison.tasks) rows.push_back(Cells(row, comparison));
  if (comparison.tasks.size() > 1) rows.push_back(Cells(comparison.all, comparison));
  return fmt::format("World {}, judge {}. {}\n\n{}{}{}{}{}", compared.world, Judges(compared), DecisionOf(comparison),
                     TextTable(rows), LeftOut(comparison), Apart(comparison), AskAnother(compared),
                     BetsText(compared));
}

nlohmann::ordered_json JsonOf(const ComparisonRow& row) {
  Json json;
  json["task"] = row.task.empty() ? Json(nullptr) : Json(row.task);
  json["paired"] = row.is_paired;
  json["first"] = JsonOf(row.first);
  json["second"] = JsonOf(row.second);
  json["difference"] = JsonOf(row.difference);
  json["episodes"] = {{"first", row.first_episodes}, {"second", row.second_episodes}, {"shared", row.shared}};
  json["apart"] = {{"first", row.first_apart}, {"second", row.second_apart}};
  json["flips"] = {{"only_first", row.flips.only_first}, {"only_second", row.flips.only_second}};
  json["test"] = row.test;
  Put(json, "p", row.p);
  Put(json, "p_holm", row.p_holm);
  json["winner"] = Name(row.winner);
  json["more"] = row.more ? Json(*row.more) : Json(nullptr);
  if (!row.more) json["more_reason"] = row.more.reason();
  return json;
}

nlohmann::ordered_json ComparisonJson(const ComparedWorld& compared) {
  const PolicyComparison& comparison = compared.comparison;
  Json json = {{"world", compared.world},
               {"judge", compared.judge},
               {"second_judge", compared.second_judge.empty() ? compared.judge : compared.second_judge},
               {"other_judges", compared.other_judges},
               {"first", comparison.first},
               {"second", comparison.second},
               {"alpha", comparison.options.alpha},
               {"power", comparison.options.power},
               {"winner", Name(comparison.all.winner)},
               {"statement", DecisionOf(comparison)}};
  json["tasks"] = Json::array();
  for (const ComparisonRow& row : comparison.tasks) json["tasks"].push_back(JsonOf(row));
  json["all_tasks"] = JsonOf(comparison.all);
  json["all_tasks"]["left_out"] = comparison.left_out;
  json["sequential"] = Json::array();
  for (const BetState& bet : compared.bets) {
    json["sequential"].push_back({{"task", bet.task.empty() ? Json(nullptr) : Json(bet.task)},
                                  {"pairs", bet.pairs},
                                  {"only_first", bet.flips.only_first},
                                  {"only_second", bet.flips.only_second},
                                  {"e_value", bet.e_value},
                                  {"largest", bet.largest},
                                  {"p", 1 / bet.largest},
                                  {"looks", bet.looks}});
  }
  return json;
}

}  // namespace evac
