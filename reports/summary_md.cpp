#include "reports/summary_md.h"

#include <fmt/format.h>

#include <algorithm>
#include <cctype>

#include "reports/counted_judges.h"
#include "reports/findings.h"
#include "reports/html.h"
#include "reports/wording.h"

namespace evac {
namespace {

constexpr std::size_t kReserve = 4000;  // for provenance and the closing line

/// Inside a tag, where Markdown's marks mean nothing, but an empty line would end the tag.
std::string TagText(std::string_view text) {
  std::string safe = Escaped(text);
  std::ranges::replace_if(
      safe, [](char c) { return c == '\n' || c == '\t'; }, ' ');
  return safe;
}

/// Text that stops growing at a limit and knows how many rows it left out.
class Bounded {
 public:
  void Add(const std::string& text) { text_ += text; }
  /// A row, or one more left out.
  void AddRow(const std::string& row) {
    if (text_.size() + row.size() + kReserve > kMostSummaryBytes) {
      ++left_out_;
    } else {
      text_ += row;
    }
  }
  /// Says how many rows did not fit, if any.
  void EndRows(const char* what) {
    if (left_out_ > 0) text_ += fmt::format("\n{} more {}: report.json has all.\n", left_out_, what);
    left_out_ = 0;
  }
  bool IsFull() const { return text_.size() + kReserve > kMostSummaryBytes; }
  const std::string& text() const { return text_; }

