#include "reports/real_trials_csv.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <map>
#include <optional>
#include <tuple>

#include "core/error.h"
#include "reports/csv.h"

namespace evac {
namespace {

constexpr std::size_t kMaxErrors = 20;
enum Column { kTask, kState, kPolicy, kCheckpoint, kOutcome, kTrial, kVideo, kColumns };
constexpr std::array<const char*, kColumns> kNames = {"task",    "initial_state", "policy", "checkpoint",
                                                      "outcome", "trial",         "video"};
constexpr int kRequired = kTrial;  // the columns before this one

/// Gathers what is wrong, to be thrown at once.
class Complaints {
 public:
  explicit Complaints(std::string what_happens) : what_happens_(std::move(what_happens)) {}
  void Add(std::string complaint) { complaints_.push_back(std::move(complaint)); }
  void ThrowIfAny() const {
    if (complaints_.empty()) return;
    std::string text;
    for (std::size_t i = 0; i < std::min(complaints_.size(), kMaxErrors); ++i) text += complaints_[i] + "\n";
    if (complaints_.size() > kMaxErrors) text += fmt::format("and {} more\n", complaints_.size() - kMaxErrors);
    throw InvalidInput("{}{}", text, what_happens_);
  }

 private:
  std::string what_happens_;
  std::vector<std::string> complaints_;
};

using Places = std::array<std::optional<std::size_t>, kColumns>;

Places PlacesOf(const CsvRow& header, const std::string& file, std::vector<std::string>& warnings) {
  Places places;
  for (std::size_t i = 0; i < header.cells.size(); ++i) {
    const auto name = std::ranges::find(kNames, Trimmed(header.cells[i]));
    if (name == kNames.end()) {
      warnings.push_back(fmt::format("{}:{}: column {} is not read", file, header.line, Quoted(header.cells[i])));
      continue;
    }
    std::optional<std::size_t>& place = places[static_cast<std::size_t>(name - kNames.begin())];
    if (place) throw InvalidInput("{}:{}: column {}: found it twice, wanted it once", file, header.line, *name);
    place = i;
  }
  for (int column = 0; column < kRequired; ++column) {
    if (places[static_cast<std::size_t>(column)]) continue;
    throw InvalidInput("{}:{}: column {}: found it not in the header, wanted {}", file, header.line,
                       kNames[static_cast<std::size_t>(column)],
                       fmt::join(kNames.begin(), kNames.begin() + kRequired, ","));
  }
  return places;
}

std::optional<Label> OutcomeFrom(std::string_view cell) {
  if (cell == "1") return Label::kSuccess;
  if (cell == "0") return Label::kFailure;
  for (const Label label : {Label::kSuccess, Label::kFailure, Label::kCannotTell, Label::kInvalid}) {
    if (cell == Name(label)) return label;
  }
  return std::nullopt;
}

std::optional<std::int64_t> WholeNumber(std::string_view cell) {
  std::int64_t number = 0;
  const auto [end, error] = std::from_chars(cell.data(), cell.data() + cell.size(), number);
  if (error != std::errc() || end != cell.data() + cell.size() || number < 0) return std::nullopt;
  return number;
}

using Key = std::tuple<std::string, std::string, std::string, std::string>;
Key KeyOf(const RealTrial& trial) { return {trial.task, trial.initial_state, trial.policy, trial.checkpoint}; }

/// "/lab/monday/trials.csv" of "/lab/monday/trials.csv:12".
std::string FileOf(const RealTrial& trial) { return trial.source.substr(0, trial.source.rfind(':')); }

/// Of what an earlier evac imported the file's own name alone is known.
bool AreOfOneFile(const RealTrial& trial, const RealTrial& stored) {
  const std::string file = FileOf(trial), before = FileOf(stored);
  if (before.find('/') != std::string::npos) return file == before;
  return file.substr(file.rfind('/') + 1) == before;
}

/// Turns rows into trials, complaining of each that is none.
class Reader {
 public:
  Reader(const Places& places, const std::string& file, const KnownNames& known)
      : places_(places), file_(file), known_(known) {}

  void Read(const CsvRow& row) {
    row_ = &row;
    is_good_ = true;
    RealTrial trial;
    trial.task = Cell(kTask);
    trial.initial_state = Cell(kState);
    trial.policy = Cell(kPolicy);
    trial.checkpoint = Cell(kCheckpoint);
    trial.video = Cell(kVideo);
    trial.source = fmt::format("{}:{}", file_, row.line);
    CheckNames(trial);
    const std::optional<Label> outcome = OutcomeFrom(Cell(kOutcome));
    if (!outcome) Complain(kOutcome, "success, failure, cannot_tell, invalid, 1 or 0");
    trial.outcome = outcome.value_or(Label::kInvalid);
    trial.trial = Number(trial);
    if (!is_good_) return;
    if (Cell(kTrial).empty()) result_.counted.insert(result_.trials.size());
    result_.trials.push_back(std::move(trial));
  }
  void ComplainOfLength(const CsvRow& row, std::size_t wanted) {
    complaints_.Add(
        fmt::format("{}:{}: found {} cells, wanted {}, as in the header", file_, row.line, row.cells.size(), wanted));
  }
  RealTrialsCsv Result() {
    complaints_.ThrowIfAny();
    return std::move(result_);
  }

