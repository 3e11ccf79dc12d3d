#pragma once

#include <string>

#include "core/statistics/estimate.h"
#include "reports/charts.h"
#include "reports/page.h"
#include "reports/wording.h"

/// The parts of the page, one function each, in the order they are read. All return HTML; texts are escaped inside.
namespace evac {

std::string HeadlinesPart(const ReportData& report);                          ///< the first screen
std::string GatesPart(const ReportData& report, const PageOptions& options);  ///< empty without gates
std::string FindingsPart(const RunSummary& summary);                          ///< one question, one sentence
std::string RatesPart(const ReportData& report);
std::string TrustPart(const ReportData& report);
std::string ScatterPart(const RunSummary& summary);
/// One per point: the same policy looks the same on every task, in the order in which they come.
std::vector<PointStyle> StylesOf(const WorldComparison& comparison);
/// The scatter of one comparison, its statistics and its points.
std::string ComparisonPart(const WorldComparison& comparison, const std::vector<PointStyle>& styles);
std::string StatesPart(const RunSummary& summary, const PageOptions& options);
std::string StagesPart(const ReportData& report);
std::string CheckpointsPart(const ReportData& report);
std::string JudgesPart(const ReportData& report);
std::string ClipsPart(const RunSummary& summary);
std::string ErrorsPart(const RunSummary& summary);
std::string MethodsPart(const ReportData& report);
std::string ProvenancePart(const RunSummary& summary, const PageOptions& options);

/// The run as the page's script reads it: <script type="application/json" id="run-data">.
std::string DataPart(const RunSummary& summary, const PageOptions& options);

/// Which scripts a page carries.
enum class PageScripts {
  kNone,        ///< of a page that is only read
  kReport,      ///< of a report that lies on a disk: it connects to nothing
  kLive,        ///< of a dashboard's first page: it listens to /events
  kLiveReport,  ///< of a report inside a dashboard: both
};
std::string PageScript(PageScripts scripts);
/// From the doctype to </head>: styles, and a policy that forbids every script but these.
/// @param more  styles of this page alone
std::string PageHead(const std::string& title, PageScripts scripts, const std::string& more = "");

/// <body> of a run's page inside a dashboard, with what the script holds against the news (page/live.js).
std::string LiveBody(const PageOptions& options);

/// A table's cell: a value above its interval, or above the reason why it has none.
std::string StackedCell(const Estimate& estimate, std::string (*written)(double) = Plain);

/// "✓ success", with a class that colours it.
std::string OutcomeBadge(Outcome outcome);
/// A pill with one word, "yes", "not decided", "worse", coloured by what it says; nothing for an empty word.
std::string Tag(const std::string& word);
/// What a world's markers look like: its icon and name.
/// @param index  its mark (MarksOf)
std::string WorldKey(std::size_t index, const std::string& world);
/// The relative link of a file of the run, ready for an attribute.
std::string FileLink(const std::string& file, const PageOptions& options);
/// "width / height" of one frame of a task's videos, for CSS; empty if the task names no cameras.
std::string AspectRatio(const RunSummary& summary, const std::string& task);
/// Where an episode's clip is opened: "clip-…".
std::string ClipId(const Episode& episode);
/// The value of data-show: a click shows the clips of these (page/clips.js).
std::string ShowClips(const std::string& task, const std::string& policy, const std::string& world);

}  // namespace evac
