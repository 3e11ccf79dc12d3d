#pragma once

#include <string>
#include <vector>

#include "reports/findings.h"
#include "reports/report_data.h"

/// What a reader wants to know first, in this order: is the candidate worse, where, can I trust the world model, what
/// next. Each answer is a short list with its numbers; nothing is said that no interval or test carries.
namespace evac {

struct HeadlineItem {
  std::string tag;   ///< "worse", "better", "not decided", "yes", "no", "unknown"; may be empty
  std::string text;  ///< one sentence or less
  std::string link;  ///< anchor on the page, "#trust"; may be empty
};

struct Headline {
  std::string question;
  std::vector<HeadlineItem> items;  ///< never empty
};

/// Always four, in the order above; decisions of gates come first in the first of them, the gravest before the others.
std::vector<Headline> HeadlinesOf(const ReportData& report);

}  // namespace evac
