#include "judges/judge_calibration.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <set>
#include <string_view>

#include "core/statistics/rates.h"
#include "judges/vlm_judge.h"

namespace evac {
namespace {

using Verdicts = std::map<std::string, Verdict>;  // of one episode, by judge

bool IsDecided(Label label) { return label == Label::kSuccess || label == Label::kFailure; }

JudgeQualityRow RowOf(const std::vector<JudgedItem>& items, const std::string& kind, const std::string& name,
                      std::string JudgedItem::*field) {
  return QualityOn(items, kind + " " + name, [&](const JudgedItem& item) { return item.*field == name; });
}

std::vector<JudgeQualityRow> RowsBy(const std::vector<JudgedItem>& items, const std::string& kind,
                                    std::string JudgedItem::*field) {
  std::set<std::string> names;
  for (const JudgedItem& item : items) names.insert(item.*field);
  std::vector<JudgeQualityRow> rows;
  for (const std::string& name : names) rows.push_back(RowOf(items, kind, name, field));
  return rows;
}

std::int64_t StatesOf(const std::vector<JudgedItem>& items) {
  std::set<StateKey> states;
  for (const JudgedItem& item : items) {
    if (IsDecided(item.judge) && IsDecided(item.truth)) states.insert({item.task, item.initial_state});
  }
  return std::ssize(states);
}

std::int64_t TrueSuccesses(const Confusion& confusion) {
  return confusion.both_success + confusion.only_human_success;
}

/// Of a domain where all ends alike, either sensitivity or specificity is not known: who only tells the domains apart
/// would not be found out.
std::vector<std::string> OneSidedDomains(const JudgeQualityRow& real, const JudgeQualityRow& other) {
  std::vector<std::string> sentences;
  if (real.confusion.total() == 0 || other.confusion.total() == 0) return sentences;
  for (const JudgeQualityRow* row : {&real, &other}) {
    const std::int64_t all = row->confusion.total(), successes = TrueSuccesses(row->confusion);
    if (successes > 0 && successes < all) continue;
    sentences.push_back(fmt::format("{}: no {} among {}, wanted both outcomes in each kind of clips", row->group,
                                    successes == 0 ? "success" : "failure", all));
  }
  return sentences;
}

JudgeQualityRow OnRealClips(const std::vector<JudgedItem>& items) {
  return QualityOn(items, "real clips", [](const JudgedItem& item) { return item.is_real; });
}

JudgeQualityRow OnOtherClips(const std::vector<JudgedItem>& items) {
  return QualityOn(items, "other clips", [](const JudgedItem& item) { return !item.is_real; });
}

/// How many successes and failures a judge told, whatever the truth knows of them.
struct Told {
  std::map<std::string, std::int64_t> by_task, by_world;
};

Told ToldBy(const std::string& judge, const Store& store) {
  Told told;
  const std::map<std::string, Verdicts> current = store.CurrentVerdicts();
  for (const Episode& episode : store.Episodes()) {
    const auto verdicts = current.find(episode.key.Id());
    if (verdicts == current.end()) continue;
    const auto own = verdicts->second.find(judge);
    if (own == verdicts->second.end() || !IsDecided(own->second.label)) continue;
    ++told.by_task[episode.key.pair.task];
    ++told.by_world[episode.key.world];
  }
  return told;
}

/// Every task that a gate may count it on: those of the items, and those of which no episode is one.
std::set<std::string> TasksOf(const std::vector<JudgedItem>& items, const Told& told) {
  std::set<std::string> tasks;
  for (const JudgedItem& item : items) tasks.insert(item.task);
  for (const auto& [task, count] : told.by_task) tasks.insert(task);
  return tasks;
}

/// What is missing before a judge can be accepted or refused on each task.
std::vector<std::string> Missing(const std::vector<JudgedItem>& items, const Told& told,
                                 const JudgeAcceptance& wanted) {
  std::vector<std::string> missing;
  if (items.empty()) missing.push_back("no episode has a verdict of both");
  for (const std::string& task : TasksOf(items, told)) {
    const JudgeQualityRow row = RowOf(items, "task", task, &JudgedItem::task);
    const std::int64_t successes = TrueSuccesses(row.confusion);
    const std::int64_t failures = row.confusion.total() - successes;
    if (row.confusion.total() < wanted.min_items_per_task || std::min(successes, failures) < wanted.min_per_class)
      missing.push_back(fmt::format("{}: {} successes and {} failures, wanted {} items with {} of each", row.group,
                                    successes, failures, wanted.min_items_per_task, wanted.min_per_class));
  }
  const Estimate kappa = QualityOn(items, "all", [](const JudgedItem&) { return true; }).statistics.kappa;
  const std::int64_t states = StatesOf(items);
  if (kappa.value && !kappa.interval && *kappa.value < 1) {
    missing.push_back(fmt::format("how far kappa can be believed: {}", kappa.interval.reason()));
  } else if (kappa.value && !kappa.interval && states < wanted.min_unerring_states) {  // no spread to see
    missing.push_back(
        fmt::format("how far kappa can be believed: never wrong, but in {} initial state{} only, wanted {}", states,
                    states == 1 ? "" : "s", wanted.min_unerring_states));
  }
  for (std::string& sentence : OneSidedDomains(OnRealClips(items), OnOtherClips(items)))
    missing.push_back(std::move(sentence));
  return missing;
}

/// Worlds where a gate would count what the judge told, and nobody knows how far it is right.
std::vector<std::string> Unmeasured(const Told& told, const std::vector<JudgedItem>& items) {
  std::vector<std::string> sentences;
  for (const auto& [world, count] : told.by_world) {
    const bool is_measured = std::ranges::any_of(items, [&](const JudgedItem& item) {
      return item.world == world && IsDecided(item.judge) && IsDecided(item.truth);
    });
    if (!is_measured)
      sentences.push_back(fmt::format("world {}: the truth tells success or failure of none of the {} episodes where "
                                      "the judge does",
                                      world, count));
  }
  return sentences;
}

void RefuseUnless(bool holds, const std::string& sentence, std::vector<std::string>& refusals) {
  if (!holds) refusals.push_back(sentence);
}

double DifferenceOf(const Number& a, const Number& b) { return a && b ? std::abs(*a - *b) : 0; }

std::vector<std::string> Refusals(const std::vector<JudgedItem>& items, const JudgeAcceptance& wanted) {
  std::vector<std::string> refusals;
  const auto everything = QualityOn(items, "all", [](const JudgedItem&) { return true; });
  const JudgeQualityRow real = OnRealClips(items), other = OnOtherClips(items);
  const Estimate& kappa = everything.statistics.kappa;
  RefuseUnless(kappa.value && *kappa.value >= wanted.min_kappa,
               fmt::format("kappa is {}, wanted at least {}",
                           kappa.value ? fmt::format("{:.2f}", *kappa.value) : kappa.value.reason(), wanted.min_kappa),
               refusals);
  if (kappa.value && kappa.interval)
    RefuseUnless(kappa.interval->low >= wanted.min_kappa_low,
                 fmt::format("kappa may be as low as {:.2f}, wanted {}", kappa.interval->low, wanted.min_kappa_low),
                 refusals);
  for (const JudgeQualityRow* row : {&real, &other}) {
    const Number& bias = row->statistics.bias;
    if (bias)
      RefuseUnless(std::abs(*bias) <= wanted.max_bias,
                   fmt::format("on {} its success rate is {:+.1f} points off, wanted within {}", row->group,
                               100 * *bias, 100 * wanted.max_bias),
                   refusals);
  }
  for (const auto& [name, number] : {std::pair("sensitivity", &ConfusionStatistics::sensitivity),
                                     std::pair("specificity", &ConfusionStatistics::specificity)}) {
    const double difference = DifferenceOf((real.statistics.*number).value, (other.statistics.*number).value);
    RefuseUnless(difference <= wanted.max_domain_difference,
                 fmt::format("its {} differs by {:.1f} points between real and other clips, wanted at most {}", name,
                             100 * difference, 100 * wanted.max_domain_difference),
                 refusals);
  }
  const double asked = static_cast<double>(everything.errors + everything.cannot_tell + everything.confusion.total());
  RefuseUnless(static_cast<double>(everything.errors) <= wanted.max_errors * asked,
               fmt::format("{} of {} verdicts are errors, wanted at most {} %", everything.errors, asked,
                           100 * wanted.max_errors),
               refusals);
  return refusals;
}

/// As VlmJudge gives it: of "vlm:x:small" it is "vlm:x:flip:small".
std::string NameOfProbe(const std::string& judge, const std::string& probe) {
  const std::string_view small = kVlmSmall;
  if (!judge.ends_with(small)) return judge + ":" + probe;
  return judge.substr(0, judge.size() - small.size()) + ":" + probe + kVlmSmall;
}

/// A probe says the same where its label is the judge's; where either decided nothing, it is not counted.
std::map<std::string, ProbeAgreement> ProbesOf(const Store& store, const std::string& judge) {
  const std::map<std::string, Verdicts> current = store.CurrentVerdicts();
  std::map<std::string, std::map<StateKey, Count>> counts;  // by probe
  for (const Episode& episode : store.Episodes()) {
    const auto verdicts = current.find(episode.key.Id());
    if (verdicts == current.end()) continue;
    const auto own = verdicts->second.find(judge);
    if (own == verdicts->second.end() || !IsDecided(own->second.label)) continue;
    for (const char* probe : {"flip", "retest"}) {
      const auto other = verdicts->second.find(NameOfProbe(judge, probe));
      if (other == verdicts->second.end() || !IsDecided(other->second.label)) continue;
      Count& count = counts[probe][{episode.key.pair.task, episode.key.pair.initial_state}];
      ++count.trials;
      count.successes += other->second.label == own->second.label;
    }
  }
  std::map<std::string, ProbeAgreement> probes;
  for (const auto& [probe, by_state] : counts) {
    std::vector<Count> states;
    for (const auto& [state, count] : by_state) states.push_back(count);
    probes[probe] = {SumOf(states), ClusteredWilsonInterval(states)};
  }
  return probes;
}

std::string Share(const Number& number) { return number ? fmt::format("{:.3f}", *number) : "-"; }

/// One line of the table; every column has its width.
std::string Line(const std::vector<std::string>& cells) {
  constexpr int kWidths[] = {28, 6, 6, 6, 6, 6, 9, 7, 15, 7, 7, 7, 7, 7, 7, 6, 5};
  std::string line = fmt::format("{:<{}}", cells.front(), kWidths[0]);
  for (std::size_t i = 1; i < cells.size(); ++i) line += fmt::format("{:>{}}", cells[i], kWidths[i]);
  return line + "\n";
}

std::string Heading() {
  return Line({"", "", "both", "only", "only", "", "", "", "", "", "sensi-", "speci-", "", "", "", "can't", ""}) +
         Line({"success by", "n", "", "judge", "truth", "none", "accuracy", "kappa", "95 %", "AC1", "tivity", "ficity",
               "bias", "Brier", "ECE", "tell", "err."});
}

std::string LineOf(const JudgeQualityRow& row) {
  const ConfusionStatistics& s = row.statistics;
  const bool has_interval = s.kappa.value && s.kappa.interval;
  return Line({row.group, std::to_string(s.n), std::to_string(row.confusion.both_success),
               std::to_string(row.confusion.only_judge_success), std::to_string(row.confusion.only_human_success),
               std::to_string(row.confusion.both_failure), Share(s.accuracy), Share(s.kappa.value),
               has_interval ? fmt::format("{:.2f} … {:.2f}", s.kappa.interval->low, s.kappa.interval->high) : "-",
               Share(s.gwet_ac1), Share(s.sensitivity.value), Share(s.specificity.value), Share(s.bias),
               Share(row.calibration.brier.value), Share(row.calibration.ece), std::to_string(row.cannot_tell),
               std::to_string(row.errors)});
}

/// What has no column of its own in the table: "sensitivity 0.970 (0.943 … 0.985)".
std::string Intervals(const JudgeQualityRow& row) {
  std::string text;
  for (const auto& [name, estimate] : {std::pair("sensitivity", row.statistics.sensitivity),
                                       {"specificity", row.statistics.specificity},
                                       {"Brier", row.calibration.brier}}) {
    if (!estimate.value) continue;
    text += fmt::format("{}{} {:.3f} ({})", text.empty() ? "" : ", ", name, *estimate.value,
                        estimate.interval
                            ? fmt::format("{:.3f} … {:.3f}", estimate.interval->low, estimate.interval->high)
                            : estimate.interval.reason());
  }
  return text.empty() ? text : fmt::format("{}, over other initial states (95 %): {}\n", row.group, text);
}

}  // namespace

std::vector<JudgedItem> JudgedItems(const Store& store, const std::string& judge, const std::string& truth) {
  std::set<std::string> real_worlds;
  for (const WorldInfo& world : store.Worlds()) {
    if (world.is_real) real_worlds.insert(world.name);
  }
  const auto current = store.CurrentVerdicts();
  std::vector<JudgedItem> items;
  for (const Episode& episode : store.Episodes()) {
    const auto verdicts = current.find(episode.key.Id());
    if (verdicts == current.end() || !verdicts->second.contains(judge) || !verdicts->second.contains(truth)) continue;
    const PairKey& pair = episode.key.pair;
    const Verdict& its = verdicts->second.at(judge);
    items.push_back({pair.task, pair.policy + "@" + pair.checkpoint, episode.key.world,
                     real_worlds.contains(episode.key.world), its.label, verdicts->second.at(truth).label,
                     its.probability, pair.initial_state});
  }
  return items;
}

JudgeQualityRow QualityOn(const std::vector<JudgedItem>& items, const std::string& group,
                          const std::function<bool(const JudgedItem&)>& is_in) {
  JudgeQualityRow row{.group = group};
  StatedByState stated;
  ConfusionByState states;
  for (const JudgedItem& item : items) {
    if (!is_in(item) || !IsDecided(item.truth)) continue;
    row.errors += item.judge == Label::kInvalid;
    row.cannot_tell += item.judge == Label::kCannotTell;
    if (!IsDecided(item.judge)) continue;
    const StateKey state = {item.task, item.initial_state};
    const bool is_success = item.truth == Label::kSuccess;
    states[state].Add(item.judge == Label::kSuccess, is_success);
    if (item.probability) stated[state].push_back({*item.probability, is_success});
  }
  row.confusion = SumOf(states);
  row.statistics = StatisticsByState(states);
  row.calibration = CalibrationByState(stated);
  return row;
}

JudgeCalibrationReport CalibrateJudge(const Store& store, const std::string& judge, const std::string& truth,
                                      const JudgeAcceptance& wanted) {
  const std::vector<JudgedItem> items = JudgedItems(store, judge, truth);
  JudgeCalibrationReport report{.judge = judge, .truth = truth};
  report.rows.push_back(QualityOn(items, "all", [](const JudgedItem&) { return true; }));
  for (const auto& [kind, field] : {std::pair("task", &JudgedItem::task), std::pair("world", &JudgedItem::world),
                                    std::pair("policy", &JudgedItem::policy)}) {
    for (JudgeQualityRow& row : RowsBy(items, kind, field)) report.rows.push_back(std::move(row));
  }
  const Told told = ToldBy(judge, store);
  report.missing = Missing(items, told, wanted);
  for (std::string& sentence : Unmeasured(told, items)) report.missing.push_back(std::move(sentence));
  report.refusals = Refusals(items, wanted);
  report.probes = ProbesOf(store, judge);
  return report;
}

std::string Text(const JudgeCalibrationReport& report) {
  std::string text = fmt::format("{} against {}\n", report.judge, report.truth) + Heading();
  for (const JudgeQualityRow& row : report.rows) text += LineOf(row);
  for (const JudgeQualityRow& row : report.rows) {
    if (row.group == "all" || row.group.starts_with("world ")) text += Intervals(row);
  }
  for (const auto& [probe, said] : report.probes) {
    const Interval& interval = *said.share.interval;
    text += fmt::format("{} probe: the same verdict for {} of {} ({:.0f} %, over other initial states {:.0f} … {:.0f})\n", probe,
                        said.same.successes, said.same.trials, 100 * *said.share.value, 100 * interval.low,
                        100 * interval.high);
  }
  for (const std::string& sentence : report.missing) text += "too few: " + sentence + "\n";
  for (const std::string& sentence : report.refusals) text += "not good enough: " + sentence + "\n";
  if (report.missing.empty() && report.refusals.empty()) text += "a gate may count this judge\n";
  return text;
}

}  // namespace evac
