#pragma once

#include <cstddef>
#include <string>
#include <string_view>
#include <vector>

#include "reports/gate_decision.h"
#include "reports/summary.h"

namespace evac {

/// GitHub takes a comment of 65 536 characters, and leaves a few for whoever posts it; a step's summary may be longer.
/// What does not fit is counted, not cut in silence.
inline constexpr std::size_t kMostSummaryBytes = 60'000;

/// The run in Markdown (GitHub's), for a pull request or $GITHUB_STEP_SUMMARY: gates if there were any, the table of
/// rates, the findings; flips, counter-examples and provenance folded. Never longer than kMostSummaryBytes.
std::string SummaryMarkdown(const RunSummary& summary, const std::vector<ShownGate>& gates);

/// A name or a sentence inside Markdown, on one line, without a meaning of its own: no tag, link, emphasis or column.
std::string MarkdownText(std::string_view text);

}  // namespace evac
