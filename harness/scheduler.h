#pragma once

#include <vector>

#include "core/store.h"
#include "harness/job.h"
#include "harness/suite.h"

namespace evac {

/// What the suite's initial state is on that task: each task draws its own placements.
InitialState StateOn(const Task& task, const InitialState& state);

/// Every episode of a suite in one world under one policy: tasks x initial states x seeds, in that order. The jobs point into
/// `suite.tasks`.
std::vector<Job> AllJobs(const Suite& suite, const SuiteWorld& world, const SuitePolicy& policy);

/// How many these are, of each task, world and policy of the suite.
std::vector<PlannedEpisodes> PlannedOf(const Suite& suite);

/// Those that the store does not have yet: what `resume` runs.
std::vector<Job> MissingJobs(std::vector<Job> jobs, const Store& store);

/// The worlds with the real one first, because its first frames are where imagined episodes start.
std::vector<SuiteWorld> RealFirst(std::vector<SuiteWorld> worlds);

}  // namespace evac
