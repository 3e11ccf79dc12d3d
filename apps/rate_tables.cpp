#include "apps/rate_tables.h"

#include <fmt/format.h>

#include <algorithm>
#include <map>
#include <nlohmann/json.hpp>
#include <optional>
#include <set>

#include "core/error.h"
#include "core/hash.h"
#include "core/secret.h"
#include "reports/csv.h"

namespace evac {
namespace {

using Json = nlohmann::ordered_json;

/// Columns that are texts even where a cell looks like a number.
bool IsText(const std::string& column) {
  static const std::set<std::string> texts = {
      "showing",  "repeat_of", "presentation", "client_uuid",   "label",       "flags",      "cause", "note",
      "viewport", "ua_hash",   "rubric_hash",  "video_sha256",  "app_version", "rater_role", "study", "rater_status",
      "run",      "episode",   "task",         "initial_state", "policy",      "checkpoint", "world", "reference"};
  return texts.contains(column);
}

std::string LabelOf(std::string_view cell) {
  static const std::map<std::string, std::string, std::less<>> names = {
      {"success", "success"},         {"S", "success"},     {"s", "success"},    {"1", "success"},
      {"failure", "failure"},         {"F", "failure"},     {"f", "failure"},    {"0", "failure"},
      {"cannot_tell", "cannot_tell"}, {"U", "cannot_tell"}, {"u", "cannot_tell"}};
  const auto found = names.find(cell);
  return found == names.end() ? "" : found->second;
}

/// Reads a sheet row by row and keeps what is wrong with it.
class Sheet {
 public:
  Sheet(const std::string& file, const std::vector<StudyClip>& clips) : file_(file) {
    for (const StudyClip& clip : clips) by_episode_[clip.episode].push_back(&clip);
  }

  void ReadHeader(const CsvRow& row) {
    for (std::size_t i = 0; i < row.cells.size(); ++i) column_[std::string(Trimmed(row.cells[i]))] = i;
    for (const char* name : {"episode", "rater", "label"}) {
      if (!column_.contains(name))
        throw InvalidInput("{}:{}: there is no column '{}', wanted episode, rater, label", file_, row.line, name);
    }
  }

  void ReadRow(const CsvRow& row) {
    ImportedVerdict verdict;
    verdict.line = row.line;
    const std::string problem = Fill(row, verdict);
    if (!problem.empty())
      problems_.push_back(fmt::format("{}:{}: {}", file_, row.line, problem));
    else
      verdicts_.push_back(std::move(verdict));
  }

  std::vector<ImportedVerdict> Done() const {
    if (problems_.empty()) return verdicts_;
    constexpr std::size_t kMost = 20;
    std::string text;
    for (std::size_t i = 0; i < std::min(kMost, problems_.size()); ++i) text += (i ? "\n" : "") + problems_[i];
    if (problems_.size() > kMost) text += fmt::format("\n… and {} more", problems_.size() - kMost);
    throw InvalidInput("{}", text);
  }

 private:
  std::string_view Cell(const CsvRow& row, const std::string& name) const {
    const auto found = column_.find(name);
    return found == column_.end() || found->second >= row.cells.size() ? "" : Trimmed(row.cells[found->second]);
  }

  /// Whether the cell names the clip's run, as somebody wrote it who need not know how the study calls it.
  bool IsOf(const StudyClip& clip, const std::string& run) {
    return clip.run == run || Form(clip.run) == Form(run);
  }
  const std::string& Form(const std::string& run) {
    const auto [form, is_new] = forms_.try_emplace(run);
    if (is_new) form->second = OneFormOf(run).string();
    return form->second;
  }

  /// @returns what is wrong, or "".
  std::string Fill(const CsvRow& row, ImportedVerdict& verdict) {
    const std::string episode(Cell(row, "episode")), run(Cell(row, "run"));
    const auto found = by_episode_.find(episode);
    if (found == by_episode_.end()) return fmt::format("episode: {} is not in the study", Quoted(episode));
    std::vector<const StudyClip*> clips = found->second;
    if (!run.empty()) std::erase_if(clips, [&](const StudyClip* clip) { return !IsOf(*clip, run); });
    if (clips.empty()) return fmt::format("run: {} has no clip {}", Quoted(run), Quoted(episode));
    if (clips.size() > 1)
      return fmt::format("episode: {} is in {} runs of the study, wanted a column run", Quoted(episode), clips.size());
    verdict.clip = clips[0]->id;
    verdict.rater = Cell(row, "rater");
    if (verdict.rater.empty() || verdict.rater.size() > 80) return "rater: wanted a name of 1 to 80 bytes";
    verdict.label = LabelOf(Cell(row, "label"));
    if (verdict.label.empty())
      return fmt::format("label: found {}, wanted success, failure or cannot_tell", Quoted(Cell(row, "label")));
    verdict.note = Cell(row, "note");
    const auto [first, is_new] = first_line_.try_emplace({verdict.rater, verdict.clip}, row.line);
    if (!is_new) return fmt::format("{} rated this clip in line {} already", Quoted(verdict.rater), first->second);
    return "";
  }

