#include <cstddef>
#include <cstdint>
#include <cstdlib>

#include "core/error.h"
#include "reports/real_trials_csv.h"

/// Whatever the bytes: the file is refused with one message, or every trial names what is known and none is there twice.
namespace {

void Require(bool holds) {
  if (!holds) std::abort();
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const evac::KnownNames known{.tasks = {"t", "take"},
                               .states = {{"t", "1"}, {"t", "2"}, {"take", "41-0001"}},
                               .policies = {{"p", "c"}, {"p", ""}},
                               .new_states_too = size % 2 == 0};
  try {
    const evac::RealTrialsCsv csv =
        evac::ReadRealTrialsCsv({reinterpret_cast<const char*>(data), size}, "fuzz.csv", known);
    Require(!csv.trials.empty());
    for (const evac::RealTrial& trial : csv.trials) {
      Require(known.tasks.contains(trial.task) && known.policies.contains({trial.policy, trial.checkpoint}));
      Require(known.new_states_too || known.states.contains({trial.task, trial.initial_state}));
      Require(trial.trial >= 0);
    }
    Require(evac::NewTrials(csv.trials, csv.trials).empty());
    Require(evac::NewTrials(csv.trials, {}).size() == csv.trials.size());
  } catch (const evac::Error& error) {
    Require(error.exit_code() == evac::ExitCode::kInvalidInput);
  }
  return 0;
}
