#pragma once

#include <map>
#include <string>
#include <vector>

#include "core/error.h"
#include "core/types.h"

/// Whose verdicts a report counts: one judge's, or, as "oracle,classifier", of each episode the first one's who could
/// tell. The oracle reads a simulated world's physics; of an imagined one it cannot tell, and who reads clips is asked.
namespace evac {

/// @param wanted  names, best first, with commas. "classifier" stands for the one judge "classifier:…" if there is one.
///                A judge's probes ("vlm:x:flip") are meant by their full names alone.
/// @param there   judges that gave verdicts, in the order of their names
/// @returns       the same with full names; a name that nobody bears stays as it is
/// @throws InvalidInput if an empty name is among them, or one stands for several judges.
std::string FullJudgeNames(const std::string& wanted, const std::vector<std::string>& there);

/// The first that says success or failure; if none does, the first there is.
/// @param counted  as FullJudgeNames gives it
/// @returns null if none of them gave a verdict
const Verdict* CountedVerdict(const std::map<std::string, Verdict>& verdicts, const std::string& counted);

bool IsCounted(const std::string& judge, const std::string& counted);

/// Who could still judge what nobody judged yet: the last of them, which the others leave it to.
std::string LastJudge(const std::string& counted);

/// The commands that give this judge's verdicts, one after the other; RUN, FILE, PAGE and STUDY stand for what the
/// reader has. @param judge  one name: whoever is no program's is people's.
std::vector<std::string> JudgingCommands(const std::string& judge);

/// What these commands give no verdict of, as a clause; empty where they give one of every episode.
std::string NeverJudged(const std::string& judge);

/// What to throw where a run has no verdict of anybody, whomever was asked for.
Error NobodyJudged(const std::string& run, const std::string& wanted);

/// For people: "oracle", "oracle, else classifier:0123456789ab".
std::string JudgeWords(const std::string& counted);

}  // namespace evac
