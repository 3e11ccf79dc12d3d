#pragma once

#include <set>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "core/store.h"

/// Trials on a real robot, from a lab's own table (docs/formats/real_trials_csv.md).
namespace evac {

/// What a row may name.
struct KnownNames {
  std::set<std::string> tasks;
  std::set<std::pair<std::string, std::string>> states;    ///< task, initial state
  std::set<std::pair<std::string, std::string>> policies;  ///< name, checkpoint
  bool new_states_too = false;                             ///< a state that is not known is accepted
};

struct RealTrialsCsv {
  std::vector<RealTrial> trials;      ///< in the order of the file; `video` as written, `source` "trials.csv:12"
  std::vector<std::string> warnings;  ///< one sentence each
  std::set<std::size_t> counted;      ///< places in `trials` of those whose number the file does not give
};

/// @param file  what messages call the text.
/// @throws InvalidInput naming every wrong line (at most 20) and what was wanted there; nothing is read in part.
RealTrialsCsv ReadRealTrialsCsv(std::string_view text, const std::string& file, const KnownNames& known);

/// Those of `trials` that `stored` does not hold yet.
/// @param trials   `source` with the file's absolute path in front: "/lab/monday/trials.csv:12". Of what is stored without
///                 a folder, as an earlier evac did, the file's own name alone is compared.
/// @param counted  as in RealTrialsCsv
/// @throws InvalidInput naming every one (at most 20) that is there with another outcome, or that is one of `counted` and
/// there from another file: it may be a repeat.
std::vector<RealTrial> NewTrials(const std::vector<RealTrial>& trials, const std::vector<RealTrial>& stored,
                                 const std::set<std::size_t>& counted = {});

}  // namespace evac