 private:
  std::string text_;
  std::size_t left_out_ = 0;
};

void AddGate(const ShownGate& gate, Bounded& page) {
  const GateDecision& decision = gate.decision;
  page.Add(fmt::format("## Gate {}: {}\n\n", MarkdownText(decision.name), Name(decision.outcome)));
  if (!decision.judge.empty()) page.Add("Judge " + MarkdownText(JudgeWords(decision.judge)) + ".\n\n");
  if (!gate.is_current) page.Add("**Of older data:** the run has changed since.\n\n");
  page.Add("| rule | outcome | what was found |\n|---|---|---|\n");
  for (const RuleDecision& rule : decision.rules) {
    page.AddRow(fmt::format("| {} | {} | {}{} |\n", MarkdownText(rule.name), Name(rule.outcome),
                            MarkdownText(rule.statement), rule.more.empty() ? "" : " " + MarkdownText(rule.more)));
  }
  page.EndRows("rules");
  page.Add("\n");
}

void AddRates(const RunSummary& summary, Bounded& page) {
  page.Add("| task | policy | world | success rate | n | apart |\n|---|---|---|---|---|---|\n");
  for (const RateCell& cell : summary.rates) {
    page.AddRow(fmt::format("| {} | {} | {} | {} | {} | {} |\n", MarkdownText(cell.task), MarkdownText(cell.policy),
                            MarkdownText(cell.world), MarkdownText(PercentWithInterval(cell.rate)), cell.rate.n,
                            cell.Apart()));
  }
  page.EndRows("rates");
  page.Add(
      fmt::format("\n{:g} % intervals, clustered by initial state; judge {}. *Apart*: errors, cannot tell, invalid, "
                  "not judged; in no rate.\n\n",
                  100 * summary.options.confidence, MarkdownText(JudgeWords(summary.options.judge))));
}

void AddFindings(const RunSummary& summary, Bounded& page) {
  for (const Finding& finding : FindingsOf(summary)) {
    page.AddRow(fmt::format("- **{}** {} {}\n", Name(finding.decision), MarkdownText(finding.question),
                            MarkdownText(finding.answer)));
  }
  page.EndRows("findings");
  page.Add("\n");
}

void AddCounterExamples(const GateDecision& decision, Bounded& page) {
  for (const RuleDecision& rule : decision.rules) {
    if (rule.counter_examples.empty() || page.IsFull()) continue;
    const std::int64_t listed = std::ssize(rule.counter_examples), all = std::max(rule.flips_worse, listed);
    page.Add(fmt::format("<details><summary>{}: {} where only the baseline succeeded{}</summary>\n\n",
                         TagText(rule.name), Counted(all, "pair"),
                         listed < all ? fmt::format(", the first {}", listed) : ""));
    page.Add("| task | initial state | seed | candidate | baseline |\n|---|---|---|---|---|\n");
    for (const CounterExample& example : rule.counter_examples) {
      page.AddRow(fmt::format("| {} | {} | {} | {} | {} |\n", MarkdownText(example.task),
                              MarkdownText(example.initial_state), example.seed, MarkdownText(example.candidate_video),
                              MarkdownText(example.baseline_video)));
    }
    page.EndRows("pairs");
    page.Add("\n</details>\n\n");
  }
}

/// One (task, policy)'s pairs that ended differently in the two worlds.
void AddFlipsOf(const RunSummary& summary, const PairTable& table, Bounded& page) {
  for (const EpisodePair& pair : table.pairs) {
    const JudgedEpisode& real = summary.episodes[pair.real];
    const JudgedEpisode& other = summary.episodes[pair.other];
    if (!real.Counts() || !other.Counts() || real.outcome == other.outcome) continue;
    page.AddRow(fmt::format("| {} | {} | {} | {} | {} | {} |\n", MarkdownText(table.task), MarkdownText(table.policy),
                            MarkdownText(real.episode.key.pair.initial_state), real.episode.key.pair.seed,
                            Name(real.outcome), Name(other.outcome)));
  }
}

void AddFlips(const RunSummary& summary, const WorldComparison& comparison, Bounded& page) {
  std::int64_t flips = 0;
  for (const PairTable& table : comparison.tables) flips += table.real_only + table.other_only;
  if (flips == 0 || page.IsFull()) return;
  page.Add(fmt::format("<details><summary>{} between {} and {}</summary>\n\n", Counted(flips, "flip"),
                       TagText(comparison.real), TagText(comparison.other)));
  page.Add(fmt::format("| task | policy | initial state | seed | {} | {} |\n|---|---|---|---|---|---|\n",
                       MarkdownText(comparison.real), MarkdownText(comparison.other)));
  for (const PairTable& table : comparison.tables) AddFlipsOf(summary, table, page);
  page.EndRows("flips");
  page.Add("\n</details>\n\n");
}

void AddProvenance(const RunSummary& summary, Bounded& page) {
  const RunData& data = summary.data;
  page.Add(fmt::format(
      "<details><summary>Provenance</summary>\n\n- suite {}\n- run by evac {}\n- bootstrap B = {}, seed {}\n",
      MarkdownText(data.run.suite_hash), MarkdownText(data.run.evac_version), summary.options.bootstrap_replicates,
      summary.options.bootstrap_seed));
  for (const Task& task : data.tasks) {
    page.AddRow(fmt::format("- task {}: {} (rubric {})\n", MarkdownText(task.id), MarkdownText(task.instruction),
                            MarkdownText(task.rubric.version)));
  }
  page.EndRows("tasks");
  page.Add("\n</details>\n");
}

}  // namespace

std::string MarkdownText(std::string_view text) {
  std::string safe;
  const std::string escaped = Escaped(text);
  for (std::size_t i = 0; i < escaped.size(); ++i) {
    const char c = escaped[i];
    const auto is_word = [&](std::size_t at) {
      return at < escaped.size() && (std::isalnum(static_cast<unsigned char>(escaped[at])) || escaped[at] < 0);
    };
    const bool is_inside_word = i > 0 && is_word(i - 1) && is_word(i + 1);
    if (c == '\n' || c == '\t') {
      safe += ' ';
    } else {
      if (std::string_view("\\|*`[]~$").find(c) != std::string_view::npos || (c == '_' && !is_inside_word))
        safe += '\\';
      safe += c;
    }
  }
  return safe;
}

std::string SummaryMarkdown(const RunSummary& summary, const std::vector<ShownGate>& gates) {
  Bounded page;
  page.Add("# Policy evaluation\n\n");
  for (const ShownGate& gate : gates) AddGate(gate, page);
  AddRates(summary, page);
  AddFindings(summary, page);
  for (const ShownGate& gate : gates) AddCounterExamples(gate.decision, page);
  for (const WorldComparison& comparison : summary.comparisons) AddFlips(summary, comparison, page);
  AddProvenance(summary, page);
  return page.text();
}

}  // namespace evac
