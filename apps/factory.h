#pragma once

#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include "core/store.h"
#include "core/world.h"
#include "harness/policy_process.h"
#include "harness/suite.h"
#include "policies/lcm_policy.h"

namespace evac {

/// Suite entries become things: this is where modules meet.

/// Of task pages: a recording's rubric is in words, for people and models.
/// @throws InvalidInput naming task, stage and condition if the oracle could not judge by a rubric.
void CheckRubrics(const Suite& suite);

/// The world can start the task, and has the bodies that its rubric names (worlds without physics have none and are not
/// asked). @throws InvalidInput naming page and body, or page and state where the physics diverges as it settles.
void CheckStart(World& world, const Task& task, const InitialState& initial);

/// Tasks and worlds, as the store keeps them; checks rubrics and networks first.
void Declare(const Suite& suite, Store& store);

/// As many as the suite says, or one per core, of which no world takes more than 256.
int Threads(const Suite& suite, unsigned cores = std::thread::hardware_concurrency());

/// @param store  of the run, where imagined episodes find the real ones' first frames; null: there is none yet
/// @throws InvalidInput for what the world is made of that is wrong, or another than when the suite was read: network,
///   profile, task pages, scenes.
std::unique_ptr<World> MakeWorld(const SuiteWorld& world, const Suite& suite, const Store* store);

/// The command line of a policy with its program found and `${recording}` filled in.
/// @throws InvalidInput if the program is not there; for `${recording}` where there are several.
std::vector<std::string> CommandLine(const SuitePolicy& policy, const Suite& suite);

/// Under which name or checkpoint other than the suite's a joined policy declares itself, a sentence; empty: under none.
/// Its episodes are called as the suite says: who joined the process of another checkpoint is to know.
std::string DeclaredOtherwise(const SuitePolicy& policy, const PolicySpec& declared);

/// A policy's process, if it is ours to start, and the link to it; both gone with this, and before `policy` and `suite`.
class RunningPolicy {
 public:
  /// Starts and greets it. @param interrupted  asked while waiting for it.
  /// @throws InvalidInput with both declarations if it does not fit the suite's tasks; naming the suite's field if it
  /// needs an instruction and the suite says none of its recordings; naming it, and the log of one that was started, if
  /// it does not answer; naming a file of its that is another than when the suite was read (DemandUnchanged).
  RunningPolicy(const SuitePolicy& policy, const Suite& suite, const std::filesystem::path& run_folder,
                std::function<bool()> interrupted);

  Policy& policy() { return *link_; }
  int chunk_size() const { return spec_.chunk_size; }
  std::string declaration() const { return ToJson(spec_); }
  std::string declared_otherwise() const { return DeclaredOtherwise(entry_, spec_); }
  Counters counters() const;

  /// After its answers: one that was started again has read its files again. @throws InvalidInput as DemandUnchanged
  void CheckFiles();

 private:
  const SuitePolicy& entry_;
  const Suite& suite_;
  std::optional<PolicyProcess> process_;
  std::optional<LcmPolicy> link_;  ///< gone before the process
  PolicySpec spec_;
  int checked_ = 0;  ///< how many processes had declared themselves when its files were last looked at
};

}  // namespace evac
