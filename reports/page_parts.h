#pragma once

#include <string>

#include "reports/page.h"

/// The parts of the page, one function each, in the order they are read. All return HTML; texts are escaped inside.
namespace evac {

std::string PageStyle();   ///< CSS, light and dark
std::string PageScript();  ///< filters, videos in sync; the page reads without it

std::string FindingsPart(const RunSummary& summary);
std::string RatesPart(const RunSummary& summary);
std::string ScatterPart(const RunSummary& summary);
std::string FlipsPart(const RunSummary& summary, const PageOptions& options);
std::string ClipsPart(const RunSummary& summary, const PageOptions& options);
std::string ErrorsPart(const RunSummary& summary);
std::string ProvenancePart(const RunSummary& summary, const PageOptions& options);

/// "✓ success", with a class that colours it.
std::string OutcomeBadge(Outcome outcome);
/// The relative link of a file of the run, ready for an attribute.
std::string FileLink(const std::string& file, const PageOptions& options);
/// "width / height" of one frame of a task's videos, for CSS; empty if the task names no cameras.
std::string AspectRatio(const RunSummary& summary, const std::string& task);
/// Ids of an episode's clip and of a pair.
std::string ClipId(const Episode& episode);
std::string PairId(const PairKey& pair, const std::string& world);

}  // namespace evac
