#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <set>

#include "apps/commands.h"
#include "core/file.h"
#include "core/weight_file.h"
#include "judges/judge_balance.h"
#include "judges/judge_card.h"

namespace evac {
namespace {

struct BalanceArguments {
  std::string run, weights, out, world, truth = "oracle";
  std::int64_t least = 60;  ///< of each outcome
};

std::string Share(std::int64_t part, std::int64_t whole) {
  return fmt::format("{:>5} of {:<5} {:.3f}", part, whole, static_cast<double>(part) / static_cast<double>(whole));
}

std::string Row(const std::vector<PairedClip>& clips, double threshold, const char* what) {
  const Confusion c = ConfusionAt(clips, threshold);
  return fmt::format("{:>9.3f}  {}   {}   {:>9.3f}  {}\n", threshold, Share(c.only_judge_success, c.only_judge_success + c.both_failure),
                     Share(c.only_human_success, c.only_human_success + c.both_success), *StatisticsOf(c).accuracy, what);
}

/// Thresholds from low to high, the card's and the balanced one among them.
std::string Table(const std::vector<PairedClip>& clips, double card, double balanced) {
  std::string text = fmt::format("{:>9}  {:<20}   {:<20}   {:>9}\n", "threshold", "failures called good", "successes called bad", "agreement");
  std::set<double> thresholds = {card, balanced};
  for (int tenth = 1; tenth <= 9; ++tenth) thresholds.insert(tenth / 10.0);
  for (const double threshold : thresholds)
    text += Row(clips, threshold, threshold == balanced ? "balanced" : threshold == card ? "of the card" : "");
  return text;
}

/// The card with an offset of the logit that makes the balanced probability .5, and the threshold there: so `unsure`
/// is as wide on both sides, wherever the balance was found. What was measured with the threshold before keeps its number,
/// and says so; the clips that chose the new one are none that it may be asked about.
TensorMetadata Balanced(const WeightFile& file, const PairedClips& paired, const Estimate& balance, const std::string& run_hash) {
  TensorMetadata card = file.card();
  std::set<std::string> marks;
  if (card.contains("learned_from")) {
    for (const std::string& mark : file.Names("learned_from")) marks.insert(mark);
  }
  for (const PairedClip& clip : paired.clips) {
    if (!clip.video_sha256.empty()) marks.insert(ClipMark(clip.video_sha256));
  }
  card.try_emplace("threshold_of_kappas", card.at("threshold"));
  const double before = card.contains("offset") ? file.Number("offset") : 0;
  card["offset"] = fmt::format("{:.6g}", before + file.Number("temperature") * std::log(*balance.value / (1 - *balance.value)));
  card["threshold"] = "0.5";
  card["balanced_on"] = fmt::format("{} clips of world {} of run {}", paired.clips.size(), paired.world, run_hash.substr(0, 12));
  if (!marks.empty()) card["learned_from"] = fmt::format("{}", fmt::join(marks, ","));
  return card;
}

void Write(const BalanceArguments& arguments, const TensorMetadata& card) {
  const TensorFile file = TensorFile::Open(arguments.weights);
  if (const auto folder = std::filesystem::path(arguments.out).parent_path(); !folder.empty()) MakeFolders(folder);
  WriteTensorFile(arguments.out, file.tensors(), card);
  fmt::print("{}: {}\n", arguments.out, ClassifierName(arguments.out));
}

/// By a name that nobody has too few pairs would be all that is found, however many more there were.
void DemandTruth(const BalanceArguments& arguments, const Store& store) {
  const std::vector<std::string> judges = store.Judges();
  if (std::ranges::find(judges, arguments.truth) != judges.end()) return;
  throw InvalidInput("--truth: found '{}', wanted one who has judged {}: {}", arguments.truth, arguments.run,
                     judges.empty() ? "nobody has yet" : fmt::format("{}", fmt::join(judges, ", ")));
}

ExitCode Balance(const BalanceArguments& arguments) {
  const WeightFile file(arguments.weights, kClassifierFormat);
  const double before = file.Number("threshold");
  const std::string judge = ClassifierName(arguments.weights);
  const Store store = Store::Open(arguments.run, Store::Mode::kReadOnly);
  DemandTruth(arguments, store);
  const PairedClips paired = PairedClipsOf(store, judge, arguments.truth, arguments.world);
  const auto successes = std::ranges::count(paired.clips, true, &PairedClip::succeeded);
  const auto failures = static_cast<std::int64_t>(paired.clips.size()) - successes;
  fmt::print("{}: {} clips of {} whose pair truly succeeded ({}) or failed ({}) by {}; {} left out\n", judge, paired.clips.size(),
             paired.world, successes, failures, arguments.truth, paired.left_out);
  if (std::min<std::int64_t>(successes, failures) < arguments.least) {
    fmt::print("too few to choose a threshold by: wanted at least {} of each (--least)\n", arguments.least);
    return ExitCode::kInconclusive;
  }
  const Estimate balance = BalanceOf(paired.clips);
  if (!balance.value) {
    fmt::print("no threshold balances them: {}\n", balance.value.reason());
    return ExitCode::kInconclusive;
  }
  fmt::print("{}", Table(paired.clips, before, *balance.value));
  if (balance.interval)
    fmt::print("balanced: {:.3f}, [{:.3f}, {:.3f}] had there been other initial states ({:.0f} %, {})\n", *balance.value, balance.interval->low,
               balance.interval->high, 100 * balance.confidence, balance.method);
  if (!arguments.out.empty()) Write(arguments, Balanced(file, paired, balance, store.run().suite_hash));
  return ExitCode::kOk;
}

}  // namespace

void AddBalance(CLI::App& judge, ExitCode& exit_code) {
  auto arguments = std::make_shared<BalanceArguments>();
  CLI::App* command =
      judge.add_subcommand("balance", "Move a classifier's threshold to where imagined clips mislead it as often one way as the other");
  command->add_option("run", arguments->run, "a run of a real world and an imagined one that it has judged: closed/ of `evac fidelity`")
      ->required();
  command->add_option("--weights", arguments->weights, "of the classifier")->required()->check(CLI::ExistingFile);
  command->add_option("-o,--out", arguments->out, "where the weights with the new threshold go; without it the table is all");
  command->add_option("--world", arguments->world, "whose clips, where it has judged those of several worlds");
  command->add_option("--truth", arguments->truth, "whose verdicts in the real world are the truth")->capture_default_str();
  command->add_option("--least", arguments->least, "true successes and failures that there must be of each")
      ->check(CLI::Range(1, 1000000))
      ->capture_default_str();
  command->footer(
      "Exit code 3: too few pairs to say. The new weights are another judge, and do not judge the clips that chose.\n"
      "Example:\n  evac judge balance out/fidelity/closed --weights judge.safetensors --out balanced.safetensors");
  command->callback([arguments, &exit_code] { exit_code = Balance(*arguments); });
}

}  // namespace evac
