#include "reports/junit.h"

#include <fmt/format.h>

#include <algorithm>

#include "reports/wording.h"
#include "reports/xml.h"

namespace evac {
namespace {

constexpr std::size_t kMostExamples = 20;  // in the text of one failure

/// One test case; `kind` is the element inside: failure, error, skipped, or nothing for a pass.
struct Case {
  std::string suite, class_name, name;
  std::string kind, message, text;
  std::string output;
};

struct Suite {
  std::string name;
  std::vector<Case> cases;
  std::ptrdiff_t Count(const std::string& kind) const { return std::ranges::count(cases, kind, &Case::kind); }
};

std::string ExamplesOf(const RuleDecision& rule) {
  std::string text;
  for (std::size_t i = 0; i < std::min(rule.counter_examples.size(), kMostExamples); ++i) {
    const CounterExample& example = rule.counter_examples[i];
    text += fmt::format("{} {} seed {}: candidate {}, baseline {}\n", example.task, example.initial_state, example.seed,
                        example.candidate_video.empty() ? "without a clip" : example.candidate_video,
                        example.baseline_video.empty() ? "without a clip" : example.baseline_video);
  }
  const std::int64_t listed = std::ssize(rule.counter_examples), all = std::max(rule.flips_worse, listed);
  if (all > std::min(listed, std::int64_t{kMostExamples})) text += Counted(all, "pair") + " in all\n";
  return text;
}

Case CaseOf(const ShownGate& gate, const RuleDecision& rule) {
  Case result{rule.task.empty() ? "all tasks" : rule.task, gate.decision.name, rule.name, "", "", "", ""};
  const std::string statement =
      rule.statement + (gate.is_current ? "" : " (Of older data: the run has changed since.)");
  if (rule.outcome == GateOutcome::kFail) {
    result.kind = "failure";
    result.message = statement;
    result.text = statement + "\n" + ExamplesOf(rule);
  } else if (rule.outcome == GateOutcome::kInconclusive) {
    result.kind = "skipped";
    result.message = "inconclusive: " + statement + (rule.more.empty() ? "" : " " + rule.more);
  }
  result.output = statement;
  return result;
}

/// Without gates nothing can fail; what could not run, or was not judged, can still be seen.
Case CaseOf(const RateCell& cell, const std::string& judge) {
  Case result{cell.task, cell.world, cell.policy, "", "", "", ""};
  result.output = fmt::format("{} of {} succeed, {}; {} apart; judge {}", cell.Of(Outcome::kSuccess), cell.rate.n,
                              PercentWithInterval(cell.rate), cell.Apart(), judge);
  if (const std::int64_t errors = cell.Of(Outcome::kError); errors > 0) {
    result.kind = "error";
    result.message = Counted(errors, "episode") + " could not go on: in no rate";
  } else if (cell.rate.n == 0) {
    result.kind = "skipped";
    result.message = "no episode has a verdict of success or failure";
  }
  return result;
}

std::vector<Suite> SuitesOf(std::vector<Case> cases) {
  std::vector<Suite> suites;
  for (Case& one : cases) {
    auto suite = std::ranges::find(suites, one.suite, &Suite::name);
    if (suite == suites.end()) suite = suites.insert(suites.end(), Suite{one.suite, {}});
    suite->cases.push_back(std::move(one));
  }
  return suites;
}

std::string CaseXml(const Case& one) {
  std::string xml = fmt::format("    <testcase classname=\"{}\" name=\"{}\" time=\"0\">\n",
                                XmlAttribute(one.class_name), XmlAttribute(one.name));
  if (one.kind == "skipped") xml += fmt::format("      <skipped message=\"{}\"/>\n", XmlAttribute(one.message));
  if (one.kind == "failure" || one.kind == "error")
    xml += fmt::format("      <{0} message=\"{1}\" type=\"{2}\">{3}</{0}>\n", one.kind, XmlAttribute(one.message),
                       one.kind == "failure" ? "regression" : "episodes", XmlText(one.text));
  return xml + "      <system-out>" + XmlText(one.output) + "</system-out>\n    </testcase>\n";
}

std::string SuiteXml(const Suite& suite) {
  std::string xml =
      fmt::format("  <testsuite name=\"{}\" tests=\"{}\" failures=\"{}\" errors=\"{}\" skipped=\"{}\" time=\"0\">\n",
                  XmlAttribute(suite.name), suite.cases.size(), suite.Count("failure"), suite.Count("error"),
                  suite.Count("skipped"));
  for (const Case& one : suite.cases) xml += CaseXml(one);
  return xml + "  </testsuite>\n";
}

}  // namespace

std::string JunitXml(const RunSummary& summary, const std::vector<ShownGate>& gates) {
  std::vector<Case> cases;
  for (const ShownGate& gate : gates) {
    for (const RuleDecision& rule : gate.decision.rules) cases.push_back(CaseOf(gate, rule));
  }
  if (gates.empty()) {
    for (const RateCell& cell : summary.rates) cases.push_back(CaseOf(cell, summary.options.judge));
  }
  const auto count = [&](const std::string& kind) { return std::ranges::count(cases, kind, &Case::kind); };
  std::string xml = fmt::format(
      "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n<testsuites name=\"evac\" tests=\"{}\" failures=\"{}\" "
      "errors=\"{}\" "
      "skipped=\"{}\" time=\"0\">\n",
      cases.size(), count("failure"), count("error"), count("skipped"));
  for (const Suite& suite : SuitesOf(std::move(cases))) xml += SuiteXml(suite);
  return xml + "</testsuites>\n";
}

}  // namespace evac