 private:
  std::string Cell(Column column) const {
    const std::optional<std::size_t>& place = places_[column];
    return place ? std::string(Trimmed(row_->cells[*place])) : "";
  }

  void Complain(Column column, const std::string& wanted) {
    complaints_.Add(fmt::format("{}:{}: column {}: found {}, wanted {}", file_, row_->line, kNames[column],
                                Quoted(Cell(column)), wanted));
    is_good_ = false;
  }

  void CheckNames(const RealTrial& trial) {
    if (!known_.tasks.contains(trial.task)) {
      return Complain(kTask, fmt::format("a task of the run: {}", fmt::join(known_.tasks, ", ")));
    }
    if (trial.initial_state.empty() ||
        (!known_.new_states_too && !known_.states.contains({trial.task, trial.initial_state}))) {
      Complain(kState, "an initial state that the run has episodes of (or --new-states)");
    }
    if (!known_.policies.contains({trial.policy, trial.checkpoint})) ComplainOfPolicy(trial);
  }

  void ComplainOfPolicy(const RealTrial& trial) {
    std::vector<std::string> names, checkpoints;
    for (const auto& [name, checkpoint] : known_.policies) {
      names.push_back(name + "," + checkpoint);
      if (name == trial.policy) checkpoints.push_back(checkpoint);
    }
    if (!checkpoints.empty())
      return Complain(kCheckpoint, fmt::format("a checkpoint of {}: {}", trial.policy, fmt::join(checkpoints, ", ")));
    Complain(kPolicy, fmt::format("a policy and checkpoint of the run: {}", fmt::join(names, "; ")));
  }

  /// The cell, or the next number of the key; a number that the file gave before is refused.
  std::int64_t Number(const RealTrial& trial) {
    std::set<std::int64_t>& taken = taken_[KeyOf(trial)];
    std::int64_t number = 1;
    while (taken.contains(number)) ++number;
    if (!Cell(kTrial).empty()) {
      const std::optional<std::int64_t> given = WholeNumber(Cell(kTrial));
      if (!given) Complain(kTrial, "a whole number");
      if (given && taken.contains(*given)) Complain(kTrial, "another number: this trial is in the file already");
      number = given.value_or(number);
    }
    taken.insert(number);
    return number;
  }

  const Places& places_;
  const std::string& file_;
  const KnownNames& known_;
  const CsvRow* row_ = nullptr;
  bool is_good_ = true;
  std::map<Key, std::set<std::int64_t>> taken_;
  Complaints complaints_{"nothing was imported"};
  RealTrialsCsv result_;
};

}  // namespace

RealTrialsCsv ReadRealTrialsCsv(std::string_view text, const std::string& file, const KnownNames& known) {
  CsvReader csv(text, file);
  const std::optional<CsvRow> header = csv.Next();
  if (!header) throw InvalidInput("{}:1: found an empty file, wanted a header: {}", file, fmt::join(kNames, ","));
  std::vector<std::string> warnings;
  const Places places = PlacesOf(*header, file, warnings);
  Reader reader(places, file, known);
  bool has_rows = false;
  while (const std::optional<CsvRow> row = csv.Next()) {
    has_rows = true;
    if (row->cells.size() == header->cells.size()) {
      reader.Read(*row);
    } else {
      reader.ComplainOfLength(*row, header->cells.size());
    }
  }
  if (!has_rows)
    throw InvalidInput("{}:{}: found no row after the header, wanted at least one trial", file, header->line);
  RealTrialsCsv result = reader.Result();
  result.warnings = std::move(warnings);
  return result;
}

std::vector<RealTrial> NewTrials(const std::vector<RealTrial>& trials, const std::vector<RealTrial>& stored,
                                 const std::set<std::size_t>& counted) {
  std::map<std::pair<Key, std::int64_t>, const RealTrial*> known;
  for (const RealTrial& trial : stored) known[{KeyOf(trial), trial.trial}] = &trial;
  Complaints complaints("nothing was imported; repeats of one initial state are told apart by a column 'trial'");
  std::vector<RealTrial> added;
  for (std::size_t place = 0; place < trials.size(); ++place) {
    const RealTrial& trial = trials[place];
    const auto there = known.find({KeyOf(trial), trial.trial});
    if (there == known.end()) {
      added.push_back(trial);
    } else if (there->second->outcome != trial.outcome) {
      complaints.Add(fmt::format("{}: found {}, but trial {} of {} by {} in {} was imported as {} (from {})",
                                 trial.source, Name(trial.outcome), trial.trial, trial.task,
                                 trial.policy + "@" + trial.checkpoint, trial.initial_state,
                                 Name(there->second->outcome), there->second->source));
    } else if (counted.contains(place) && !AreOfOneFile(trial, *there->second)) {
      complaints.Add(fmt::format("{}: found no number of the trial, wanted one: as trial {} of {} by {} in {} it was "
                                 "imported from {}",
                                 trial.source, trial.trial, trial.task, trial.policy + "@" + trial.checkpoint,
                                 trial.initial_state, there->second->source));
    }
  }
  complaints.ThrowIfAny();
  return added;
}

}  // namespace evac
