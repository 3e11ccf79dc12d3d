#pragma once

#include <memory>

#include "core/store.h"
#include "core/world.h"
#include "harness/suite.h"

namespace evac {

/// The world of a suite's entry of type `evac`: its network loaded, its chunk cache opened.
/// @param store  where the real run's first frames are; null: nobody has run it, and only a recording can be started
/// from
/// @throws InvalidInput if page and weights are not of one network, or either is broken.
std::unique_ptr<World> MakeEvacWorld(const SuiteWorld& world, const Suite& suite, const Store* store);

/// The same without loading it: what is wrong with page and weights is known before the first episode of any world.
void CheckNetwork(const SuiteEvac& evac);

/// As many as the suite says, or one per core.
int Threads(const Suite& suite);

}  // namespace evac
