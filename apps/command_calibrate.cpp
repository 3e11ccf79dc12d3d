#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <memory>
#include <nlohmann/json.hpp>

#include "apps/commands.h"
#include "judges/judge_calibration.h"
#include "reports/counted_judges.h"

namespace evac {
namespace {

using nlohmann::json;

struct CalibrateArguments {
  std::string run, judge, against = "oracle";
  bool as_json = false;
};

/// A number, or null.
json Json(const Number& number) { return number ? json(*number) : json(nullptr); }

/// The value and the ends of its interval; null where there is none, and the reason beside it.
json Json(const Estimate& estimate) {
  json result = {{"value", Json(estimate.value)}, {"low", nullptr}, {"high", nullptr}};
  if (estimate.value && estimate.interval) {
    result["low"] = estimate.interval->low;
    result["high"] = estimate.interval->high;
  } else {
    result["reason"] = estimate.value ? estimate.interval.reason() : estimate.value.reason();
  }
  return result;
}

json Json(const JudgeQualityRow& row) {
  const ConfusionStatistics& s = row.statistics;
  return {{"group", row.group},
          {"n", s.n},
          {"both_success", row.confusion.both_success},
          {"only_judge_success", row.confusion.only_judge_success},
          {"only_truth_success", row.confusion.only_human_success},
          {"both_failure", row.confusion.both_failure},
          {"cannot_tell", row.cannot_tell},
          {"errors", row.errors},
          {"accuracy", Json(s.accuracy)},
          {"kappa", Json(s.kappa)},
          {"ac1", Json(s.gwet_ac1)},
          {"sensitivity", Json(s.sensitivity)},
          {"specificity", Json(s.specificity)},
          {"bias", Json(s.bias)},
          {"brier", Json(row.calibration.brier)},
          {"ece", Json(row.calibration.ece)}};
}

json Json(const JudgeCalibrationReport& report) {
  json rows = json::array(), probes = json::object();
  for (const JudgeQualityRow& row : report.rows) rows.push_back(Json(row));
  for (const auto& [probe, said] : report.probes)
    probes[probe] = {{"same", said.same.successes}, {"of", said.same.trials}, {"share", Json(said.share)}};
  return {{"judge", report.judge},
          {"truth", report.truth},
          {"rows", rows},
          {"probes", probes},
          {"missing", report.missing},
          {"refusals", report.refusals},
          {"accepted", report.missing.empty() && report.refusals.empty()}};
}

/// A name that nobody has is a slip, and too few episodes would say of it what more episodes cannot change.
void DemandTwoJudges(const CalibrateArguments& arguments, const Store& store) {
  if (arguments.judge == arguments.against)
    throw InvalidInput("--judge: found '{}' against itself, wanted another than --against", arguments.judge);
  const std::vector<std::string> judges = store.Judges();
  for (const auto& [option, name] : {std::pair("--judge", arguments.judge), {"--against", arguments.against}}) {
    if (std::ranges::find(judges, name) == judges.end())
      throw InvalidInput("{}: found '{}', wanted one who has judged {}: {}", option, name, arguments.run,
                         judges.empty() ? "nobody has yet" : fmt::format("{}", fmt::join(judges, ", ")));
  }
}

ExitCode Calibrate(CalibrateArguments arguments) {
  const Store store = Store::Open(arguments.run, Store::Mode::kReadOnly);
  arguments.judge = FullJudgeNames(arguments.judge, store.Judges());
  arguments.against = FullJudgeNames(arguments.against, store.Judges());
  DemandTwoJudges(arguments, store);
  const JudgeCalibrationReport report = CalibrateJudge(store, arguments.judge, arguments.against);
  if (arguments.as_json)
    fmt::print("{}\n", Json(report).dump(2, ' ', false, json::error_handler_t::replace));
  else
    fmt::print("{}", Text(report));
  if (!report.missing.empty()) return ExitCode::kInconclusive;
  return report.refusals.empty() ? ExitCode::kOk : ExitCode::kNo;
}

}  // namespace

void AddCalibrate(CLI::App& judge, ExitCode& exit_code) {
  auto arguments = std::make_shared<CalibrateArguments>();
  CLI::App* command = judge.add_subcommand("calibrate", "Say how far a judge may be trusted: it against the truth");
  command->add_option("run", arguments->run, "the run's folder")->required();
  command
      ->add_option("--judge", arguments->judge,
                   "whose verdicts are looked at: the name that `evac ls --json` shows; classifier, where only one is")
      ->required();
  command->add_option("--against", arguments->against, "whose verdicts are the truth: oracle, or human")
      ->capture_default_str();
  command->add_flag("--json", arguments->as_json, "for other programs");
  command->footer(
      "Exit code 0: a gate may count it; 1: it is not good enough; 2: one of the two has judged nothing; 3: too few "
      "episodes to say, or none of a world that it judged.\n"
      "Example:\n  evac judge calibrate out/demo --judge vlm:qwen3-vl-1a2b3c4d");
  command->callback([arguments, &exit_code] { exit_code = Calibrate(*arguments); });
}

}  // namespace evac
