#include "reports/chart_files.h"

#include <fmt/format.h>

#include <algorithm>
#include <set>

#include "reports/charts.h"
#include "reports/counted_judges.h"
#include "reports/wording.h"

namespace evac {
namespace {

std::string Slug(const std::string& text) {
  std::string slug;
  for (const char c : text) {
    const bool is_plain = (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') || c == '-';
    slug += is_plain ? c : '_';
  }
  return slug.substr(0, 80);
}

/// Names that would be the same get a number: "a/b" and "a b" are both "a_b".
class Files {
 public:
  /// @param note  the last line above every chart; may be empty
  explicit Files(const std::string& note = "") : note_(note.empty() ? "" : "\n" + note) {}
  void Add(const std::string& name, const Drawing& drawing, const std::string& title) {
    const std::string slug = Slug(name);
    std::string unique = slug;
    for (int number = 2; !taken_.insert(unique).second; ++number) unique = fmt::format("{}-{}", slug, number);
    files_.push_back({unique, AsSvgFile(drawing, title + note_)});
  }
  std::vector<ChartFile> Take() { return std::move(files_); }

 private:
  std::string note_;
  std::set<std::string> taken_;
  std::vector<ChartFile> files_;
};

/// "● real, ◇ sim": which marker is whose.
std::string Key(const std::vector<std::string>& worlds, const WorldMarks& marks) {
  std::string key;
  for (const std::string& world : worlds)
    key += fmt::format("{}{} {}", key.empty() ? "" : ", ", WorldSign(marks.at(world)), world);
  return key;
}

void AddRates(const RunSummary& summary, const WorldMarks& marks, Files& files) {
  for (const Task& task : summary.data.tasks) {
    RowChart chart;
    chart.words = fmt::format("Success rates on {}, percent.", task.id);
    for (const std::string& policy : summary.policies) {
      bool is_first = true;
      for (const RateCell& cell : summary.rates) {
        if (cell.task != task.id || cell.policy != policy) continue;
        if (is_first) chart.rows.push_back({policy, "", {}, 0, true});
        is_first = false;
        chart.rows.push_back({cell.world, fmt::format("{}, n = {}", PercentWithInterval(cell.rate), cell.rate.n),
                              cell.rate, marks.at(cell.world), false});
      }
    }
    if (!chart.rows.empty()) files.Add("rates-" + task.id, RowsDrawing(chart), "Success rate at " + task.id + ", %");
  }
}

void AddTrust(const ReportData& report, const WorldMarks& marks, Files& files) {
  for (const TrustReport& trust : report.trust) {
    RowChart chart;
    chart.words = fmt::format("Success rate in {} minus the real one, in points.", trust.world);
    chart.low = -0.5;
    chart.high = 0.5;
    chart.ticks = {-0.5, -0.25, 0, 0.25, 0.5};
    chart.zone = trust.options.margin;
    for (const TaskTrust& task : trust.tasks) {
      chart.rows.push_back({fmt::format("{}: {}", task.task, Name(task.trust)),
                            fmt::format("{}, n = {}", PointsWithInterval(task.bias), task.pairs.n()), task.bias,
                            marks.at(trust.world), false});
    }
    files.Add("trust-" + trust.world, RowsDrawing(chart), fmt::format("Bias of {}, points", trust.world));
  }
}

void AddComparisons(const RunSummary& summary, Files& files) {
  for (const WorldComparison& comparison : summary.comparisons) {
    if (comparison.points.empty()) continue;
    files.Add("worlds-" + comparison.other, ScatterDrawing(comparison, StylesOf(summary, comparison)),
              fmt::format("{} against {}", comparison.other, comparison.real));
  }
}

void AddStates(const RunSummary& summary, Files& files) {
  for (const WorldComparison& comparison : summary.comparisons) {
    for (const PairTable& table : comparison.tables) {
      std::vector<StateOutcomes> states;
      for (const EpisodePair& pair : table.pairs)
        states.push_back({summary.episodes[pair.real].outcome, summary.episodes[pair.other].outcome});
      if (states.empty()) continue;
      const std::string words = fmt::format(
          "Initial states of {} on {}, upper half {}, lower half {}: {} both succeed, {} only {}, {} only {}, {} both "
          "fail.",
          table.policy, table.task, comparison.real, comparison.other, table.both_succeed, table.real_only,
          comparison.real, table.other_only, comparison.other, table.both_fail);
      files.Add(fmt::format("states-{}-{}-{}", comparison.other, table.task, table.policy),
                StatesDrawing(states, words),
                fmt::format("{}, {}\nupper half {}, lower half {}; filled: success; a bar below marks a flip",
                            table.policy, table.task, comparison.real, comparison.other));
    }
  }
}

void AddStages(const StageReport& stages, const WorldMarks& marks, Files& files) {
  for (const StageFunnel& funnel : stages.funnels) {
    std::vector<std::string> worlds;
    for (const StageRow& row : funnel.worlds) worlds.push_back(row.world);
    files.Add(fmt::format("stages-{}-{}", funnel.task, funnel.policy), StageDrawing(funnel, marks),
              fmt::format("{}, {}\nreached, %: {}", funnel.policy, funnel.task, Key(worlds, marks)));
  }
}

void AddCheckpoints(const std::vector<CheckpointCurve>& curves, const WorldMarks& marks, Files& files) {
  for (const CheckpointCurve& curve : curves) {
    files.Add(fmt::format("checkpoints-{}-{}", curve.policy, curve.task), CheckpointDrawing(curve, marks),
              fmt::format("{}, {}\nsuccess, %: {}", curve.policy, curve.task, Key(curve.worlds, marks)));
  }
}

}  // namespace

std::vector<ChartFile> AsFiles(const std::vector<NamedDrawing>& drawings) {
  Files files;
  for (const NamedDrawing& one : drawings) files.Add(one.name, one.drawing, one.title);
  return files.Take();
}

bool IsChartFile(const std::string& name, const std::string& svg) {
  static constexpr const char* kKinds[] = {"rates-", "trust-", "worlds-", "states-", "stages-", "checkpoints-"};
  const auto begins = [&](const char* kind) { return name.starts_with(kind); };
  return std::ranges::any_of(kKinds, begins) && Slug(name) == name.substr(0, 80) && IsSvgFile(svg);
}

std::vector<ChartFile> ChartFilesOf(const ReportData& report) {
  Files files("judge " + JudgeWords(report.summary.options.judge));
  const WorldMarks marks = MarksOf(report.summary);
  AddRates(report.summary, marks, files);
  AddTrust(report, marks, files);
  AddComparisons(report.summary, files);
  AddStates(report.summary, files);
  AddStages(report.stages, marks, files);
  AddCheckpoints(report.checkpoints, marks, files);
  return files.Take();
}

}  // namespace evac
