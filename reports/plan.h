#pragma once

#include <cstdint>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "core/statistics/planning.h"

/// How many episodes, raters and real trials, before any is made (docs/statistics.md): what `evac plan` prints.
namespace evac {

struct PlanOptions {
  double rate = 0.5;              ///< the success rate expected, in (0, 1)
  double difference = 0.1;        ///< between two policies that must not be missed, in (0, 1)
  std::optional<double> flips{};  ///< share of initial states in which the two policies' outcomes differ: at least the
                                  ///< difference, at most what the two rates leave room for; none: .2, or the nearer
                                  ///< end
  std::int64_t trials = 40;       ///< initial states at hand
  double margin = 0.1;            ///< of non-inferiority, in (0, 1)
  double correlation = 0.9;       ///< over policies that is to be shown, in (0, 1)
  double accuracy = 0.9;          ///< of one rater, in (0.5, 1]
  double wanted_right = 0.97;     ///< of the raters' majority, in (0, 1)
  std::int64_t imagined = 400;    ///< imagined trials beside the real ones, of each policy
  double agreement = 0.9;         ///< share of states in which model and robot have one outcome, in [0, 1]
  Promise promise = {};
};

/// One line of the table: a question, its number, and how it was found.
struct PlanRow {
  std::string key;       ///< for programs: "paired_states"
  std::string question;  ///< "initial states to see +10 points, both policies on the same ones"
  Number value = Undefined{"not computed"};
  std::string shown;  ///< "± 15 points", "78"
  std::string method;
};

struct Plan {
  PlanOptions options;             ///< `flips` never none
  std::vector<std::string> words;  ///< the advice, a sentence each
  std::vector<PlanRow> rows;
};

/// @throws InvalidInput for an option out of its range.
Plan MakePlan(const PlanOptions& options);

std::string PlanText(const Plan& plan);
nlohmann::ordered_json PlanJson(const Plan& plan);

}  // namespace evac