  const std::string& file_;
  std::map<std::string, std::vector<const StudyClip*>> by_episode_;
  std::map<std::string, std::size_t> column_;
  std::map<std::string, std::string> forms_;  ///< OneFormOf runs
  std::map<std::pair<std::string, std::int64_t>, int> first_line_;
  std::vector<ImportedVerdict> verdicts_;
  std::vector<std::string> problems_;
};

/// Where an imported rater's verdicts hang: one presentation per clip, made when it is needed.
class Importer {
 public:
  Importer(StudyStore& store, std::int64_t now_ms, const std::string& app_version)
      : store_(store), now_ms_(now_ms), app_version_(app_version) {}

  /// @returns whether it is new.
  bool Add(const ImportedVerdict& given, const std::string& file) {
    const StudyRater rater = store_.ImportedRater(given.rater, now_ms_);
    int next = 0;
    for (const Presentation& p : store_.PresentationsOf(rater.id)) {
      next = p.order_index + 1;
      if (p.clip != given.clip) continue;
      const auto stored = store_.CurrentVerdict(p.id);
      if (stored && stored->label == given.label) return false;
      throw InvalidInput("{}:{}: {} said {} of this clip before, found {}", file, given.line, given.rater,
                         stored ? stored->label : "nothing", given.label);
    }
    Presentation p;
    p.id = NewSecret();
    p.rater = rater.id;
    p.clip = given.clip;
    p.order_index = next;
    p.showing = Showing::kImport;
    p.state = "answered";
    store_.AddPresentations({&p, 1});
    HumanVerdict verdict;
    verdict.client_uuid = "import-" + NewSecret();
    verdict.presentation = p.id;
    verdict.label = given.label;
    verdict.note = given.note;
    verdict.created_ms = now_ms_;
    verdict.app_version = app_version_;
    store_.AddVerdict(std::move(verdict));
    return true;
  }

 private:
  StudyStore& store_;
  std::int64_t now_ms_;
  const std::string& app_version_;
};

}  // namespace

std::string RatingCsv(const StudyTable& table) {
  std::string text = CsvLine(table.columns);
  for (const auto& row : table.rows) text += CsvLine(row);
  return text;
}

std::string RatingJsonLines(const StudyTable& table) {
  std::string text;
  for (const auto& row : table.rows) {
    Json json = Json::object();
    for (std::size_t i = 0; i < row.size(); ++i) {
      const std::string& column = table.columns[i];
      const bool is_text = IsText(column);
      if (row[i].empty())
        json[column] = is_text ? Json("") : Json(nullptr);
      else
        json[column] = is_text ? Json(row[i]) : Json::parse(row[i], nullptr, false);
    }
    text += json.dump(-1, ' ', false, Json::error_handler_t::replace) + "\n";
  }
  return text;
}

std::vector<ImportedVerdict> ReadRatingCsv(std::string_view text, const std::string& file,
                                           const std::vector<StudyClip>& clips) {
  CsvReader reader(text, file);
  Sheet sheet(file, clips);
  const std::optional<CsvRow> header = reader.Next();
  if (!header) throw InvalidInput("{}: is empty, wanted columns episode, rater, label", file);
  sheet.ReadHeader(*header);
  while (const std::optional<CsvRow> row = reader.Next()) sheet.ReadRow(*row);
  return sheet.Done();
}

std::int64_t UncountedIn(const std::vector<ImportedVerdict>& verdicts, const std::vector<StudyClip>& clips) {
  std::set<std::int64_t> uncounted;
  for (const StudyClip& clip : clips) {
    if (clip.use == Showing::kExample || clip.use == Showing::kPractice) uncounted.insert(clip.id);
  }
  return std::ranges::count_if(verdicts, [&](const ImportedVerdict& one) { return uncounted.contains(one.clip); });
}

int ImportVerdicts(StudyStore& store, const std::vector<ImportedVerdict>& verdicts, const std::string& file,
                   std::int64_t now_ms, const std::string& app_version) {
  store.Begin();
  int added = 0;
  try {
    Importer importer(store, now_ms, app_version);
    for (const ImportedVerdict& verdict : verdicts) added += importer.Add(verdict, file) ? 1 : 0;
  } catch (...) {
    store.Rollback();
    throw;
  }
  store.Commit();
  return added;
}

}  // namespace evac
